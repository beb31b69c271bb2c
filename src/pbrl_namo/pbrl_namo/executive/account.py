"""What was done on the way to a goal: plans, surprises, updates, seconds in each state (thesis figure 45)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from pbrl_control.planar import Array
from pbrl_namo.executive.table import MOVING, THINKING, Event, State

SURPRISES = frozenset({Event.UNEXPECTED_FORCE, Event.STALLED, Event.TIMED_OUT, Event.GRIP_SLIPPED})
"""What a model did not foretell."""

PLANS = frozenset({Event.PLANNED, Event.NOTHING_TO_DO, Event.NO_WAY, Event.DOUBTED})
"""What a plan comes to."""

FAILURES = SURPRISES | {
    Event.NO_GRASP,
    Event.WAY_LOST,
    Event.VANISHED,
    Event.MISSED,
    Event.MOVED,
    Event.TAG_LOST,
    Event.GRIP_LOST,
    Event.FAULT,
}
"""What ends a try at an object without an opening."""


@dataclass(frozen=True)
class Change:
    """One line of the log.

    Attributes:
        time: [s].
        before, after: states.
        event: between them.
        sentence: how it was told.
        object: that was at hand; empty: none.
    """

    time: float
    before: State
    event: Event
    after: State
    sentence: str
    object: str = ""


@dataclass
class Account:
    """Counts for one goal.

    Attributes:
        plans: answers of the planner, those that found nothing to do and no way among them.
        surprises: manipulations that ended otherwise than the model foretold.
        updates: models that were learned.
        repairs: models that were repaired after a mismatch.
        grasps: grips that were sure.
        openings: that were made.
        faults: of the executive's own.
        planning_seconds: that planner and grasp search say they took [s].
        learning_seconds: likewise learner and mismatch tool [s].
        regions: of the first plan.
        seconds: in each state, on the clock of the ticks [s].
        log: every change of state.
    """

    plans: int = 0
    surprises: int = 0
    updates: int = 0
    repairs: int = 0
    grasps: int = 0
    openings: int = 0
    faults: int = 0
    planning_seconds: float = 0.0
    learning_seconds: float = 0.0
    regions: int = 0
    seconds: dict[State, float] = field(default_factory=lambda: dict.fromkeys(State, 0.0))
    log: list[Change] = field(default_factory=list)

    @property
    def runtime(self) -> float:
        """Time so far, ends not counted [s]."""
        return sum(time for state, time in self.seconds.items() if state in MOVING | THINKING or state == State.LOOK)

    def pass_time(self, state: State, dt: float) -> None:
        """Take in that a state has lasted for another `dt` [s]."""
        self.seconds[state] += dt

    def note(self, change: Change) -> None:
        """Take in a change of state."""
        self.log.append(change)
        event = change.event
        if change.before == State.PLANNING and event in PLANS:
            self.plans += 1
        self.surprises += event in SURPRISES
        self.updates += event in (Event.UPDATED, Event.UNEXPLAINED)
        self.repairs += event == Event.REPAIRED
        self.grasps += event == Event.HELD
        self.openings += event == Event.OPENED
        self.faults += event == Event.FAULT

    def rows(self) -> dict[str, float]:
        """Return figure 45's rows and some more, by name."""
        return {
            "free-space regions": float(self.regions),
            "overall runtime [s]": self.runtime,
            "overall planning time [s]": self.planning_seconds,
            "calls to the planner": float(self.plans),
            "calls to UpdateModel": float(self.updates),
            "surprises": float(self.surprises),
            "repaired models": float(self.repairs),
            "sure grips": float(self.grasps),
            "openings": float(self.openings),
        }


class Tries:
    """Which things were tried without an opening, how often, and where a grasp has failed.

    Args:
        most: tries of one thing before it is left alone.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._counts: Counter[str] = Counter()
        self._reasons: dict[str, list[str]] = {}
        self._stands: dict[str, list[Array]] = {}

    @property
    def counts(self) -> Mapping[str, int]:
        """Failed tries by object."""
        return dict(self._counts)

    @property
    def given_up(self) -> Mapping[str, str]:
        """Things that are left alone, and why, in one line."""
        return {
            name: f"{name} is left alone after {count} tries: {'; then '.join(self._reasons[name])}"
            for name, count in sorted(self._counts.items())
            if count >= self._most
        }

    def failed(self, name: str, reason: str) -> None:
        """Take in that a try has come to nothing."""
        self._counts[name] += 1
        told = self._reasons.setdefault(name, [])
        if reason not in told:
            told.append(reason)

    def opened(self, name: str) -> None:
        """Take in that a try has made an opening."""
        self._counts.pop(name, None)
        self._reasons.pop(name, None)
        self._stands.pop(name, None)

    def missed(self, name: str, stand: Array) -> None:
        """Take in a stand (2,) in `world` where a grasp has failed."""
        self._stands.setdefault(name, []).append(stand)

    def stands(self, name: str) -> tuple[Array, ...]:
        """Return the stands (2,) where grasps of a thing have failed."""
        return tuple(self._stands.get(name, ()))
