"""What the steps of one thing are to lead to: a way past it, or that it is out of the way of something else."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_control.planar import Array
from pbrl_namo.manipulation.steps import Step, Tries
from pbrl_namo.scene import Movable

SHARES = np.linspace(0.1, 1.0, 10)
"""Of a motion, at which it is asked whether the thing is out of the way."""
LOOKS = 6
"""Places out of the way of which it is asked whether they are good for what follows."""


class OpenWay:
    """A way past the thing to a target.

    Args:
        thing: that is moved.
        target: (2,) in `world` [m].
        keep: (k, 2) in `world` that must not be covered when it is let go [m].
        radius: of the disc that goes there [m].
    """

    def __init__(self, thing: Movable, target: Array, keep: Array, radius: float) -> None:
        self.target: Array | None = target
        self._thing, self._radius, self._keep = thing, radius, shapely.multipoints(np.vstack((target, keep)))

    def reached(self, tries: Tries) -> Step | None:
        """See `Aim`: the quickest."""
        rows = np.flatnonzero(tries.opened)
        rows = rows[~_covering(outlines(self._thing, tries.ends()[rows]), self._keep, self._radius)]
        return tries.step(int(rows[np.argmin(tries.seconds[rows])])) if len(rows) else None

    def far(self, poses: Array, way: shapely.LineString | None) -> Array:
        """See `Aim`: how much of the way the thing covers."""
        covers = outlines(self._thing, poses)
        covered = np.zeros(len(poses))
        if way is not None:
            covered = shapely.length(shapely.intersection(shapely.buffer(covers, self._radius, quad_segs=2), way))
        return np.where(_covering(covers, self._keep, self._radius), np.inf, covered)


class OutOfTheWay:
    """The thing is where it does not matter.

    Args:
        thing: that is moved.
        area: that it has to leave, in `world`.
        keep: (k, 2) in `world` that must not be covered when it is let go [m].
        radius: of the disc that goes there [m].
        good: says of the step by which it gets out of the way whether what follows is then possible.
    """

    def __init__(
        self, thing: Movable, area: shapely.Geometry, keep: Array, radius: float, good: Callable[[Step], bool]
    ) -> None:
        self.target: Array | None = None
        self._thing, self._area, self._good = thing, area, good
        self._radius, self._keep = radius, shapely.multipoints(keep)
        shapely.prepare(self._area)

    def reached(self, tries: Tries) -> Step | None:
        """See `Aim`: the quickest of those that are good, a few asked."""
        parts = tries.shared(SHARES)
        covers = outlines(self._thing, parts.ends())
        out = ~shapely.intersects(self._area, covers)
        rows = np.flatnonzero(out)
        rows = rows[~_covering(covers[rows], self._keep, self._radius)]
        rows = rows[np.argsort(parts.seconds[rows], kind="stable")]
        few = rows[:: max(len(rows) // LOOKS, 1)][:LOOKS].tolist()
        return next((step for step in map(parts.step, few) if self._good(step)), None)

    def far(self, poses: Array, way: shapely.LineString | None) -> Array:
        """See `Aim`: the root of the area that the thing covers of what it has to leave."""
        covers = outlines(self._thing, poses)
        covered = np.sqrt(shapely.area(shapely.intersection(self._area, covers)))
        return np.where(_covering(covers, self._keep, self._radius), np.inf, covered)


def outlines(thing: Movable, poses: Array) -> NDArray[np.object_]:
    """Return the outlines (n,) in `world` of a thing at poses (n, 3) [m, rad]."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    turns = np.stack((np.stack((c, s), axis=1), np.stack((-s, c), axis=1)), axis=1)  # (n, 2, 2), transposed
    return np.asarray(shapely.polygons(thing.footprint @ turns + poses[:, None, :2]), dtype=object).reshape(-1)


def _covering(covers: NDArray[np.object_], keep: shapely.Geometry, radius: float) -> NDArray[np.bool_]:
    """Say which outlines (n,) a disc of a radius [m] at some points would touch."""
    touched: NDArray[np.bool_] = shapely.dwithin(covers, keep, radius)
    return touched
