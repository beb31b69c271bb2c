"""Leaves out pushes that a plan does not need: what random growth put in and what nothing later relies on."""

from __future__ import annotations

import numpy as np

from pbrl_control.planar import Array
from pbrl_planner.tabletop.objective import Objective
from pbrl_planner.tabletop.tree_kernel import Index, PushTables, follow

WORTH = 1e-6


def shortened(start: Array, sequence: Index, tables: PushTables, objective: Objective, push_cost: float) -> Index:
    """Leave out pushes, singly and in pairs, as long as all others stay free and each is hardly missed.

    Args:
        start: (n, 3) layout.
        sequence: (m,) item times pushes an item, plus push.
        tables: what pushes do.
        objective: that is to stay small.
        push_cost: by which it may grow for each push that is left out.
    """
    layout = np.empty_like(start)
    keep = np.ones(len(sequence), dtype=np.uint8)
    if not follow(start, sequence, keep, tables, layout):
        return sequence
    cost = objective(layout)
    kinds = tables.clearance.shape[1]
    items = sequence // kinds

    def can_go(*which: int) -> bool:
        nonlocal cost
        keep[list(which)] = 0
        if follow(start, sequence, keep, tables, layout):
            then = objective(layout)
            if then <= cost + len(which) * push_cost + WORTH:
                cost = then
                return True
        keep[list(which)] = 1
        return False

    again = True
    while again:
        again = False
        for k in np.flatnonzero(keep)[::-1]:
            again |= can_go(int(k))
        for k in np.flatnonzero(keep)[::-1]:
            if not keep[k]:
                continue
            partners = [int(j) for j in np.flatnonzero(keep[:k]) if items[j] == items[k]]
            again |= any(can_go(j, int(k)) for j in reversed(partners))
    return sequence[keep > 0]
