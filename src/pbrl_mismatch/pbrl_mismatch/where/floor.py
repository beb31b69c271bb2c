"""The part of the floor on which a left-out wrench was there, if that is what its coming and going goes by."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_mismatch.unknown.samples import Samples
from pbrl_mismatch.where.partition import Partition

Array = NDArray[np.float64]

PURE = 0.8
"""Where the body was, the wrench is there in at least this share of the moments, or it does not go by place."""
PARTLY = (0.02, 0.9)
"""Shares of all moments between which a wrench is there for part of the time."""


@dataclass(frozen=True)
class FloorRegion:
    """Where the body's centre of mass was while the wrench was there.

    Attributes:
        shape: (n, 2) corners in the recording's world [m].
        border_sd: how well its border is known where the body crossed it, as a standard deviation [m].
        share_there: of the moments inside, those at which the wrench was there.
        passes: so many times the body was inside.
    """

    shape: Array
    border_sd: float
    share_there: float
    passes: int


def floor_region(samples: Samples, found: Partition) -> FloorRegion | None:
    """Return the region outside of which the wrench was not there, or None: it is all over, or goes by something else.

    Args:
        samples: N moments.
        found: their stretches.
    """
    there = found.there
    if not PARTLY[0] < float(there.mean()) < PARTLY[1]:
        return None
    step = np.hypot(*np.diff(samples.place, axis=0).T)
    across = [_border(samples, step, change.time, change.sd) for change in found.changes]
    border = float(np.median(across)) if across else 0.0
    hull = shapely.MultiPoint(samples.place[there]).convex_hull.buffer(max(border, 1e-3), quad_segs=2)
    inside = shapely.contains_xy(hull, *samples.place.T)
    share = float(there[inside].mean())
    if share < PURE:
        return None
    passes = int(np.sum(np.diff(inside.astype(int), prepend=0) == 1))
    return FloorRegion(np.asarray(hull.exterior.coords)[:-1], border, share, passes)


def _border(samples: Samples, step: Array, time: float, sd: float) -> float:
    """Return how far the body went in the time by which a change is unsure [m]."""
    k = min(max(int(np.searchsorted(samples.time, time)) - 1, 0), len(step) - 1)
    gap = float(samples.time[k + 1] - samples.time[k])
    return float(step[k]) / max(gap, 1e-9) * math.hypot(sd, gap / math.sqrt(12.0))
