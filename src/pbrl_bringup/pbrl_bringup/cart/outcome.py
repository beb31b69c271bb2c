"""What became of a drive with a cart: its story, and its score by the simulator's truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pbrl_planner.cart.navigator import PlannerCall


@dataclass(frozen=True)
class Trace:
    """Where everything truly was: for pictures and scores.

    Attributes:
        time: [s].
        base: (3,) [m, rad].
        cart: (3,) of the cart's own frame [m, rad].
        status: of the local controller; "planning" without one.
        cause: why it was not at full speed.
        people: (x, y) by name [m].
    """

    time: float
    base: tuple[float, ...]
    cart: tuple[float, ...]
    status: str
    cause: str
    people: Mapping[str, tuple[float, ...]]


@dataclass(frozen=True)
class Touch:
    """A contact: who of us touched whom, when [s] and with how much [N]."""

    mover: str
    other: str
    person: bool
    time: float
    force: float


@dataclass(frozen=True)
class Score:
    """What came of the drive, by the simulator's truth.

    Attributes:
        contacts: with people, furniture, walls.
        nearest_person: least distance of robot or cart to somebody [m]; None: further than is looked.
        nearest_thing: to anything else, likewise [m].
        position_errors: of the base from the plan's goal of the moment, as the robot has it, a tick [m].
        angle_errors: the greater one of heading and articulation, likewise [rad].
        tick_seconds: of a core that the local controller took, a tick [s].
        goal_error: of the base to the goal, truly [m].
        goal_angle: likewise [rad].
        way: of the base, truly [m].
    """

    contacts: tuple[Touch, ...]
    nearest_person: float | None
    nearest_thing: float | None
    position_errors: tuple[float, ...]
    angle_errors: tuple[float, ...]
    tick_seconds: tuple[float, ...]
    goal_error: float
    goal_angle: float
    way: float


@dataclass(frozen=True)
class CartOutcome:
    """What became of one leg.

    Attributes:
        reached: whether the robot says that it is there.
        sentence: how it ended.
        seconds: simulated [s].
        calls: of the planner.
        trace: the story.
        score: by the truth.
        goal: (3,) asked for.
        room: corners of the floor [m].
        plan: (n, 4) the last one [m, rad].
    """

    reached: bool
    sentence: str
    seconds: float
    calls: tuple[PlannerCall, ...]
    trace: tuple[Trace, ...]
    score: Score
    goal: tuple[float, ...]
    room: tuple[tuple[float, ...], ...]
    plan: tuple[tuple[float, ...], ...]
