"""When a gripper held an object, from their poses alone: while the object moved, the gripper kept its place on it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter
from scipy.spatial.transform import Rotation

from pbrl_bag.streams import are_turns
from pbrl_bag.types import Array

MOVING = 0.01
"""Faster than this [m/s] an object moves."""
KEPT = 0.03
"""A gripper that holds stays so near to its place on the object [m]."""
FEWEST = 5
"""Samples in which an object has to move."""
UNLOADED = 0.3
"""As long [s] as this the hand stands where it will hold before it feels anything of it."""
FELT = 8.0
"""What differs from the first force by more than so many deviations, and by `FELT_SHARE` of the most, is felt."""
FELT_SHARE = 0.05
STEADY = 9
"""Samples of which the middle one counts: sensors have single values that are far off."""
BEFORE, AFTER = 0.5, 0.1
"""A gripper was closed so long before it felt anything, and opens so long after [s]."""
SMOOTH = 0.2
"""Speeds are taken over so long [s]: tags jitter by millimetres."""


@dataclass(frozen=True)
class Held:
    """A gripper on an object.

    Attributes:
        start, end: when [s].
        contact: (2,) the gripper's place in the object's frame [m].
        share: of the time in which the object moved that it was held, 0..1.
    """

    start: float
    end: float
    contact: Array
    share: float


def extent(rows: Array) -> float:
    """Return how far poses (n, 8) reach apart on the floor [m]."""
    return float(np.hypot(*np.ptp(rows[:, 1:3], axis=0))) if len(rows) else 0.0


def speeds(rows: Array) -> Array:
    """Return (n,) speeds of poses (n, 8) on the floor [m/s]."""
    time = rows[:, 0]
    before, after = time - 0.5 * SMOOTH, time + 0.5 * SMOOTH
    x, y = (np.interp(after, time, rows[:, k]) - np.interp(before, time, rows[:, k]) for k in (1, 2))
    span = np.minimum(after, time[-1]) - np.maximum(before, time[0])
    return np.asarray(np.hypot(x, y) / np.maximum(span, 1e-9))


def held(of: Array, by: Array) -> Held | None:
    """Tell whether, when and where an object was held.

    Args:
        of: poses of the object (n, 8); those whose orientation is none are left out.
        by: poses of the gripper (m, 8), in the same frame.

    Returns:
        None where the object did not move, or the gripper did not go along.
    """
    if len(of) < FEWEST or len(by) < FEWEST:
        return None
    inside = (of[:, 0] >= by[0, 0]) & (of[:, 0] <= by[-1, 0])
    rows = of[inside & are_turns(of[:, 4:8])]
    if len(rows) < FEWEST or not np.isfinite(rows).all():
        return None
    hand = np.column_stack([np.interp(rows[:, 0], by[:, 0], by[:, k]) for k in (1, 2, 3)])
    place = Rotation.from_quat(rows[:, 4:8]).inv().apply(hand - rows[:, 1:4])[:, :2]
    moving = speeds(rows) > MOVING
    if moving.sum() < FEWEST:
        return None
    contact = np.median(place[moving], axis=0)
    near = np.hypot(*(place - contact).T) < KEPT
    share = float(near[moving].mean())
    if share < 0.5:
        return None
    together = np.flatnonzero(moving & near)
    first, last = int(together[0]), int(together[-1])
    # It was held a little before it moved, and after: as long as the gripper stood where it holds.
    while first > 0 and near[first - 1]:
        first -= 1
    while last + 1 < len(near) and near[last + 1]:
        last += 1
    return Held(float(rows[first, 0]), float(rows[last, 0]), contact, share)


def while_felt(together: Held, wrench: Array) -> Held:
    """Return a hold without the time in which the hand only stood there: nothing was felt then.

    Args:
        together: by the poses.
        wrench: (n, 7) time [s], force [N], torque [N m].
    """
    rows = wrench[(wrench[:, 0] >= together.start) & (wrench[:, 0] <= together.end)]
    first = rows[rows[:, 0] < together.start + UNLOADED, 1:4]
    if len(first) < FEWEST or not np.isfinite(rows).all():
        return together
    level = np.median(first, axis=0)
    noise = float(np.sqrt(np.mean((first - level) ** 2)))
    off = np.linalg.norm(median_filter(rows[:, 1:4], (STEADY, 1)) - level, axis=1)
    felt = np.flatnonzero(off > max(FELT * noise, FELT_SHARE * float(off.max())))
    if not len(felt):
        return together
    start = max(together.start, float(rows[felt[0], 0]) - BEFORE)
    return replace(together, start=start, end=min(together.end, float(rows[felt[-1], 0]) + AFTER))
