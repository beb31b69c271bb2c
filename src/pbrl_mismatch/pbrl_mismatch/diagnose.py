"""From a recording to a diagnosis: is there a mismatch, where, what was left out, does the repair predict better."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import Recording
from pbrl_mismatch.data.residual import ResidualWrench, residual_wrench
from pbrl_mismatch.data.track import Track, lay_track
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.report import Finding, findings_of, held_out_report, sentence
from pbrl_mismatch.search.heldout import noise_floor
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.library import (
    Fitted,
    Stages,
    cut_stages,
    fit_baseline,
    hinge_guess,
    scene_of,
    search_library,
)
from pbrl_mismatch.search.predictive import Verdict, predictive_test
from pbrl_mismatch.search.weigh import Weighed, weigh
from pbrl_model.fitting.fit import body_of, motions_of
from pbrl_model.predict import UNKNOWN_MASS

Array = NDArray[np.float64]

LEAST_FORCE = 1e-9
UNKNOWN_MASS_SPREAD = 1.0
GROUNDS_OF_SETS = 2
"""So many of the likeliest hypotheses are tried with one effect more."""
NEAR_THE_FLOOR = 1.1
"""A hypothesis that needs less than this scale of the noise leaves nothing worth another effect."""
WORTH_A_KIND = 3.0
"""A kind of baseline with more parameters is worth a search of its own where it is better by this [nat]."""


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

    @property
    def repaired(self) -> Fitted:
        """Return the hypothesis to predict with: the named one, or the baseline."""
        return self.hypotheses[0].fitted if self.effects and self.hypotheses else self.baseline


@dataclass(frozen=True)
class Diagnosis:
    """What was found in a recording."""

    recording: Path
    objects: Mapping[str, ObjectDiagnosis]
    seconds: float

    def to_report(self) -> dict[str, Any]:
        """Return `report.json` of the command `diagnose`."""
        return {
            "recording": str(self.recording),
            "objects": {name: dict(found.report) for name, found in self.objects.items()},
            "next_experiment": None,
            "seconds": self.seconds,
        }


def diagnose(recording: Recording, options: DiagnoseOptions | None = None) -> Diagnosis:
    """Find out where a recording and the model of its objects part, and why.

    Args:
        recording: as read.
        options: None: the defaults.

    Raises:
        MismatchError: an object was not held, or nothing was felt while it was.
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
    seeds = np.random.SeedSequence(chosen.seed).spawn(len(names))
    objects = {
        name: _diagnose_object(seed, track_of(recording, name), chosen) for name, seed in zip(names, seeds, strict=True)
    }
    return Diagnosis(recording.path, objects, time.perf_counter() - started)


def track_of(recording: Recording, name: str) -> Track:
    """Return what was felt and seen of one object.

    Raises:
        MismatchError: nothing was felt while it was held.
        ModelError: a stream is missing or broken, or the object never moved.
    """
    motions = motions_of(recording, name)
    if max(float(np.abs(motion.wrench).max()) for motion in motions) < LEAST_FORCE:
        raise MismatchError(f"{name}: expected a force while it was held, got zero throughout; was the sensor on?")
    geometry = recording.bodies[name]
    return lay_track(recording, motions, geometry, body_of(geometry, motions[0].oriented))


def fit_baselines(rng: np.random.Generator, track: Track, stages: Stages, options: DiagnoseOptions) -> list[Fitted]:
    """Fit every kind of baseline, best first."""
    lower, upper = track.outline.min(axis=0), track.outline.max(axis=0)
    told = not math.isnan(track.nominal_mass)
    believed = BaselineOptions(
        track.nominal_mass if told else UNKNOWN_MASS,
        options.mass_spread if told else UNKNOWN_MASS_SPREAD,
        options.inertia_spread,
        options.delay_spread,
    )
    hinge = hinge_guess(track) if "hinge" in options.baseline else None
    if "hinge" in options.baseline and hinge is None:
        raise MismatchError(f"{track.object}: expected a motion that is not along a line for a hinge, got one that is")
    kinds = baselines(believed, options.baseline, 0.5 * (lower + upper), 0.5 * (upper - lower), hinge)
    fitted = [fit_baseline(rng, track, kind, stages, options) for kind in kinds]
    return sorted(fitted, key=lambda each: -each.evidence)


def _diagnose_object(seed: np.random.SeedSequence, track: Track, options: DiagnoseOptions) -> ObjectDiagnosis:
    first, second = seed.spawn(2)
    stages = cut_stages(track, options)
    bases = fit_baselines(np.random.default_rng(first), track, stages, options)
    baseline = bases[0]
    verdict = predictive_test(baseline.peak, 0)
    mismatch = verdict.p_value < options.level
    weighed: tuple[Weighed, ...] = ()
    if mismatch:
        weighed = _searched(second, track, bases, stages, options)
    scene = scene_of(track, baseline.row)
    found = findings_of(baseline, weighed, scene)
    residual = residual_wrench(track, baseline.row)
    floor = noise_floor(stages.heldout) if stages.heldout is not None else (math.nan, math.nan)
    named = found.effects[0].fitted if found.effects else baseline
    left = _unexplained(baseline, weighed[0].fitted if weighed else baseline)
    report = {
        "mismatch": mismatch,
        "p_value": verdict.p_value,
        "effects": [each.to_report() for each in found.effects],
        "alternatives": [each.to_report() for each in found.alternatives],
        "unexplained_fraction": left,
        "unknown": mismatch and not found.effects,
        "heldout": held_out_report(baseline, named, floor),
    }
    notes = (sentence(track.object, mismatch, verdict, found), *found.notes)
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
        notes,
    )


def _searched(
    seed: np.random.SeedSequence, track: Track, bases: list[Fitted], stages: Stages, options: DiagnoseOptions
) -> tuple[Weighed, ...]:
    """Try single effects, then others on top of the likeliest for as long as something is still left out."""
    seeds = seed.spawn(options.most_together)
    tried = search_library(seeds[0], track, _grounds(bases), stages, options)
    weighed = weigh(bases, tried, options)
    for depth in range(1, options.most_together):
        deepest = [each.fitted for each in weighed if len(each.effects) == depth][:GROUNDS_OF_SETS]
        best = weighed[0]
        enough = len(best.effects) < depth or best.fitted.noise_scale < NEAR_THE_FLOOR
        if enough or not deepest or predictive_test(best.fitted.peak, 0).p_value >= options.level:
            break
        tried += search_library(seeds[depth], track, deepest, stages, options)
        weighed = weigh(bases, tried, options)
    return weighed


def _grounds(bases: list[Fitted]) -> list[Fitted]:
    """Return the baselines that effects are tried on: the simplest, the next, and others that are better than those.

    The best kind alone will not do: what an effect did, a wheel with two axes may have learned to stand in for, or
    may have kept a fit from finding the wheel at all.
    """
    ordered = sorted(bases, key=lambda each: len(each.hypothesis.parameters))
    if ordered[0] is bases[0] and ordered[0].noise_scale < NEAR_THE_FLOOR:
        return ordered[:1]
    kept = ordered[:2]
    for each in ordered[2:]:
        if each.evidence > max(other.evidence for other in kept) + WORTH_A_KIND:
            kept.append(each)
    return kept


def _unexplained(baseline: Fitted, repaired: Fitted) -> float:
    """Return the share of the baseline's misfit above noise that a repair leaves, 0..1."""
    count = baseline.peak.objective.observations
    before, after = (float(each.peak.misfit[0]) / count - 1.0 for each in (baseline, repaired))
    return float(np.clip(after / before, 0.0, 1.0)) if before > 0.0 else 0.0
