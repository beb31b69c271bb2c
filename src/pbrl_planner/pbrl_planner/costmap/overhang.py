"""What a laser that nods sees over the floor: table tops, shelves, drawers; a laser low over the floor sees none."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pbrl_control.planar import Array
from pbrl_planner.costmap import overhang_kernel as kernel
from pbrl_planner.costmap.rolling import roll
from pbrl_planner.costmap.scan import RangeScan
from pbrl_planner.costmap.settings import OverhangSettings

Mask = NDArray[np.bool_]
Outlines = tuple[Array, NDArray[np.int64]]
"""All corners (c, 2), and where each outline begins (k + 1,)."""


class Overhang:
    """Columns of voxels over a window of the floor.

    A voxel is believed in as a cell of the floor is, with two things more: the highest mark in it is remembered, and
    only beams that pass lower than that speak against it; and whether it is there to stay is asked of all that is over
    the same patch of the floor.

    Args:
        settings: heights, beliefs.
        shape: rows and columns of the window.
        resolution: of a column [m].

    Attributes:
        time: of the last scan [s]; -inf: none yet.
    """

    def __init__(self, settings: OverhangSettings, shape: tuple[int, int], resolution: float) -> None:
        self._settings, self._resolution = settings, resolution
        self.time = -math.inf
        voxels = (*shape, settings.levels)
        self._evidence, self._tops = np.zeros(voxels, dtype=np.uint8), np.zeros(voxels, dtype=np.uint8)
        self._scans = np.zeros(voxels, dtype=np.int32)
        self._count, self._last = np.zeros(shape, dtype=np.uint8), np.full(shape, -np.inf)
        self._scan = 0
        self._patch = max(round(settings.patch / resolution), 1)
        self._patches = np.empty((*(side // self._patch + 2 for side in shape), 2))
        self._patches[:] = np.inf, -np.inf
        self._above = self._right = 0  # of the corner, in cells from where it first was

    def observe(
        self, scan: RangeScan, laser: Array, own: Outlines, margin: float, corner: tuple[float, float]
    ) -> tuple[int, int, int]:
        """Take in a scan; return columns newly occupied, newly free, and readings of robot or cart.

        Args:
            scan: all beams of one moment.
            laser: (4, 4) of its frame, over the floor that `corner` is of.
            own: outlines of robot and cart [m].
            margin: about them [m].
            corner: of the window with the lowest x and y [m].
        """
        settings = self._settings
        self._scan += 1
        beams = scan.ranges, scan.angle_min, scan.increment, *scan.span, np.ascontiguousarray(laser)
        place = self._resolution, *corner, settings.lowest, settings.level
        taken, mine = kernel.mark_ends(
            *beams,
            settings.mark_range,
            *own,
            margin,
            *place,
            self._scan,
            scan.time,
            settings.hit,
            settings.most,
            self._evidence,
            self._tops,
            self._scans,
            self._count,
            self._last,
            self._patch,
            self._above,
            self._right,
            settings.settled,
            settings.fleeting,
            settings.memory,
            self._patches,
        )
        freed = kernel.see_through(
            *beams,
            settings.clear_range,
            *place,
            settings.graze,
            self._scan,
            settings.miss,
            self._evidence,
            self._tops,
            self._scans,
            self._count,
        )
        self.time = max(self.time, scan.time)
        return taken, freed, mine

    def go_with(self, now: float, floor: NDArray[np.uint8], seen: Array, came: Array, went: Array) -> int:
        """Clear what is over something that has gone from the floor by `now` [s]; return how many columns got free.

        Args:
            now: [s].
            floor: (rows, columns) evidence of what is on the floor.
            seen: (rows, columns) when something was last seen on it [s].
            came: (rows, columns) when that came [s].
            went: (rows, columns) when a cell was seen to be left [s]; what is settled is taken out: -inf.
        """
        settings = self._settings
        return int(
            kernel.go_with(
                now,
                settings.fleeting,
                round(settings.about / self._resolution),
                settings.slack,
                floor,
                seen,
                came,
                went,
                self._evidence,
                self._count,
                self._last,
                self._patch,
                self._above,
                self._right,
                self._patches,
            )
        )

    def occupied(self, now: float) -> Mask:
        """Return in which columns (rows, columns) something is, as of `now` [s]; what is too old is forgotten first."""
        kernel.forget_columns(
            now,
            self._settings.fleeting,
            self._settings.memory,
            self.settled(),
            self._evidence,
            self._count,
            self._last,
        )
        return self._count > 0

    def settled(self) -> Mask:
        """Return which columns (rows, columns) are over a patch where something was seen for long enough to be real."""
        real = self._patches[..., 1] - self._patches[..., 0] >= self._settings.settled
        rows, columns = self._count.shape
        down = (np.arange(rows) + self._above) // self._patch % len(real)
        along = (np.arange(columns) + self._right) // self._patch % real.shape[1]
        return real[np.ix_(down, along)]

    def unseen(self, now: float, age: float) -> Mask:
        """Return in which columns (rows, columns) nothing was seen for so long [s]."""
        return now - self._last > age

    def strength(self) -> NDArray[np.int64]:
        """Return what speaks for each column (rows, columns): what speaks for that voxel of it that most speaks for."""
        return self._evidence.max(axis=2).astype(np.int64)

    def clear(self, where: Mask) -> None:
        """Take everything out of columns."""
        self._evidence[where] = 0
        self._count[where] = 0

    def roll(self, rows: int, columns: int) -> None:
        """Move what is known by so many cells towards the corner, as the window goes."""
        self._above, self._right = self._above + rows, self._right + columns
        for layer, blank in ((self._evidence, 0), (self._tops, 0), (self._count, 0), (self._last, -np.inf)):
            roll(layer, rows, columns, blank)
