"""What a task on a desk asks for, and how it ends: tidying, or teaching what pushes do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from pbrl_control.planar import Array
from pbrl_planner.tabletop.primitives import Push


class Ending(Enum):
    """How a task ended; the values are sentences."""

    TIDY = "the objective is reached"
    BEST = "no push makes it tidier"
    SPENT = "as many pushes as were allowed were made"
    TAUGHT = "what pushes do is known"
    CRAMPED = "what is left to be learned has no room"
    LOST = "an item is not seen"
    BLIND = "the table is not seen"
    SILENT = "the arm is not heard"
    SET_BACK = "the clock was set back"
    BLOCKED = "an item is where it cannot be: on another, or over the border"
    UNREACHED = "the arm does not reach a push"
    CANCELLED = "it is not wanted any more"

    @property
    def success(self) -> bool:
        """Whether what was wanted is there."""
        return self in (Ending.TIDY, Ending.TAUGHT)


@dataclass(frozen=True)
class NextPush:
    """A push to be made now.

    Attributes:
        item: its number in the layout.
        push: how.
        path: (2, 2) of the ball's centre in `world` [m].
    """

    item: int
    push: Push
    path: Array


@dataclass(frozen=True)
class Ended:
    """There is nothing more to do.

    Attributes:
        ending: why.
        reason: one line, with names and numbers.
    """

    ending: Ending
    reason: str


class Task(Protocol):
    """Says what to do next, each time the items have been seen."""

    @property
    def pushes(self) -> int:
        """Pushes asked for so far."""

    def next(self, poses: Mapping[str, Array]) -> NextPush | Ended:
        """Return what to do, now that the items are seen at poses (3,) by name."""
