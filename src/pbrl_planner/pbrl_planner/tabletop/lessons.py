"""Which push to try next so that displacement models are learned, wherever the items are now (LEARN_MODEL, figure 1).

The thesis repeats one push until its variance is small. Here a push is repeated until its *mean* is known well enough:
the variance itself is the world's and no number of pushes makes it smaller. Pushes take turns, so that an item comes
back from where the last one brought it; what would take it near a border or another item waits.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated

import numpy as np
from pydantic import Field

from pbrl_control.planar import Array
from pbrl_control.settings import Positive, Section
from pbrl_planner.tabletop.box_kernel import ball_meets, box_fault
from pbrl_planner.tabletop.desk import Desk
from pbrl_planner.tabletop.displacement import LearnedDisplacements
from pbrl_planner.tabletop.primitives import APPROACH, Push, displaced, displacement
from pbrl_planner.tabletop.task import Ended, Ending, NextPush

LESS_ROOM = (1.0, 0.5, 0.2)
"""Shares of the room that is kept: items that lie close together have to come apart before they can be taught."""


class LessonSettings(Section):
    """When a push is known well enough.

    Attributes:
        position_error: standard deviation of the mean, along and across [m].
        yaw_error: of its angle [rad].
        least, most: pushes of one kind.
        room: [m] that an item keeps from everything while nothing is known of it.
    """

    position_error: Positive = 0.002
    yaw_error: Positive = 0.03
    least: Annotated[int, Field(ge=1, le=1000)] = 4
    most: Annotated[int, Field(ge=1, le=1000)] = 10
    room: Positive = 0.02


class Lessons:
    """What is still to be learned of the items of a desk.

    Args:
        desk: table, items, obstacles.
        pushes: to be learned for each item.
        settings: how well.

    Attributes:
        model: what is known.
    """

    def __init__(self, desk: Desk, pushes: tuple[Push, ...], settings: LessonSettings | None = None) -> None:
        self.desk, self.pushes, self.settings = desk, pushes, settings or LessonSettings()
        self.model = LearnedDisplacements(least=self.settings.least)
        self._told: dict[tuple[str, Push], Array] = {}

    def expect(self, name: str, push: Push, mean: Array) -> None:
        """Tell what a push of an item does (3,), as long as it was not tried here: room is kept for that."""
        self._told[name, push] = np.asarray(mean, dtype=float)

    def is_known(self, name: str, push: Push) -> bool:
        """Say whether a push of an item is known well enough, or was tried often enough."""
        each, settings = self.model.of(name, push), self.settings
        if each.count >= settings.most:
            return True
        error = each.error
        well = max(error[0], error[1]) <= settings.position_error and error[2] <= settings.yaw_error
        return each.count >= settings.least and bool(well)

    @property
    def left(self) -> list[tuple[int, Push]]:
        """Items, by number, and pushes that are not known well enough."""
        return [
            (k, push)
            for k, item in enumerate(self.desk.items)
            for push in self.pushes
            if not self.is_known(item.name, push)
        ]

    def next(self, layout: Array) -> tuple[int, Push] | None:
        """Return which item (its number) to push how, from a layout (n, 3).

        Returns:
            None where everything is known, or where nothing can be pushed without coming near something.
        """
        left = self.left
        if not left:
            return None
        free = [(k, push) for k, push in left if self._has_room(layout, k, push)]
        if free:
            fewest = min(self.model.of(self.desk.items[k].name, push).count for k, push in free)
            seldom = [(k, push) for k, push in free if self.model.of(self.desk.items[k].name, push).count == fewest]
            return max(seldom, key=lambda pair: self._space(layout, *pair))
        return self._making_room(layout, left)

    def _making_room(self, layout: Array, left: list[tuple[int, Push]]) -> tuple[int, Push] | None:
        """Return a push after which something that is left has room, or any of what waits: by turns that never repeat.

        Always the one with most space would be the same two pushes for ever, there and back.
        """
        wanted = {k for k, _ in left}
        for room in (self.settings.room * share for share in LESS_ROOM):
            others = [
                (k, push)
                for k in range(len(self.desk.items))
                for push in self.pushes
                if self._has_room(layout, k, push, room)
            ]
            waiting = [pair for pair in others if pair[0] in wanted]
            if waiting:
                break
        if not others:
            return None
        for k, push in sorted(others, key=lambda pair: -self._space(layout, *pair)):
            then = layout.copy()
            then[k] = self._expected(layout, k, push)
            if any(self._has_room(then, item, each) for item, each in left):
                return k, push
        made = sum(self.model.of(item.name, push).count for item in self.desk.items for push in self.pushes)
        chosen = waiting or others
        return chosen[int(np.random.default_rng(made).integers(len(chosen)))]

    def learned(self, k: int, push: Push, before: Array, after: Array) -> Array:
        """Take in where an item was (3,) before a push and after it; return its displacement (3,)."""
        moved = displacement(before, after)
        self.model.update(self.desk.items[k].name, push, moved)
        return moved

    def _expected(self, layout: Array, k: int, push: Push) -> Array:
        """Return where an item will be (3,): what is known, or else that it goes as the ball does."""
        name = self.desk.items[k].name
        each = self.model.of(name, push)
        if each.count or (name, push) in self._told:
            return displaced(layout[k], each.mean if each.count else self._told[name, push])
        if push.primitive.endswith("turn"):
            lever = 0.75 * self.desk.items[k].length
            turn = math.atan2(push.travel, lever) * (1.0 if push.primitive[0] == "+" else -1.0)
            return displaced(layout[k], np.array([0.0, 0.4 * push.travel * push.direction[1], turn]))
        return displaced(layout[k], np.append(push.travel * push.direction, 0.0))

    def _has_room(self, layout: Array, k: int, push: Push, room: float | None = None) -> bool:
        """Say whether an item and the ball keep so far from everything in a push [m]; None: as far as settings say."""
        desk, room = self.desk, self.settings.room if room is None else room
        then = self._expected(layout, k, push)
        inset = np.full(2, room)
        for pose in (layout[k] + (then - layout[k]) / 2.0, then):
            if box_fault(
                layout, k, pose, desk.halves, desk.fixed, desk.table.low + inset, desk.table.high - inset, room
            ):
                return False
        item = desk.items[k]
        (px, py), (qx, qy) = push.path_in_world(item, layout[k], desk.effector, APPROACH)
        boxes = [(*layout[j], *desk.halves[j]) for j in range(len(layout)) if j != k] + [
            tuple(row) for row in desk.fixed
        ]
        radius = desk.effector + room / 2.0
        return not any(ball_meets(px, py, qx, qy, radius, *box) for box in boxes) and desk.in_reach(
            np.array([[px, py], [qx, qy]])
        )

    def _space(self, layout: Array, k: int, push: Push) -> float:
        """Return how far from borders and others an item's middle will be [m]."""
        then = self._expected(layout, k, push)[:2]
        table = self.desk.table
        others = [layout[j, :2] for j in range(len(layout)) if j != k] + [row[:2] for row in self.desk.fixed]
        border = float(min((then - table.low).min(), (table.high - then).min()))
        return min([border, *(float(np.hypot(*(then - other))) / 2.0 for other in others)])


class Teaching:
    """The task of learning what pushes do: see `Task`.

    Args:
        lessons: what is to be learned, and what is known.
        most: pushes after which something is wrong.

    Attributes:
        pushes: asked for so far.
        seen: item, push and displacement (3,) of each.
    """

    def __init__(self, lessons: Lessons, most: int = 2000) -> None:
        self.lessons, self.pushes = lessons, 0
        self.seen: list[tuple[str, Push, Array]] = []
        self._most = most
        self._made: tuple[int, Push, Array] | None = None

    def next(self, poses: Mapping[str, Array]) -> NextPush | Ended:
        """Take in what the last push did, and return what to push next."""
        desk = self.lessons.desk
        unseen = [name for name in desk.names if name not in poses]
        if unseen:
            return Ended(Ending.LOST, f"not seen: {', '.join(unseen)}; put it back on the table")
        layout = desk.layout(np.array([poses[name] for name in desk.names]))
        if self._made is not None:
            k, push, before = self._made
            self.seen.append((desk.names[k], push, self.lessons.learned(k, push, before, layout[k])))
            self._made = None
        left = len(self.lessons.left)
        if not left:
            return Ended(Ending.TAUGHT, f"{len(self.lessons.pushes)} pushes of {len(desk.items)} items are known")
        asked = self.lessons.next(layout)
        if asked is None:
            return Ended(Ending.CRAMPED, f"{left} pushes are still to be learned; lay the items further apart")
        if self.pushes >= self._most:
            return Ended(Ending.SPENT, f"{left} pushes are still to be learned after {self.pushes}")
        k, push = asked
        self.pushes += 1
        self._made = (k, push, layout[k])
        return NextPush(k, push, push.path_in_world(desk.items[k], layout[k], desk.effector, APPROACH))
