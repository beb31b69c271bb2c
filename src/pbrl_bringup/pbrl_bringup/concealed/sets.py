"""The sets of a bench on concealed things: which cases, how each is told, and with which options it is diagnosed."""

from __future__ import annotations

import difflib
import hashlib
import itertools
import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import BodyGeometry, PoseStream, Recording
from pbrl_bringup.concealed.cases import Case, make
from pbrl_bringup.concealed.draws import DRAWS
from pbrl_bringup.concealed.furnished import PART_OF_IT, bare_recording, draw_furnished, with_casters
from pbrl_bringup.concealed.oracle import Oracle
from pbrl_bringup.concealed.stage import Stage
from pbrl_bringup.concealed.truth import Truth
from pbrl_bringup.errors import BringupError
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.told_baseline import ToldBaseline

Array = NDArray[np.float64]

FIRST_SEED = 10_000
"""Scored seeds begin here; those below are for development."""
SETS = {
    "clean": "nothing is concealed; tags out of step with all else by what is no fault",
    "single": "one effect",
    "pairs": "two effects at once",
    "withheld": "one effect, and the library does without it",
    "rough": "one effect; mass told to 20 %, grasp direction to 0.1 rad, outline to 2 cm",
    "furnished": "a table on real casters, its model repaired for those, and one effect on top",
}
"""Sets by name, and what is concealed in each."""
CLEAN_PER_SEED = 10
"""Clean recordings for each recording an effect."""
SPACING = 1_200
"""Between the first seeds of two sets: no two share a recording."""
SPARES = 3
"""Seeds that are tried for one case, where a draw does not come to act."""
SPARE_STEP = 400
"""Between those seeds."""
CLEAN, SINGLE, PAIRS, WITHHELD, ROUGH, FURNISHED = 100, 10, 40, 1, 3, 3
"""Recordings of a set: in all, an effect, in all, an effect, an effect, an effect."""
QUICK_SETS, QUICK_CLEAN, QUICK_EFFECTS = ("clean", "single"), 2, ("payload_change", "tether")
MASS_OFF, TURN_OFF, OUTLINE_OFF = 0.2, 0.1, 0.02
"""What is told wrongly in "rough": mass (of its logarithm), grasp direction [rad], as standard deviations; sides of the
outline at most [m]."""
ROUGHLY = {"mass_spread": MASS_OFF, "grasp_spread": TURN_OFF, "outline_spread": OUTLINE_OFF / math.sqrt(3.0)}
"""The same as a diagnosis is told it, all as standard deviations."""
APART = (
    frozenset({"ground_friction", "breakaway_friction", "caster_swivel"}),
    frozenset({"hidden_hinge", "hidden_obstacle", "unseen_body", "detent", "floor_patch", "tether"}),
    frozenset({"com_offset", "pose_bias"}),
)
"""Effects that do not go together: feet of two kinds; a pin keeps a table from its way to anything; the same thing to a
free body. Of the second group only the pin excludes the others."""


@dataclass(frozen=True)
class Trial:
    """One case of a set.

    Attributes:
        set: its name.
        case: what is concealed; its seed is the first that is tried.
        withheld: effects that the library does without.
    """

    set: str
    case: Case
    withheld: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Return what to call it."""
        return f"{self.set}/{self.case.name}"

    @property
    def folder(self) -> str:
        """Return the name of its folder, which says nothing of what is concealed: a diagnosis sees the path."""
        return hashlib.sha256(self.name.encode()).hexdigest()[:12]

    @property
    def options(self) -> dict[str, Any]:
        """Return the settings of its diagnosis, by name in `DiagnoseOptions`."""
        told: dict[str, Any] = ROUGHLY if self.set == "rough" else {}
        return told | ({"without": list(self.withheld)} if self.withheld else {})


def check_sets(names: Sequence[str]) -> tuple[str, ...]:
    """Return names of sets, each once.

    Raises:
        BringupError: there is none of one of the names.
    """
    for name in names:
        if name not in SETS:
            near = difflib.get_close_matches(name, SETS, 1)
            advice = f"; did you mean {near[0]!r}?" if near else ""
            raise BringupError(f"--sets: expected some of {', '.join(SETS)}, got {name!r}{advice}")
    return tuple(dict.fromkeys(names))


def trials_of(seed: int, quick: bool, sets: Sequence[str] = (), most: int | None = None) -> list[Trial]:
    """Return the trials of a run.

    Args:
        seed: of the run; no two runs share a recording.
        quick: a few recordings of each set.
        sets: names; none: all, or in a quick run clean and single.
        most: recordings an effect at most, and ten times as many clean ones; None: all.

    Raises:
        BringupError: there is no set of such a name.
    """
    chosen = check_sets(sets) or (QUICK_SETS if quick else tuple(SETS))
    found = []
    for name in chosen:
        counts: Counter[tuple[str, ...]] = Counter()
        for trial in _of_set(name, seed, quick):
            counts[trial.case.effects] += 1
            if most is None or counts[trial.case.effects] <= most * (1 if trial.case.effects else CLEAN_PER_SEED):
                found.append(trial)
    return found


def _of_set(name: str, seed: int, quick: bool) -> list[Trial]:
    first = FIRST_SEED * (1 + seed) + SPACING * list(SETS).index(name)
    without = PART_OF_IT if name == "furnished" else ()
    effects = [each for each in (QUICK_EFFECTS if quick else tuple(DRAWS)) if each not in without]
    count = (
        1 if quick else {"single": SINGLE, "withheld": WITHHELD, "rough": ROUGH, "furnished": FURNISHED}.get(name, 0)
    )
    if name == "clean":
        return [Trial(name, Case((), first + number)) for number in range(QUICK_CLEAN if quick else CLEAN)]
    if name == "pairs":
        pairs = draw_pairs(np.random.default_rng(first), 1 if quick else PAIRS)
        return [Trial(name, Case(pair, first + number)) for number, pair in enumerate(pairs)]
    if name == "withheld":
        return [Trial(name, Case((each,), first + number), (each,)) for each in effects for number in range(count)]
    return [Trial(name, Case((each,), first + number)) for each in effects for number in range(count)]


def evenly(trials: Sequence[Trial]) -> list[Trial]:
    """Return trials in an order of which every beginning has about the same share of each set and each effect."""
    counts: Counter[tuple[str, tuple[str, ...]]] = Counter()
    turn: dict[Trial, int] = {}
    for trial in trials:
        key = (trial.set, trial.case.effects)
        turn[trial] = counts[key]
        counts[key] += 1
    by_set: dict[str, list[Trial]] = {}
    # Of a turn in an order of the folders' names, which say nothing: pairs come in the order of their first effects.
    for trial in sorted(trials, key=lambda each: (turn[each], each.folder)):
        by_set.setdefault(trial.set, []).append(trial)
    places = {trial: (k + 0.5) / len(each) for each in by_set.values() for k, trial in enumerate(each)}
    return sorted(trials, key=places.__getitem__)


def draw_pairs(rng: np.random.Generator, count: int) -> list[tuple[str, str]]:
    """Draw pairs of effects that can act together, no pair twice.

    Raises:
        BringupError: there are not so many.
    """
    pairs = [pair for pair in itertools.combinations(DRAWS, 2) if go_together(*pair)]
    if count > len(pairs):
        raise BringupError(f"pairs: expected at most {len(pairs)}, got {count}")
    return [pairs[k] for k in sorted(rng.choice(len(pairs), count, replace=False))]


def go_together(one: str, other: str) -> bool:
    """Tell whether two effects can act in one recording and be told apart at all."""
    feet, pinned, free = APART
    both = {one, other}
    return not (both <= feet or both <= free or ("hidden_hinge" in both and both <= pinned))


@dataclass(frozen=True)
class MadeTrial:
    """What a trial's simulation gave: recording, truth, oracle, and the file of a model that was learned before."""

    recording: Recording
    truth: Truth
    oracle: Oracle | None = None
    model: Path | None = None


LearnModel = Callable[[Recording, int], tuple[Path, ToldBaseline]]
"""From the recording of a table with nothing concealed, and its case's seed, to a repaired model and its file."""


def make_trial(trial: Trial, learn: LearnModel) -> MadeTrial:
    """Simulate a trial; where a draw does not come to act, another seed is tried.

    An oracle is asked of the recording as it was made, also where a diagnosis is told less.

    Args:
        trial: what to make.
        learn: asked where a table on casters is to be known before anything is concealed.

    Raises:
        BringupError: none of them can be made.
    """
    why = ""
    for number in range(SPARES):
        case = replace(trial.case, seed=trial.case.seed + SPARE_STEP * number)
        try:
            return _furnished(case, learn) if trial.set == "furnished" else _plain(case, trial.set)
        except BringupError as error:
            why = str(error)
    raise BringupError(f"{trial.name}: expected one of {SPARES} seeds to make it, got {why!r} in the last")


def _plain(case: Case, of: str) -> MadeTrial:
    made, rng = make(case), np.random.default_rng([case.seed, 1])
    recording = made.recording
    if of == "rough":
        recording = told_roughly(recording, rng)
    if of == "clean":
        # A test that allows for streams out of step is even only where some are.
        recording = out_of_step(recording, DiagnoseOptions().delay_spread * rng.standard_normal())
    return MadeTrial(recording, made.truth, made.oracle)


def _furnished(case: Case, learn: LearnModel) -> MadeTrial:
    stages: list[Stage] = []
    files: list[Path] = []

    def learned(stage: Stage) -> ToldBaseline:
        stages.append(stage)
        path, baseline = learn(bare_recording(stage), case.seed)
        files.append(path)
        return baseline

    made = make(case, draw_furnished, learned)
    return MadeTrial(with_casters(made.recording, stages[-1]), made.truth, made.oracle, files[-1])


def told_roughly(recording: Recording, rng: np.random.Generator) -> Recording:
    """Return a recording that tells masses, grasp directions and outlines as somebody would who measured little.

    The truth is left alone: what moved moved as it did.

    Args:
        recording: as made.
        rng: source of randomness.
    """
    bodies = {
        name: replace(
            body,
            nominal_mass=body.nominal_mass * math.exp(MASS_OFF * rng.standard_normal()),
            footprint=_shifted(body, rng.uniform(-OUTLINE_OFF, OUTLINE_OFF, 4)),
        )
        for name, body in recording.bodies.items()
    }
    grippers = {
        side: _turned(stream, TURN_OFF * rng.standard_normal()) for side, stream in recording.gripper_poses.items()
    }
    return replace(recording, bodies=bodies, gripper_poses=grippers)


def out_of_step(recording: Recording, late: float) -> Recording:
    """Return a recording whose tags' stamps come so much too late [s]; negative: those of all else."""
    tags, rest = max(late, 0.0), max(-late, 0.0)  # a bag has no stamp before zero
    return replace(
        recording,
        object_poses={name: replace(it, time=it.time + tags) for name, it in recording.object_poses.items()},
        gripper_poses={side: replace(it, time=it.time + rest) for side, it in recording.gripper_poses.items()},
        wrenches={side: replace(it, time=it.time + rest) for side, it in recording.wrenches.items()},
        grasps=tuple(replace(it, start=it.start + rest, end=it.end + rest) for it in recording.grasps),
    )


def _shifted(body: BodyGeometry, sides: Array) -> Array:
    """Return a footprint (k, 2) whose bounding box has its left, lower, right and upper side moved (4,) [m]."""
    low, high = body.footprint.min(axis=0), body.footprint.max(axis=0)
    share = (body.footprint - low) / (high - low)
    return (low + sides[:2]) * (1.0 - share) + (high + sides[2:]) * share


def _turned(stream: PoseStream, angle: float) -> PoseStream:
    """Return poses whose axes are said to be turned about the vertical by so much [rad], where they are."""
    x, y, z, w = stream.quaternion.T
    c, s = math.cos(0.5 * angle), math.sin(0.5 * angle)
    turned = np.stack([c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z], -1)
    return PoseStream(stream.time, stream.position, turned)
