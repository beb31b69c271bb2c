"""Groups the pictures of several cameras by the moment at which they were taken."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from pbrl_model.errors import ModelError

Item = TypeVar("Item")

MOST_OPEN = 2
"""Moments that may wait for pictures at once: a camera's next picture may overtake another camera's last."""
RESTART = 1.0
"""Stamps that go back by more than this [s] are of another clock: a bag played again, a simulator started anew."""


@dataclass
class _Moment(Generic[Item]):
    """Pictures by camera that were taken at about `stamp` [s]."""

    stamp: float
    items: dict[str, Item] = field(default_factory=dict)


class MomentGrouper(Generic[Item]):
    """Gives pictures away together once all cameras have one of a moment, or two later moments have begun.

    Moments come in the order of their stamps. A picture of a moment that was given away already is dropped.

    Args:
        cameras: names of those that are waited for.
        window: pictures whose stamps differ by no more than this are of one moment [s].

    Raises:
        ModelError: no camera, or a window that is not positive.
    """

    def __init__(self, cameras: Collection[str], window: float) -> None:
        if not cameras or not window > 0:
            raise ModelError(f"moments: expected cameras and a window above zero, got {list(cameras)} and {window} s")
        self._cameras, self._window = frozenset(cameras), window
        self._open: list[_Moment[Item]] = []
        self._given = -math.inf

    def add(self, camera: str, stamp: float, item: Item) -> list[tuple[float, list[Item]]]:
        """Take a picture.

        Args:
            camera: that took it.
            stamp: when [s].
            item: the picture.

        Returns:
            Moments that are given away with this: stamp [s] of the first picture, and pictures in the order of the
            cameras' names.
        """
        if stamp < self._given - RESTART:
            self._open, self._given = [], -math.inf
        if stamp <= self._given + self._window:
            return []
        moment = next((each for each in self._open if abs(each.stamp - stamp) <= self._window), None)
        if moment is None:
            moment = _Moment(stamp)
            self._open = sorted([*self._open, moment], key=lambda each: each.stamp)
        moment.items[camera] = item
        done = [k for k, each in enumerate(self._open) if self._cameras <= each.items.keys()]
        count = max([k + 1 for k in done] + [len(self._open) - MOST_OPEN])
        return [self._give() for _ in range(count)]

    def _give(self) -> tuple[float, list[Item]]:
        moment = self._open.pop(0)
        self._given = moment.stamp
        return moment.stamp, [moment.items[name] for name in sorted(moment.items)]
