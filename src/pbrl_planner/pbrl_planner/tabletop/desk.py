"""The desk: a table, items that may be pushed, obstacles that may not, all as boxes seen from above (thesis 3.1)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pbrl_control.planar import Array
from pbrl_planner.errors import PlannerError
from pbrl_planner.tabletop.box_kernel import box_fault

REACH_MARGIN = 0.01
"""[m] kept from where the arm is stretched out, or folded up."""


@dataclass(frozen=True)
class Item:
    """Something on the table; its frame is in the middle of its bounding box, x along the longer side.

    Attributes:
        name: as objectives and models call it.
        length: along x [m].
        width: along y [m], at most the length.
    """

    name: str
    length: float
    width: float

    def __post_init__(self) -> None:
        sizes = (self.length, self.width)
        if not (self.name and all(math.isfinite(size) for size in sizes) and 0.0 < self.width <= self.length):
            raise PlannerError(
                f"item {self.name!r}: expected a name and finite sides, the longer one first, got {sizes} m"
            )

    @property
    def half(self) -> Array:
        """Half of length and width (2,) [m]."""
        return np.array([self.length, self.width]) / 2.0


@dataclass(frozen=True)
class Table:
    """The rectangle on which everything has to stay (thesis equation 4).

    Attributes:
        low, high: (2,) corners [m].
    """

    low: Array
    high: Array

    def __post_init__(self) -> None:
        for name in ("low", "high"):
            value = np.array(getattr(self, name), dtype=float)
            if value.shape != (2,) or not np.isfinite(value).all():
                raise PlannerError(f"table: expected {name} to be a finite (x, y), got {getattr(self, name)}")
            object.__setattr__(self, name, value)
        if not (self.low < self.high).all():
            raise PlannerError(f"table: expected low below high, got {self.low.tolist()} and {self.high.tolist()}")

    @classmethod
    def of(cls, length: float, width: float) -> Table:
        """Make a table about the origin of the frame [m]."""
        return cls(np.array([-length, -width]) / 2.0, np.array([length, width]) / 2.0)

    @property
    def centre(self) -> Array:
        """The point (2,) furthest from the borders along each axis (equation 5) [m]."""
        return np.asarray((self.low + self.high) / 2.0)


@dataclass(frozen=True)
class Desk:
    """Table, items and obstacles. A layout is where the items are: (n, 3) poses in the table's frame [m, rad].

    Attributes:
        table: its borders.
        items: that may be pushed, in the order of every layout.
        obstacles: what may not be touched, and where it is (3,).
        effector: radius of the ball that pushes [m].
        reach: x, y of the arm's column and least and most radius (4,) of the ball's centre about it [m]; None: all.
    """

    table: Table
    items: tuple[Item, ...]
    obstacles: tuple[tuple[Item, Array], ...] = ()
    effector: float = 0.012
    reach: tuple[float, float, float, float] | None = None
    halves: Array = field(init=False, repr=False, compare=False)
    fixed: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        names = [item.name for item in (*self.items, *(item for item, _ in self.obstacles))]
        twice = sorted({name for name in names if names.count(name) > 1})
        if not self.items or twice:
            raise PlannerError(f"desk: expected items with different names, got {', '.join(twice) or 'none'}")
        if not (math.isfinite(self.effector) and self.effector > 0.0):
            raise PlannerError(f"desk: expected the effector's radius above zero, got {self.effector} m")
        object.__setattr__(self, "halves", np.array([item.half for item in self.items]))
        if self.reach is not None and not (np.isfinite(self.reach).all() and 0.0 <= self.reach[2] < self.reach[3]):
            raise PlannerError(f"desk: expected reach as x, y, least and most radius, got {self.reach}")
        rows = []
        for item, pose in self.obstacles:
            if np.shape(pose) != (3,) or not np.isfinite(pose).all():
                raise PlannerError(f"obstacle {item.name!r}: expected a finite pose (x, y, theta), got {pose}")
            rows.append([*pose, *item.half])
        object.__setattr__(self, "fixed", np.array(rows, dtype=float).reshape(-1, 5))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the items, in the order of a layout."""
        return tuple(item.name for item in self.items)

    def index(self, name: str) -> int:
        """Return which item has a name.

        Raises:
            PlannerError: none has; those that there are are named.
        """
        if name not in self.names:
            raise PlannerError(f"expected one of the items {', '.join(self.names)}, got {name!r}")
        return self.names.index(name)

    @property
    def annulus(self) -> Array:
        """The reach (4,); without one, everything."""
        return np.array(self.reach if self.reach is not None else (0.0, 0.0, 0.0, np.inf))

    def in_reach(self, points: Array) -> bool:
        """Say whether the ball's centre can be at all of some points (k, 2) [m]."""
        x, y, least, most = self.annulus
        radii = np.hypot(points[:, 0] - x, points[:, 1] - y)
        return bool((radii >= least).all() and (radii <= most).all())

    def layout(self, poses: Array | Sequence[Sequence[float]]) -> Array:
        """Return poses (n, 3) checked for shape and numbers, with a layout's meaning.

        Raises:
            PlannerError: they are not one finite pose an item.
        """
        layout = np.array(poses, dtype=float)
        if layout.shape != (len(self.items), 3) or not np.isfinite(layout).all():
            raise PlannerError(
                f"layout: expected {len(self.items)} finite poses (x, y, theta), one for each of "
                f"{', '.join(self.names)}, got shape {layout.shape}"
            )
        return layout

    def fault(self, layout: Array, margin: float = 0.0) -> str:
        """Say what is wrong with a layout (n, 3): what overlaps, or leaves the table; empty where nothing is.

        Args:
            layout: poses.
            margin: that each item keeps from everything else [m].
        """
        faults = (self.fault_of(layout, k, margin) for k in range(len(self.items)))
        return next((fault for fault in faults if fault), "")

    def fault_of(self, layout: Array, k: int, margin: float = 0.0) -> str:
        """Say what is wrong with where one item is in a layout (n, 3); empty where nothing is."""
        code = box_fault(layout, k, layout[k], self.halves, self.fixed, self.table.low, self.table.high, margin)
        if code == 0:
            return ""
        if code < 0:
            return f"{self.items[k].name} is not wholly on the table"
        others = [*self.names, *(other.name for other, _ in self.obstacles)]
        return f"{self.items[k].name} overlaps {others[code - 1]}"
