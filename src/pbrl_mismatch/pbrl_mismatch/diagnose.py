"""From a recording to a diagnosis: is there a mismatch, where, what was left out, does the repair predict better."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import Recording
from pbrl_mismatch.data.grip import GripTrack, lay_grips
from pbrl_mismatch.data.residual import ResidualWrench, residual_wrench
from pbrl_mismatch.data.track import Track, after_closing, lay_track
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.faults.sound import check_track, missing_notes, without_faults
from pbrl_mismatch.next_experiment.candidates import Reach
from pbrl_mismatch.next_experiment.experiment import NextExperiment, next_experiment
from pbrl_mismatch.observability.detectable import could_not_show
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.report import Finding, findings_of, held_otherwise, held_out_report, sentence
from pbrl_mismatch.search.explain import explain, held_against
from pbrl_mismatch.search.fitted import (
    Fitted,
    Stages,
    cut_stages,
    fit_baseline,
    hinge_guess,
    judged,
    likeliest_first,
    scene_of,
)
from pbrl_mismatch.search.grip import BETWEEN, beside_motion, grip_evidence
from pbrl_mismatch.search.heldout import noise_floor
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.p_values import UNBELIEVABLE, least_of_two, with_library
from pbrl_mismatch.search.posterior import with_draws
from pbrl_mismatch.search.predictive import Verdict, predictive_test
from pbrl_mismatch.search.told_baseline import ToldBaseline, told_baselines
from pbrl_mismatch.search.weigh import Weighed
from pbrl_mismatch.unknown.describe import describe_unknown
from pbrl_mismatch.where.contacts import contact_notes
from pbrl_mismatch.where.localise import localise
from pbrl_model.errors import ModelError
from pbrl_model.fitting.episodes import body_of, motions_of, usable_episodes
from pbrl_model.predict import UNKNOWN_MASS
from pbrl_model.sensing.wrench_error import wrench_error
from pbrl_model.verdicts import note_on_unheard

Array = NDArray[np.float64]

LEAST_FORCE = 1e-9
UNKNOWN_MASS_SPREAD = 1.0
NOTHING_HELD_OUT = (
    "no push lasts long enough to leave some of it out of the fit: the name rests on the evidence alone, and no "
    "forecast has put it to the test"
)


@dataclass(frozen=True)
class ObjectDiagnosis:
    """What was found on one object.

    Attributes:
        mismatch: whether recording and baseline part.
        verdict: the test of the baseline.
        baseline: fitted.
        hypotheses: effects that were tried, likeliest first; empty where there is no mismatch.
        effects: the hypothesis that is named; empty where there is no mismatch or it is unknown.
        alternatives: others, likeliest first.
        unknown: whether there is a mismatch that nothing in the library explains.
        unexplained_fraction: share of the baseline's misfit that is left after the repair.
        residual: wrench that the baseline lacks.
        report: this object's part of `report.json`.
        notes: what must not be read into it, in sentences.
        next_push: the push that would tell most of the hypotheses apart; None where there is nothing to tell.
        hold_alone: whether only gripper and body part, and how the body moves goes with the model.
    """

    mismatch: bool
    verdict: Verdict
    baseline: Fitted
    hypotheses: tuple[Weighed, ...]
    effects: tuple[Finding, ...]
    alternatives: tuple[Finding, ...]
    unknown: bool
    unexplained_fraction: float
    residual: ResidualWrench
    report: Mapping[str, Any]
    notes: tuple[str, ...]
    next_push: NextExperiment | None = None
    hold_alone: bool = False

    @property
    def repaired(self) -> Fitted:
        """Return the hypothesis to predict with: the named one, or the baseline."""
        return self.hypotheses[0].fitted if self.effects and self.hypotheses else self.baseline


@dataclass(frozen=True)
class Diagnosis:
    """What was found in a recording.

    Attributes:
        recording: where it is.
        objects: what was found on each.
        seconds: that it took.
        refused: objects that could not be diagnosed beside those, and why.
    """

    recording: Path
    objects: Mapping[str, ObjectDiagnosis]
    seconds: float
    refused: Mapping[str, str] = field(default_factory=dict)

    def to_report(self) -> dict[str, Any]:
        """Return `report.json` of the command `diagnose`; `refused` is in it only where an object was."""
        refused = {"refused": dict(self.refused)} if self.refused else {}
        pushes = [found.next_push for found in self.objects.values() if found.next_push is not None]
        return {
            "recording": str(self.recording),
            "objects": {name: {**found.report, "notes": list(found.notes)} for name, found in self.objects.items()},
            "next_experiment": max(pushes, key=lambda each: each.expected_bits).to_report() if pushes else None,
            "seconds": self.seconds,
            **refused,
        }


def diagnose(recording: Recording, options: DiagnoseOptions | None = None) -> Diagnosis:
    """Find out where a recording and the model of its objects part, and why.

    Args:
        recording: as read.
        options: None: the defaults.

    An object that cannot be diagnosed is refused beside others that can; alone, or where it was asked for, it is an
    error.

    Raises:
        MismatchError: an object was not held, nothing was felt while it was, or no model that was told is of any.
        ModelError: a stream is missing or broken, or an object never moved.
        BagError: an episode is malformed.
    """
    chosen = options or DiagnoseOptions()
    started = time.perf_counter()
    held = sorted({grasp.object for grasp in recording.grasps})
    for name in chosen.objects:
        if name not in held:
            raise MismatchError(
                f"diagnose: expected objects that were held ({', '.join(held) or 'none was'}), got {name!r}"
            )
    names = chosen.objects or held
    if not names:
        raise MismatchError(f"{recording.path}: expected at least one grasp to diagnose, got none")
    told = told_baselines(names, chosen)
    seeds = np.random.SeedSequence(chosen.seed).spawn(len(names))
    objects: dict[str, ObjectDiagnosis] = {}
    refused: dict[str, MismatchError | ModelError] = {}
    for name, each in zip(names, seeds, strict=True):
        try:
            objects[name] = _diagnosed(each, recording, name, told.get(name), chosen)
        except (MismatchError, ModelError) as error:
            if name in chosen.objects:
                raise
            refused[name] = error
    if not objects:
        raise next(iter(refused.values()))
    why = {name: str(error) for name, error in refused.items()}
    return Diagnosis(recording.path, objects, time.perf_counter() - started, why)


def _diagnosed(
    seed: np.random.SeedSequence, recording: Recording, name: str, told: ToldBaseline | None, options: DiagnoseOptions
) -> ObjectDiagnosis:
    """Diagnose one object of a recording; see `diagnose`."""
    track = track_of(recording, name)
    room = recording.room if len(recording.room) > 2 else None
    found = _diagnose_object(seed, track, lay_grips(recording, track), room, told, options)
    error = wrench_error(recording, track.motions, body_of(recording.bodies[name], track.motions[0].oriented))
    notes, where = [*found.notes, *_poor_force(error)], None
    # Where the motion goes with the model there is no wrench to place, only noise.
    if found.mismatch and not found.hold_alone:
        try:
            where = localise(track, found.baseline.row, recording)
            notes += contact_notes(name, where.contacts)
        except MismatchError as error:
            notes.append(f"where the two part cannot be told: {error}")
    report = {**found.report, "localisation": None if where is None else where.to_report()}
    return replace(found, report=report, notes=tuple(notes))


def _poor_force(error: float) -> tuple[str, ...]:
    """Return a sentence where no sensor measured the force, which is then off by so much [N] for seconds."""
    if error == 0.0:
        return ()
    return (
        f"the force is not a sensor's: it is off by {error:.2g} N for seconds, and an effect that is no larger may be "
        "the robot's own joints",
    )


def track_of(recording: Recording, name: str) -> Track:
    """Return what was felt and seen of one object, and what of it is not to be believed.

    Raises:
        MismatchError: nothing was felt while it was held, it did not move, or something else was held in its place.
        ModelError: a stream is broken.
    """
    sound = without_faults(recording, name)
    motions = [after_closing(motion) for motion in motions_of(sound.recording, name)]
    if max(float(np.abs(motion.wrench).max()) for motion in motions) < LEAST_FORCE:
        raise MismatchError(f"{name}: expected a force while it was held, got zero throughout; was the sensor on?")
    geometry = recording.bodies[name]
    laid = lay_track(sound.recording, motions, geometry, body_of(geometry, motions[0].oriented))
    unheard = len(usable_episodes(sound.recording, name)) - len(motions)
    track = replace(laid, missing=sound.missing, unheard=unheard)
    check_track(track)
    return track


def fit_baselines(
    rng: np.random.Generator,
    track: Track,
    stages: Stages,
    options: DiagnoseOptions,
    told: ToldBaseline | None = None,
) -> list[Fitted]:
    """Fit every kind of baseline, best first; of a told model there is one kind."""
    if told is not None:
        return [fit_baseline(rng, track, told.hypothesis, stages, options)]
    lower, upper = track.outline.min(axis=0), track.outline.max(axis=0)
    known = not math.isnan(track.nominal_mass)
    believed = BaselineOptions(
        track.nominal_mass if known else UNKNOWN_MASS,
        options.mass_spread if known else UNKNOWN_MASS_SPREAD,
        options.inertia_spread,
        options.delay_spread,
        options.grasp_spread,
        options.outline_spread,
    )
    hinge = hinge_guess(track) if "hinge" in options.baseline else None
    if "hinge" in options.baseline and hinge is None:
        raise MismatchError(f"{track.object}: expected a motion that is not along a line for a hinge, got one that is")
    kinds = baselines(believed, options.baseline, 0.5 * (lower + upper), 0.5 * (upper - lower), hinge)
    with ThreadPoolExecutor(options.workers) as pool:
        own = zip(rng.spawn(len(kinds)), kinds, strict=True)
        return likeliest_first(pool.map(lambda each: fit_baseline(each[0], track, each[1], stages, options), own))


def _diagnose_object(
    seed: np.random.SeedSequence,
    track: Track,
    grips: GripTrack | None,
    room: Array | None,
    told: ToldBaseline | None,
    options: DiagnoseOptions,
) -> ObjectDiagnosis:
    first, second, third, fourth = seed.spawn(4)
    of_model = () if told is None else told.effects
    options = options.model_copy(update={"without": (*options.without, *of_model)})
    stages = cut_stages(track, options)
    bases = fit_baselines(np.random.default_rng(first), track, stages, options, told)
    grip = grip_evidence(grips, options.delay_spread, of_model) if grips is not None else None
    bases = [beside_motion(each, grip) for each in bases]
    # Which parameters the baseline has at its best is known only now: effects lead it to where they found them.
    explained = explain(second, track, bases, stages, grip, options)
    baseline = judged(explained.bases[0], explained.stages, options, even=True)
    verdict = predictive_test(baseline.peak, 0)
    held, moves = 1.0 if grip is None else grip.p_value, verdict.either
    p_value = moves if grip is None else least_of_two(moves, held)
    verdict = replace(verdict, p_value=with_library(p_value, explained.log_odds))
    mismatch = verdict.p_value < options.level
    weighed = held_against(explained, baseline, options) if mismatch else ()
    if weighed and weighed[0].effects:
        likeliest = with_draws(np.random.default_rng(fourth), weighed[0].fitted, options.workers)
        weighed = (replace(weighed[0], fitted=likeliest), *weighed[1:])
    scene, rng = scene_of(track, baseline.row), np.random.default_rng(third)
    found = findings_of(baseline, weighed, scene, exact=told is None)
    residual = residual_wrench(track, baseline.row, memory=None)
    floor = noise_floor(stages.split.told) if stages.split is not None else (math.nan, math.nan)
    named = found.effects[0].fitted if found.effects else baseline
    left = _unexplained(baseline, weighed[0].fitted if weighed else baseline)
    absent = [name for name in options.effects if name not in named.hypothesis.effects]
    hidden = could_not_show(rng, named, absent, grip, options.workers, level=options.level)
    report = {
        "mismatch": mismatch,
        "p_value": verdict.p_value,
        "effects": [each.to_report() for each in found.effects],
        "alternatives": [each.to_report() for each in found.alternatives],
        "unexplained_fraction": left,
        "unknown": mismatch and not found.effects,
        "heldout": held_out_report(baseline, named, floor),
        "not_shown": [each.to_report() for each in hidden],
        "unknown_description": None,
    }
    notes = [sentence(track.object, mismatch, verdict, found)]
    between = mismatch and held < UNBELIEVABLE and not set(BETWEEN) & set(named.hypothesis.effects)
    hold_alone = between and not found.effects and moves >= options.level
    if between:
        notes.append(held_otherwise(held, moves, options.level))
    notes += [*found.notes, *missing_notes(track)]
    notes += note_on_unheard(track.unheard)
    if found.effects and baseline.score is None:
        notes.append(NOTHING_HELD_OUT)
    if mismatch and not found.effects and not hold_alone:
        try:
            report["unknown_description"] = describe_unknown(rng, track, residual, baseline.row).to_report()
        except MismatchError as error:
            notes.append(f"what is left out cannot be described: {error}")
    push = next_experiment(rng, track, weighed, Reach(room=room)) if mismatch and len(weighed) > 1 else None
    return ObjectDiagnosis(
        mismatch,
        verdict,
        baseline,
        weighed,
        found.effects,
        found.alternatives,
        mismatch and not found.effects,
        left,
        residual,
        report,
        tuple(notes),
        push,
        hold_alone,
    )


def _unexplained(baseline: Fitted, repaired: Fitted) -> float:
    """Return the share of the baseline's misfit above noise that a repair leaves, 0..1."""
    count = baseline.peak.objective.observations
    before, after = (float(each.peak.misfit[0].sum()) / count - 1.0 for each in (baseline, repaired))
    return float(np.clip(after / before, 0.0, 1.0)) if before > 0.0 else 0.0
