"""The costmap: what scans and the static map say of a window of the floor (thesis 4.4)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pbrl_control.errors import ControlError
from pbrl_control.navigation.floor_map import as_polygon
from pbrl_control.planar import Array
from pbrl_planner.costmap import ray_kernel as kernel
from pbrl_planner.costmap.field import CostField
from pbrl_planner.costmap.inflation import inflate
from pbrl_planner.costmap.overhang import Overhang
from pbrl_planner.costmap.rolling import roll
from pbrl_planner.costmap.scan import RangeScan
from pbrl_planner.costmap.settings import CostmapSettings
from pbrl_planner.costmap.static_map import StaticMap
from pbrl_planner.errors import PlannerError

Mask = NDArray[np.bool_]
FARTHEST = 1e6  # [m] from the frame's origin
ALIGNED = 1e-9  # of a cell: rounding at a border must not roll the window to and fro


@dataclass(frozen=True)
class ScanReport:
    """What a scan changed: cells newly occupied, cells newly free, readings that were of the robot or its cart."""

    occupied: int
    freed: int
    own: int


@dataclass(frozen=True)
class Recovery:
    """What a recovery step took out of the costmap, for the log: nothing is cleared in silence.

    Attributes:
        what: the step, in words.
        places: (n, 2) centres of the cells that were cleared [m].
        evidence: (n,) what spoke for each of them.
        left: occupied cells of the static map in the same place, which no recovery clears.
    """

    what: str
    places: Array
    evidence: NDArray[np.int64]
    left: int


class Costmap:
    """A window of the floor, in one frame, axes along that frame's.

    The window rolls by whole cells, so that a cell keeps its place in the frame.

    Args:
        settings: size, beliefs, inflation.
        static: what was known before.
        centre: of the window to begin with [m].
        anchor: a corner between cells lies here [m].

    Attributes:
        settings: as given.
        time: of the last scan [s]; -inf: none yet.

    Raises:
        PlannerError: a place is not finite.
    """

    def __init__(
        self,
        settings: CostmapSettings | None = None,
        static: StaticMap | None = None,
        centre: tuple[float, float] = (0.0, 0.0),
        anchor: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self.settings = settings or CostmapSettings()
        self.time = -math.inf
        self._static, self._map_pose = static, np.zeros(3)
        self._anchor = _vector(anchor, 2, "anchor")
        shape = self.settings.shape
        self._evidence = np.zeros(shape, dtype=np.uint8)
        self._looked = np.zeros(shape, dtype=np.uint8)
        self._touched = np.zeros(shape, dtype=np.uint8)
        self._last, self._came, self._went = (np.full(shape, -np.inf) for _ in range(3))
        self._corner = self._corner_for(centre)
        self._known: NDArray[np.int8] | None = None
        self._overhang: Overhang | None = None  # voxels are for those who have a laser that nods

    @classmethod
    def over(cls, static: StaticMap, settings: CostmapSettings | None = None) -> Self:
        """Make a costmap in `map` that covers a whole map; its size in the settings is not looked at."""
        settings = settings or CostmapSettings()
        rows, columns = static.cells.shape
        x, y, yaw = static.origin
        across = np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]]) * static.resolution
        c, s = math.cos(yaw), math.sin(yaw)
        corners = across @ np.array([[c, s], [-s, c]]) + [x, y]
        low = corners.min(axis=0)
        spans = np.ceil((corners.max(axis=0) - low) / settings.resolution - 1e-6) * settings.resolution
        if not (spans <= 1000.0).all():
            raise PlannerError(f"costmap: expected a map at most 1000 m long, got {spans.max():g} m")
        spans = np.maximum(spans, 3.0 * settings.resolution)
        try:
            whole = CostmapSettings(**{**settings.model_dump(), "width": spans[0], "height": spans[1]})
        except ValueError as error:
            raise PlannerError(f"costmap: expected a smaller map or larger cells, got {rows} by {columns}") from error
        found = cls(whole, static, anchor=(float(low[0]), float(low[1])))
        found._corner = (0, 0)
        return found

    @property
    def origin(self) -> tuple[float, float]:
        """Corner of the window with the lowest x and y [m]."""
        x, y = self._anchor + self.settings.resolution * np.array(self._corner)
        return float(x), float(y)

    def recentre(self, x: float, y: float) -> None:
        """Roll the window so that a place is in its middle cell; what comes in is unknown.

        Raises:
            PlannerError: the place is not finite, or out of this world.
        """
        corner = self._corner_for((x, y))
        dx, dy = corner[0] - self._corner[0], corner[1] - self._corner[1]
        if (dx, dy) == (0, 0):
            return
        self._corner, self._known = corner, None
        for counts in (self._evidence, self._looked):
            roll(counts, dy, dx, 0)
        for times in (self._last, self._came, self._went):
            roll(times, dy, dx, -np.inf)
        if self._overhang is not None:
            self._overhang.roll(dy, dx)

    def place_map(self, map_pose: Array | Sequence[float]) -> None:
        """Say where `map` is: pose (3,) in the costmap's frame; at the start it is that frame.

        Raises:
            PlannerError: the pose is not finite.
        """
        pose = _vector(map_pose, 3, "pose of the map")
        if not np.array_equal(pose, self._map_pose):
            self._map_pose, self._known = pose, None

    def observe(self, scan: RangeScan, laser: Array | Sequence[float], own: Sequence[Array] = ()) -> ScanReport:
        """Take in a scan: beams clear what they pass, and mark where they end, unless that is the robot or its cart.

        Args:
            scan: of a laser that lies level.
            laser: pose (3,) of its frame.
            own: outlines (k, 2) of robot, arms and cart where they were then [m], all in the costmap's frame.

        Raises:
            PlannerError: a pose or outline is not what it should be.
        """
        pose = _vector(laser, 3, "pose of the laser")
        corners, first = _packed(own)
        settings, evidence = self.settings, self.settings.evidence
        mine = kernel.trace(
            scan.ranges,
            scan.angle_min,
            scan.increment,
            *scan.span,
            pose,
            settings.mark_range,
            settings.clear_range,
            corners,
            first,
            settings.own_margin,
            settings.resolution,
            *self.origin,
            self._touched,
        )
        occupied, freed = kernel.believe(
            self._touched,
            scan.time,
            evidence.hit,
            evidence.miss,
            evidence.most,
            self._evidence,
            self._looked,
            self._last,
            self._came,
            self._went,
        )
        if self._overhang is not None:
            self._overhang.go_with(scan.time, self._evidence, self._last, self._came, self._went)
        self.time = max(self.time, scan.time)
        return ScanReport(occupied, freed, mine)

    def observe_nodding(self, scan: RangeScan, laser: Array, own: Sequence[Array] = ()) -> ScanReport:
        """Take in a scan of a laser that nods: what it sees over the floor is in the way as well.

        Such scans come seldom to any one place: `time`, by which a costmap gets old, is that of the level laser.

        Args:
            scan: of a laser that leans any way.
            laser: (4, 4) pose of its frame in the costmap's, the floor at height 0.
            own: as in `observe`.

        Raises:
            PlannerError: the pose is not finite, or too far away; an outline is not what it should be.
        """
        pose = np.asarray(laser, dtype=float)
        if pose.shape != (4, 4) or not np.isfinite(pose).all() or np.abs(pose[:3, 3]).max() > FARTHEST:
            raise PlannerError(f"costmap: expected a pose (4, 4) within {FARTHEST:g} m of a laser, got {laser}")
        settings = self.settings
        if self._overhang is None:
            self._overhang = Overhang(settings.overhang, settings.shape, settings.resolution)
        return ScanReport(*self._overhang.observe(scan, pose, _packed(own), settings.own_margin, self.origin))

    def field(self, now: float) -> CostField:
        """Return the costs as of `now` [s]; obstacles that nobody has seen for too long are forgotten first."""
        evidence = self.settings.evidence
        kernel.forget(
            now, evidence.confirmed, evidence.fleeting, evidence.memory, self._evidence, self._looked, self._last
        )
        lethal, unseen = self._evidence > 0, self._looked == 0
        unknown = unseen.copy()
        if self._overhang is not None:
            lethal |= self._overhang.occupied(now)
        known = self._from_map()
        if known is not None:
            lethal |= known == 1
            unknown &= known == -1
        unknown &= ~lethal
        if self.settings.unknown == "lethal":
            lethal |= unknown
        if self.settings.unknown != "unknown":
            unknown[:] = False
        cells = inflate(lethal, unknown, self.settings.resolution, self.settings.inflation)
        if known is not None and self.settings.unseen:
            np.maximum(cells, self.settings.unseen, out=cells, where=unseen & (known == 0))
        return CostField(cells, self.settings.resolution, self.origin, self.time)

    def clear_inside(self, outlines: Sequence[Array]) -> Recovery:
        """Take out what is marked where robot and cart are: nothing else can be there.

        Args:
            outlines: (k, 2) each [m]. Cells that touch one go.

        Raises:
            PlannerError: an outline is not what it should be.
        """
        corners, first = _packed(outlines)
        inside = np.zeros(self.settings.shape, dtype=np.uint8)
        half = self.settings.resolution * math.sqrt(0.5)
        kernel.cells_near(corners, first, half, self.settings.resolution, *self.origin, inside)
        where = inside == 1
        return self._take_out(where, where, "cleared what was marked where robot and cart are")

    def clear_unconfirmed(self) -> Recovery:
        """Take out all that was seen too seldom to be sure of it, wherever it is (thesis 4.6: spurious readings)."""
        doubtful = self._evidence < self.settings.evidence.confirmed
        above = None if self._overhang is None else ~self._overhang.settled()
        return self._take_out(doubtful, above, "cleared obstacles that were seen too seldom to be sure of them")

    def clear_unseen(self, now: float, age: float) -> Recovery:
        """Take out what nobody has seen for so long [s]: who stood in the shadow of the cart may have gone.

        Raises:
            PlannerError: a number is not finite.
        """
        if not (math.isfinite(now) and math.isfinite(age)):
            raise PlannerError(f"costmap: expected a finite time and age, got {now} and {age} s")
        above = None if self._overhang is None else self._overhang.unseen(now, age)
        return self._take_out(now - self._last > age, above, f"cleared obstacles that nobody has seen for {age:g} s")

    def _take_out(self, where: Mask, above: Mask | None, what: str) -> Recovery:
        """Take out what is marked on the floor in some cells, and over it in others."""
        strength = np.where(where, self._evidence, 0).astype(np.int64)
        self._evidence[where] = 0
        if self._overhang is not None and above is not None:
            over = self._overhang.strength()
            strength = np.maximum(strength, np.where(above, over, 0))
            self._overhang.clear(above)
        gone = strength > 0
        rows, columns = np.nonzero(gone)
        places: Array = (np.column_stack((columns, rows)) + 0.5) * self.settings.resolution + np.array(self.origin)
        known = self._from_map()
        left = 0 if known is None else int(np.count_nonzero(where & (known == 1)))
        return Recovery(what, places, strength[gone], left)

    def _from_map(self) -> NDArray[np.int8] | None:
        if self._static is not None and self._known is None:
            self._known = self._static.onto(self.settings.shape, self.settings.resolution, self.origin, self._map_pose)
        return self._known

    def _corner_for(self, centre: Sequence[float] | Array) -> tuple[int, int]:
        """Return the corner of the window about a place, in cells from the anchor along x and y."""
        rows, columns = self.settings.shape
        x, y = (_vector(centre, 2, "centre") - self._anchor) / self.settings.resolution
        return math.floor(x + ALIGNED) - columns // 2, math.floor(y + ALIGNED) - rows // 2


def _vector(values: Sequence[float] | Array, count: int, what: str) -> Array:
    found = np.asarray(values, dtype=float)
    if found.shape != (count,) or not np.isfinite(found).all() or np.abs(found[:2]).max() > FARTHEST:
        raise PlannerError(f"costmap: expected {what} as {count} finite numbers within {FARTHEST:g} m, got {values}")
    return found


def _packed(outlines: Sequence[Array]) -> tuple[Array, NDArray[np.int64]]:
    """Return all corners (c, 2), and where each outline begins (k + 1,)."""
    try:
        rings = [np.asarray(ring, dtype=float) for ring in outlines]
        for ring in rings:
            as_polygon(ring, "robot or cart")
    except (ControlError, ValueError, TypeError) as error:
        raise PlannerError(str(error)) from error
    first = np.cumsum([0, *(len(ring) for ring in rings)]).astype(np.int64)
    return np.ascontiguousarray(np.concatenate([*rings, np.zeros((0, 2))])), first
