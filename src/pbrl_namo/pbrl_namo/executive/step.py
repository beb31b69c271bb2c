"""What one part of the executive wants at one tick."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from pbrl_control.percept import Percept
from pbrl_control.planar import Array
from pbrl_control.push import GripperAnswer, GripperRequest, Phase, PushCommand
from pbrl_control.types import PlanarTwist
from pbrl_namo.executive.table import Event

STILL = PlanarTwist()


@dataclass(frozen=True)
class Step:
    """A command, or an event, which goes with rest.

    Attributes:
        status: a sentence; of an event, what happened.
        event: None while the state goes on.
        phase: as `PushCommand` has it, for whoever knows pushes and fetches only.
        twists, requests, expected: see `PushCommand`.
    """

    status: str
    event: Event | None = None
    phase: Phase = Phase.LOCATE
    twists: Mapping[str, PlanarTwist] = field(default_factory=dict)
    requests: tuple[GripperRequest, ...] = ()
    expected: Mapping[str, Array] = field(default_factory=dict)

    @classmethod
    def of(cls, command: PushCommand) -> Step:
        """Return a fetch's command as a step."""
        return cls(command.status, None, command.phase, command.twists, command.requests, command.expected)


class Part(Protocol):
    """Does what one state is for; made when the state is entered."""

    def step(self, now: float, percept: Percept) -> Step:
        """Go on at `now` [s].

        Raises:
            ControlError: it cannot, and why.
            NamoError: likewise.
        """
        ...

    def answer(self, answer: GripperAnswer) -> None:
        """Take in what came of a gripper's request."""
        ...

    def drop(self) -> None:
        """Leave nothing behind: the state is left."""
        ...


class BasePart:
    """A part that asks nothing of grippers and leaves nothing behind."""

    def answer(self, answer: GripperAnswer) -> None:
        """See `Part.answer`."""

    def drop(self) -> None:
        """See `Part.drop`."""


class Happened(BasePart):
    """A state in which something happens at once.

    Args:
        event: what.
        status: a sentence.
    """

    def __init__(self, event: Event, status: str) -> None:
        self._step = Step(status, event)

    def step(self, now: float, percept: Percept) -> Step:
        """See `Part.step`."""
        return self._step


class Resting(BasePart):
    """A state in which nothing is done.

    Args:
        status: a sentence.
        phase: to be told.
    """

    def __init__(self, status: str, phase: Phase) -> None:
        self._step = Step(status, None, phase)

    def step(self, now: float, percept: Percept) -> Step:
        """See `Part.step`."""
        return self._step


def rest(percept: Percept) -> dict[str, PlanarTwist]:
    """Return rest: of what is held where something is, of the base otherwise."""
    held = sorted({grip.object for grip in percept.grips.values()})
    return dict.fromkeys(held, STILL) if held else {"base": STILL}


def still_held(percept: Percept) -> str:
    """Return what is held, in words; empty where nothing is."""
    return ", ".join(f"{side} holds {grip.object!r}" for side, grip in sorted(percept.grips.items()))
