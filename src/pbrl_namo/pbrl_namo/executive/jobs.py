"""What the executive asks of others, and what they answer."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.grasping import GraspCandidate
from pbrl_control.grasping.contacts import Hands
from pbrl_control.navigation import BasePath
from pbrl_control.planar import Array
from pbrl_namo.scene import NamoScene

Belief = Any
"""What is believed of one object's physics; the executive only carries it from those who learn to those who plan."""


@dataclass(frozen=True)
class Move:
    """One thing, moved to create an opening.

    Attributes:
        object: its name.
        segments: twist (3,) of its origin in its axes [m/s, rad/s] and for how long [s], one after the other.
        contact: (2,) where to take hold, in its frame: the nearest point of its outline is meant [m].
        start, end: regions that the opening is to join, as numbered in the plan.
        targets: (k, 2) points of the region to be opened, in `world`; none: no opening is looked for [m].
        then: further things that have to go before the robot can pass; the opening is complete but for them.
        expected_force: largest at any grip [N]; NaN: nobody knows.
        model: the physics that was planned with; None: nothing is known, and `expected_force` alone says what is much.
        model_class: in a word, for people.
        hands: that are to hold it; empty: any.
        more: moves that are to follow before the opening is there; with some, moved as planned is as good as it gets.
        pushes: other things that it is to push before it; then `expected_force` is with what these take, and a model of
            the object alone says too little.
    """

    object: str
    segments: tuple[tuple[Array, float], ...]
    contact: Array
    start: int
    end: int
    targets: Array
    then: tuple[str, ...] = ()
    expected_force: float = math.nan
    model: ObjectModel | None = None
    model_class: str = ""
    hands: Hands = ()
    more: int = 0
    pushes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Choice:
    """One opening that was thought of, for people to look at.

    Attributes:
        object: that would be moved.
        start, end: regions.
        probability: of success (thesis equation 40).
        value: Q of trying it.
    """

    object: str
    start: int
    end: int
    probability: float
    value: float


@dataclass(frozen=True)
class PlanJob:
    """What to move, or the way to the goal.

    Attributes:
        scene: as it is seen now; things that are left alone are among the fixed ones.
        beliefs: by object; those nothing was learned of are missing.
        tries: failed ones so far, by object.
        seed: of every draw.
        been: poses (3,) by object from which it was moved on the way to this goal, in `world` [m, rad].
    """

    scene: NamoScene
    beliefs: Mapping[str, Belief]
    tries: Mapping[str, int]
    seed: int
    been: Mapping[str, tuple[Array, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class PlanAnswer:
    """A move, or a way, or neither and why.

    Attributes:
        move: what to move first; None: nothing.
        way: to the goal, where nothing is in the way.
        reason: one line, where there is neither.
        region: that the robot is in; -1: none.
        regions: how many there are.
        cut_off: those that no sequence of openings reaches.
        choices: what else was thought of.
        seconds: spent on it.
    """

    move: Move | None = None
    way: BasePath | None = None
    reason: str = ""
    region: int = -1
    regions: int = 0
    cut_off: tuple[int, ...] = ()
    choices: tuple[Choice, ...] = ()
    seconds: float = 0.0


@dataclass(frozen=True)
class GraspJob:
    """A grasp for a move, and the way to it.

    Attributes:
        scene: as it is seen now.
        move: that it is for.
        avoid: (2,) stands in `world` where a grasp has failed [m].
        seed: of every draw.
    """

    scene: NamoScene
    move: Move
    avoid: tuple[Array, ...]
    seed: int


@dataclass(frozen=True)
class GraspAnswer:
    """A grasp, or None and why, in one line."""

    candidate: GraspCandidate | None = None
    reason: str = ""
    seconds: float = 0.0


@dataclass(frozen=True)
class LearnJob:
    """What is to be learned of an object, from what was recorded while it was held.

    Attributes:
        object: its name.
        begin, end: of the recording, on its clock [s]: from the closed grip to the surprise.
        belief: so far; None: nothing was learned of it.
        seed: of every draw.
    """

    object: str
    begin: float
    end: float
    belief: Belief | None
    seed: int


@dataclass(frozen=True)
class LearnAnswer:
    """What was learned.

    Attributes:
        belief: the new one; None: nothing could be learned.
        explained: whether it explains what was recorded.
        reason: one line, where it does not or there is none.
        seconds: spent on it.
    """

    belief: Belief | None
    explained: bool = True
    reason: str = ""
    seconds: float = 0.0


@dataclass(frozen=True)
class MismatchJob(LearnJob):
    """What a model that does not explain a recording leaves out; `belief` is that model."""


@dataclass(frozen=True)
class MismatchAnswer:
    """What was found: `belief` is the repaired one, None where nothing is named; `found` says it in words."""

    belief: Belief | None
    found: str = ""
    seconds: float = 0.0


@dataclass(frozen=True)
class Refused:
    """It cannot be done, and asking again is no use; why, in one line."""

    reason: str


@dataclass(frozen=True)
class Lost:
    """No answer will come; asking again may help; why, in one line."""

    reason: str


Job = PlanJob | GraspJob | LearnJob | MismatchJob
Answer = PlanAnswer | GraspAnswer | LearnAnswer | MismatchAnswer | Refused | Lost


def finite(move: Move) -> str:
    """Return what is wrong with the numbers of a move, in one line; empty where nothing is."""
    if not move.segments:
        return f"move of {move.object!r}: expected at least one segment, got none"
    for twist, duration in move.segments:
        if np.shape(twist) != (3,) or not np.isfinite([*twist, duration]).all() or not duration > 0.0:
            return f"move of {move.object!r}: expected finite twists for times above zero, got {twist} for {duration} s"
        if not np.any(twist):
            return f"move of {move.object!r}: expected a twist that moves it, got zero"
    if np.shape(move.contact) != (2,) or not np.isfinite(move.contact).all():
        return f"move of {move.object!r}: expected a finite contact (x, y), got {move.contact}"
    return ""
