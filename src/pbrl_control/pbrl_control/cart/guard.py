"""Forward simulation against the local costmap (thesis 4.5.5): what of the plan is free, and what of a command."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from pbrl_control.cart import clearance_kernel as kernel
from pbrl_control.cart.body import CartBody
from pbrl_control.cart.percept import CostWindow
from pbrl_control.cart.plan import CartPlan
from pbrl_control.cart.settings import CartSettings
from pbrl_control.errors import ControlError
from pbrl_control.planar import Array

FINE = 0.5  # of a cell that a corner moves at most between two poses that are looked at
FEWEST, MOST = 8, 200  # poses of the plan that are looked at
SOON = 0.5  # of the look-ahead in which what is near matters
SHARES = (1.0, 0.75, 0.5, 0.25, 0.0)
"""Shares of a command that are tried, one after the other."""


@dataclass(frozen=True)
class Ahead:
    """What of the plan ahead is free.

    Attributes:
        free: [s] of the plan from now until something would be touched; infinite: as far as was looked.
        stop: [s] of it until so near to that as `keep` allows.
        clearance: least distance to something lethal soon [m], at most `near`.
        rates: (3,) greatest of translation, turning and articulation on the way [m/s, rad/s].
    """

    free: float
    stop: float
    clearance: float
    rates: Array


class Verdict(Enum):
    """What a command leads to."""

    FREE = "it touches nothing"
    BLOCKED = "it touches something"
    TOUCHING = "something is touched already"


class Guard:
    """Checks the swept outlines of robot and cart.

    Args:
        body: outlines.
        settings: margins and distances.
    """

    def __init__(self, body: CartBody, settings: CartSettings) -> None:
        self._settings = settings
        self._outlines = body.corners, body.on_cart, body.first, np.array(body.grip)
        self._reach = body.reach()
        self._rolled, self._found = np.empty((64, 4)), np.empty(64)
        self._braking = settings.limits.brakings

    def ahead(self, plan: CartPlan, time: float, costs: CostWindow) -> Ahead:
        """Look along the plan from a time on [s]."""
        settings = self._settings
        span = min(settings.look_ahead, plan.duration - time)
        times = time + np.linspace(0.0, max(span, 0.0), FEWEST)
        poses = plan.at(times)
        moved = np.abs(np.diff(poses, axis=0))
        corners = self._corners(poses)
        # Even in time: the fastest part of the way decides.
        count = math.ceil((FEWEST - 1) * float(corners.max()) / (FINE * costs.resolution)) + 1
        if count > FEWEST:
            times = time + np.linspace(0.0, span, min(count, MOST))
            poses = plan.at(times)
        found = np.empty(len(poses))
        blocked = self._clearance(poses, max(settings.near, settings.margin), costs, found)
        free = stop = np.inf
        if blocked < len(poses):
            way = np.concatenate(([0.0], np.cumsum(self._corners(poses[: blocked + 1]))))
            free = float(times[blocked] - time)
            stop = float(np.interp(way[-1] - settings.keep, way, times[: blocked + 1])) - time
        soon = found[times <= time + SOON * settings.look_ahead]
        lengths = np.column_stack((np.hypot(moved[:, 0], moved[:, 1]), moved[:, 2:]))
        rates = lengths.max(axis=0) * ((FEWEST - 1) / span) if span > 0.0 else np.zeros(3)
        return Ahead(free, stop, float(soon.min()), rates)

    def _corners(self, poses: Array) -> Array:
        """Return how far any corner goes at most between poses (n, 4), (n - 1,) [m]."""
        moved = np.abs(np.diff(poses, axis=0))
        return np.asarray(
            np.hypot(moved[:, 0], moved[:, 1]) + self._reach[0] * moved[:, 2] + self._reach[1] * moved[:, 3]
        )

    def verdict(self, here: Array, rates: Array, costs: CostWindow) -> Verdict:
        """Say whether a command can be given and then braked from.

        Args:
            here: pose (4,) when the command arrives.
            rates: (4,) of the command.
            costs: the costmap.
        """
        settings = self._settings
        hold, most = settings.period + settings.delay, FINE * costs.resolution
        count = kernel.roll_out(here, rates, hold, self._braking, self._reach, most, self._rolled)
        blocked = self._clearance(self._rolled[:count], settings.margin, costs, self._found[:count])
        return Verdict.FREE if blocked == count else Verdict.TOUCHING if blocked == 0 else Verdict.BLOCKED

    def _clearance(self, poses: Array, far: float, costs: CostWindow, found: Array) -> int:
        """Write distances at poses (n, 4), up to the first that is no more than the margin; return its number, or n."""
        settings = self._settings
        # Touching is a distance of nothing: at a margin of 0 it has to count, and being beyond `far` must not.
        far = max(far, settings.margin + 1e-9)
        return kernel.path_clearance(
            poses,
            *self._outlines,
            far,
            settings.margin,
            costs.cells,
            costs.resolution,
            *costs.origin,
            settings.unknown_blocks,
            found,
        )


def check_costs(costs: CostWindow) -> None:
    """Refuse a costmap that is none.

    Raises:
        ControlError: what is wrong.
    """
    cells = costs.cells
    if not isinstance(cells, np.ndarray) or cells.dtype != np.uint8 or cells.ndim != 2 or cells.size == 0:
        shape = getattr(cells, "shape", None)
        raise ControlError(
            f"costmap: expected cells (rows, columns) of uint8, got {getattr(cells, 'dtype', '')} {shape}"
        )
    if not (np.isfinite(costs.resolution) and costs.resolution > 1e-4):
        raise ControlError(f"costmap: expected a resolution above 0.0001 m, got {costs.resolution}")
    if len(costs.origin) != 2 or not np.isfinite(costs.origin).all():
        raise ControlError(f"costmap: expected a finite origin (x, y), got {costs.origin}")
