"""Value iteration over free-space regions (thesis 6.2.1, figure 33): which obstacle to move from where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_control.planar import Array
from pbrl_namo.errors import NamoError
from pbrl_namo.manipulation.plan import Estimate
from pbrl_namo.mdp.settings import MdpSettings
from pbrl_namo.mdp.value_kernel import sweep_until

Indices = NDArray[np.int64]
Outcome = tuple[int, int, float, float]
"""Of one action: region it starts in, region it may lead to, probability of that, reward."""


@dataclass(frozen=True)
class Policy:
    """What to do in each region.

    Attributes:
        values: (n,) of the regions: discounted reward that is expected from there, zero where nothing is worth doing.
        q: (k,) of the actions, in the order in which they were given.
        best: for each region the index of its best action; None where nothing is worth doing, and at the goal.
        sweeps: that it took.
    """

    values: Array
    q: Array
    best: tuple[int | None, ...]
    sweeps: int


def solve(count: int, goal: int, estimates: Sequence[Estimate], settings: MdpSettings | None = None) -> Policy:
    """Solve the upper level by value iteration.

    An opening that fails leaves the robot in the region it was in. The goal's region is absorbing and worth the
    terminal reward. A robot may always give up, so no region is worth less than nothing.

    Args:
        count: of regions.
        goal: the region that is wanted.
        estimates: of openings between them.
        settings: discount and terminal reward.

    Raises:
        NamoError: a region is none, a probability is none, a reward is not finite, or values do not stand.
    """
    outcomes = [(each.opening.start, each.opening.end, each.probability, each.reward) for each in estimates]
    return solve_outcomes(count, goal, outcomes, settings or MdpSettings())


def solve_outcomes(count: int, goal: int, outcomes: Sequence[Outcome], settings: MdpSettings) -> Policy:
    """Solve as `solve` does, with actions as plain numbers.

    Raises:
        NamoError: as of `solve`.
    """
    if not 0 <= goal < count:
        raise NamoError(f"goal: expected a region from 0 to {count - 1}, got {goal}")
    for start, end, probability, reward in outcomes:
        if not (0 <= start < count and 0 <= end < count):
            raise NamoError(f"opening: expected regions from 0 to {count - 1}, got {start} and {end}")
        if not 0.0 <= probability <= 1.0 or not np.isfinite(reward):
            raise NamoError(f"opening: expected 0 <= T <= 1 and a finite reward, got T = {probability}, R = {reward}")
    table = np.array(outcomes, dtype=float).reshape(-1, 4)
    starts, ends = table[:, 0].astype(np.int64), table[:, 1].astype(np.int64)
    values, q = np.zeros(count), np.zeros(len(table))
    values[goal] = settings.terminal
    sweeps = sweep_until(
        starts,
        ends,
        np.ascontiguousarray(table[:, 2]),
        np.ascontiguousarray(table[:, 3]),
        goal,
        settings.gamma,
        settings.tolerance,
        settings.sweeps,
        values,
        q,
    )
    if sweeps < 0:
        raise NamoError(f"value iteration: expected values that stand after {settings.sweeps} sweeps; lower gamma")
    return Policy(
        values, q, tuple(_best(region, goal, starts, q, settings.tolerance) for region in range(count)), sweeps
    )


def _best(region: int, goal: int, starts: Indices, q: Array, tolerance: float) -> int | None:
    """Return the best action of a region, the first of equal ones; None where none is worth anything."""
    own = np.flatnonzero(starts == region)
    if region == goal or not len(own):
        return None
    first = int(own[int(np.argmax(q[own]))])
    return first if q[first] > tolerance else None
