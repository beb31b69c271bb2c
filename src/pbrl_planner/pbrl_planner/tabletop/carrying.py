"""Who goes where, and who stands in whose way, when items are brought to their places one by one."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from pbrl_control.planar import Array
from pbrl_planner.tabletop.box_kernel import box_fault, separation
from pbrl_planner.tabletop.desk import Desk
from pbrl_planner.tabletop.objective import Objective

SAME = 1e-6
"""Costs that differ by less are the same."""


def exchanged(objective: Objective, layout: Array, goal: Array) -> Array:
    """Return a goal in which items of one size have the places nearest to them, where that costs nothing.

    Args:
        objective: that the goal is good for.
        layout: (n, 3) where items are.
        goal: (n, 3) where they are to be.
    """
    halves, found = objective.desk.halves, goal.copy()
    for half in np.unique(halves, axis=0):
        alike = np.flatnonzero((halves == half).all(axis=1))
        off = layout[alike][:, None, :2] - goal[alike][None, :, :2]
        _, chosen = linear_sum_assignment(np.hypot(off[..., 0], off[..., 1]))
        found[alike] = goal[alike][chosen]
    return found if objective(found) <= objective(goal) + SAME else goal


def in_the_way(desk: Desk, layout: Array, item: int, place: Array, margin: float) -> list[int]:
    """Return the items of a layout (n, 3) that stand where another one is to be (3,)."""
    here = (*place, *desk.halves[item])
    others = [other for other in range(len(layout)) if other != item]
    return [other for other in others if separation(*here, *layout[other], *desk.halves[other]) < margin]


def steps_aside(
    desk: Desk, layout: Array, item: int, places: Array, kept: tuple[int, Array], margin: float
) -> Array | None:
    """Return the first place (3,) that is free for an item, and is not what is kept for another one.

    Args:
        desk: table, items and obstacles.
        layout: (n, 3) where the items are.
        item: that steps aside.
        places: (m, 3) to choose from.
        kept: the other one, and the place (3,) that is kept for it.
        margin: that items keep [m].
    """
    then = layout.copy()
    then[kept[0]] = kept[1]
    for place in places:
        if not box_fault(then, item, place, desk.halves, desk.fixed, desk.table.low, desk.table.high, margin):
            return np.asarray(place)
    return None
