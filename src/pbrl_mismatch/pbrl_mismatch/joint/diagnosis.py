"""A diagnosis of doors: is constant friction enough, what was left out, at which angle, does it predict better."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import Recording
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.joint.evidence import Explained
from pbrl_mismatch.joint.heldout import WIDER, HeldOut, correlation_length, from_beginning, in_blocks, noise_of
from pbrl_mismatch.joint.laws import laws_of
from pbrl_mismatch.joint.pull import Pull, is_pull, pull_of
from pbrl_mismatch.joint.reported import Finding, finding_of, held_out_report, hinge_report, notes_of
from pbrl_mismatch.joint.search import Weighed, search
from pbrl_mismatch.joint.significance import p_value
from pbrl_mismatch.options import DiagnoseOptions

Array = NDArray[np.float64]

NAMED = 0.5
"""An effect is named where the sets that have it are at least so probable together."""
SHOWN = 8


@dataclass(frozen=True)
class DoorDiagnosis:
    """What was found on one door.

    Attributes:
        pull: what was felt.
        mismatch: whether constant friction on a hinge is not enough.
        p_value: of constant friction.
        baseline: constant friction, fitted.
        hypotheses: sets of effects that were tried, likeliest first.
        effects: what is named; empty where there is no mismatch or it is unknown.
        alternatives: others, likeliest first.
        repaired: with what is named; the baseline where nothing is.
        blocks: held-out prediction by blocks of the angle, of the likeliest set.
        wider: the same with other widths of blocks.
        rest: the last of the angle predicted from its beginning, or None.
        report: this object's part of `report.json`.
        notes: the verdict, then what must not be read into it, in sentences.
    """

    pull: Pull
    mismatch: bool
    p_value: float
    baseline: Explained
    hypotheses: tuple[Weighed, ...]
    effects: tuple[Finding, ...]
    alternatives: tuple[Finding, ...]
    repaired: Explained
    blocks: HeldOut
    wider: tuple[HeldOut, ...]
    rest: HeldOut | None
    report: Mapping[str, Any]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class DoorsDiagnosis:
    """What was found in a recording of doors."""

    recording: Path
    objects: Mapping[str, DoorDiagnosis]
    seconds: float

    def to_report(self) -> dict[str, Any]:
        """Return `report.json` of the command `diagnose`."""
        return {
            "recording": str(self.recording),
            "objects": {name: {**found.report, "notes": list(found.notes)} for name, found in self.objects.items()},
            "next_experiment": None,
            "seconds": self.seconds,
        }


def is_for_doors(recording: Recording, baseline: tuple[str, ...] | None) -> bool:
    """Tell whether a recording is to be diagnosed by the force along a path.

    Args:
        recording: as read.
        baseline: kinds that were asked for; None: nothing was said, which counts as "hinge" where only a path was seen.
    """
    return is_pull(recording) and baseline in (None, ("hinge",))


def diagnose_doors(recording: Recording, options: DiagnoseOptions | None = None) -> DoorsDiagnosis:
    """Find out what constant friction on a hinge leaves out.

    Args:
        recording: of nothing but paths and forces, see `is_pull`.
        options: those that matter are `objects`, `without`, `level`, `none_odds` and `seed`.

    Raises:
        MismatchError: an object was not held, was not turned far enough, or an option does not fit.
        ModelError: a stream is missing or broken.
        BagError: an episode is malformed.
    """
    chosen = options or DiagnoseOptions(baseline=("hinge",))
    started = time.perf_counter()
    held = sorted({grasp.object for grasp in recording.grasps})
    for name in chosen.objects:
        if name not in held:
            raise MismatchError(f"diagnose: expected objects that were held ({', '.join(held)}), got {name!r}")
    names = chosen.objects or held
    if not names:
        raise MismatchError(f"{recording.path}: expected at least one grasp to diagnose, got none")
    seeds = np.random.SeedSequence(chosen.seed).spawn(len(names))
    objects = {
        name: diagnose_pull(np.random.default_rng(seed), pull_of(recording, name), chosen)
        for name, seed in zip(names, seeds, strict=True)
    }
    return DoorsDiagnosis(recording.path, objects, time.perf_counter() - started)


def diagnose_pull(rng: np.random.Generator, pull: Pull, options: DiagnoseOptions) -> DoorDiagnosis:
    """Diagnose one door from what was felt along its way."""
    laws = laws_of(options.without)
    chance = p_value(rng, pull, laws)
    weighed = search(rng, pull, laws, none_odds=options.none_odds)
    baseline = next(each.explained for each in weighed if not each.effects)
    mismatch = chance < options.level
    likely = named_set(weighed) if mismatch else None
    # Where nothing is named, what is told of held-out blocks is how the likeliest set would do.
    tried = likely or next((each for each in weighed if each.effects), weighed[0])
    tried_laws = tried.explained.hypothesis.laws
    blocks = in_blocks(pull, tried_laws)
    if likely is not None and blocks.score_after < blocks.score_before:
        likely = None
    repaired = likely.explained if likely else baseline
    wider = tuple(in_blocks(pull, tried_laws, width, 1) for width in WIDER) if likely else ()
    rest = from_beginning(pull, tried_laws) if likely else None
    share = marginals(weighed)
    effects = tuple(finding_of(repaired, law, share[law.effect]) for law in repaired.hypothesis.laws)
    alternatives = tuple(
        finding_of(each.explained, law, each.probability)
        for each in [each for each in weighed if each.effects and each is not likely and mismatch][:SHOWN]
        for law in each.explained.hypothesis.laws
    )
    left = pull.force - repaired.law_force(pull)
    before = pull.force - baseline.law_force(pull)
    named_blocks = (
        blocks
        if likely
        else replace(blocks, after=blocks.before, rmse_after=blocks.rmse_before, score_after=blocks.score_before)
    )
    report = {
        "mismatch": mismatch,
        "p_value": chance,
        "effects": [each.to_report() for each in effects],
        "alternatives": [each.to_report() for each in alternatives],
        "unexplained_fraction": _share_left(left, before),
        "unknown": mismatch and not effects,
        "heldout": held_out_report(named_blocks, wider, rest, noise_of(pull)),
        "not_shown": [],
        "unknown_description": _described(pull, left) if mismatch else None,
        "hinge": hinge_report(pull),
    }
    notes = notes_of(pull, chance, mismatch, repaired, effects, blocks, correlation_length(pull, left))
    return DoorDiagnosis(
        pull,
        mismatch,
        chance,
        baseline,
        weighed,
        effects,
        alternatives,
        repaired,
        blocks,
        wider,
        rest,
        report,
        notes,
    )


def marginals(weighed: tuple[Weighed, ...]) -> dict[str, float]:
    """Return the probability of every effect: of all sets that have it."""
    share: dict[str, float] = {}
    for each in weighed:
        for effect in each.effects:
            share[effect] = share.get(effect, 0.0) + each.probability
    return {effect: min(chance, 1.0) for effect, chance in share.items()}


def named_set(weighed: tuple[Weighed, ...]) -> Weighed | None:
    """Return the set of all effects that are likely by themselves, where it was tried; otherwise None."""
    likely = {effect for effect, share in marginals(weighed).items() if share >= NAMED}
    return next((each for each in weighed if likely and set(each.effects) == likely), None)


def _share_left(left: Array, before: Array) -> float:
    """Return the share of the baseline's squared error that a repair leaves."""
    total = float(before @ before)
    return float(np.clip(left @ left / total, 0.0, 1.0)) if total > 0.0 else 0.0


def _described(pull: Pull, left: Array) -> dict[str, Any]:
    """Say what is left that no law has."""
    worst = int(np.argmax(np.abs(left)))
    length = correlation_length(pull, left)
    rms = float(math.sqrt(np.mean(left**2)))
    text = (
        f"what no law has: {rms:.2g} N in the root mean square, alike over {math.degrees(length):.1f} degrees, most at "
        f"{math.degrees(pull.angle[worst]):.1f} degrees ({left[worst]:+.2g} N)"
    )
    return {
        "sentences": [text],
        "rms_N": rms,
        "length_rad": length,
        "worst_angle_rad": float(pull.angle[worst]),
        "worst_N": float(left[worst]),
    }
