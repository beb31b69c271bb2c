"""DIRECTGD: the objective itself is descended, as if items could be moved at will, but not through each other.

The gradient is taken numerically, so any function will do. Each item has a step of its own, made shorter where it no
longer helps; where something is in the way of a step, the item slides along it by one coordinate.
"""

from __future__ import annotations

import numpy as np

from pbrl_control.planar import Array
from pbrl_planner.tabletop.box_kernel import box_fault
from pbrl_planner.tabletop.objective import Objective

DELTA = np.array([1e-4, 1e-4, 1e-3])
"""By which coordinates are changed for the gradient [m, m, rad]."""
FIRST, LAST = 0.08, 0.002
"""Length of the first step of an item, and of the last that is tried [m]."""
STEPS = 120
"""Of all items together, at most."""
TRIES, DESCENTS = 4000, 30
"""Layouts that are drawn to find free ones, and how many of these are descended from, where the best is asked for."""


def descend(objective: Objective, layout: Array, margin: float, weight: float) -> tuple[Array, float]:
    """Go downhill from a layout (n, 3) that is free of collision.

    Args:
        objective: what is made smaller.
        layout: where to begin.
        margin: that items keep from each other [m].
        weight: of an angle in the length of a step [m/rad].

    Returns:
        The layout (n, 3) at the end, and its value.
    """
    desk = objective.desk
    here, value = layout.copy(), objective(layout)
    steps = np.full(len(here), FIRST)
    scale = np.array([1.0, 1.0, 1.0 / weight])
    for _ in range(STEPS):
        moving = np.flatnonzero(steps >= LAST)
        if not len(moving):
            break
        slope = _gradient(objective, here) * scale
        for k in moving.tolist():
            length = float(np.linalg.norm(slope[k]))
            if length < 1e-9:
                steps[k] = 0.0
                continue
            whole = -steps[k] / length * slope[k] * scale
            tries = [whole, *(np.where(np.arange(3) == axis, whole, 0.0) for axis in range(3))]
            for step in tries:
                there = here.copy()
                there[k] += step
                if step.any() and not box_fault(
                    here, k, there[k], desk.halves, desk.fixed, desk.table.low, desk.table.high, margin
                ):
                    found = objective(there)
                    if found < value - 1e-9:
                        here, value = there, found
                        break
            else:
                steps[k] /= 2.0
    return here, value


def _gradient(objective: Objective, layout: Array) -> Array:
    """Return the slope (n, 3) of an objective, by central differences."""
    count = layout.size
    changes = np.diag(np.tile(DELTA, len(layout))).reshape(count, *layout.shape)
    values = objective.many(np.concatenate((layout + changes, layout - changes)))
    return np.asarray((values[:count] - values[count:]).reshape(layout.shape) / (2.0 * DELTA))


def near_best(
    objective: Objective, rng: np.random.Generator, margin: float, weight: float, share: float = 0.1
) -> float:
    """Return a value that is nearly as good as any layout can be, whether or not pushes lead there.

    Args:
        objective: of a desk.
        rng: draws layouts to descend from.
        margin: that items keep from each other [m].
        weight: of an angle in the length of a step [m/rad].
        share: of the way from what random layouts have, in the mean, to the best that is found: so much is let off.
    """
    desk = objective.desk
    low, high = np.append(desk.table.low, -np.pi), np.append(desk.table.high, np.pi)
    values, best = [], np.inf
    for _ in range(TRIES):
        layout = rng.uniform(low, high, (len(desk.items), 3))
        if desk.fault(layout, margin):
            continue
        values.append(objective(layout))
        if len(values) <= DESCENTS:
            best = min(best, descend(objective, layout, margin, weight)[1])
    return float(best + share * (np.mean(values) - best)) if values else np.inf
