"""Compiled: every parameter row over every window, in groups of lanes (`lane_kernel.py`), on one core or on all.

A body's motion is the work of one lane; which lanes stand beside it, and on which core, does not change a byte.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_model.engines import lane_kernel as lk
from pbrl_model.engines.lane_kernel import LANES

Array = NDArray[np.float64]
Index = NDArray[np.int64]

KINDS = 4
KIND, FIRST, COUNT, ROWS, AMONG = range(5)
"""Columns of a plan: the group's kind, its first pair among those of this kind, how many pairs it has, where the rows
of this kind start in the order of rows, how many rows are of this kind."""


@njit(**LEAF)
def plan_groups(parameters: Array, windows: int, order: Index, plan: Index) -> int:
    """Sort rows by kind and share out their (row, window) pairs among groups of lanes; return the number of groups.

    Pairs of one kind are counted window by window, so that the lanes of a group mostly share a window.

    Args:
        parameters: (P, 12).
        windows: W.
        order: (P,) written: rows, sorted by kind.
        plan: (>= P * W // LANES + 4, 5) written, see `KIND`.
    """
    groups = 0
    place = 0
    for kind in range(KINDS):
        start = place
        for p in range(parameters.shape[0]):
            if lk.kind_of(parameters[p]) == kind:
                order[place] = p
                place += 1
        among = place - start
        for first in range(0, among * windows, LANES):
            plan[groups, KIND], plan[groups, FIRST] = kind, first
            plan[groups, COUNT] = min(LANES, among * windows - first)
            plan[groups, ROWS], plan[groups, AMONG] = start, among
            groups += 1
    return groups


@njit(**LEAF)
def write_lanes(lanes: Array, pair: Index, steps: Index, t: int, out: Array) -> None:
    """Write step `t` of every lane whose window has not ended.

    Args:
        lanes: (SIZE,).
        pair: (2, count) row and window of each lane.
        steps: (W,).
        t: which step.
        out: (P, W, T + 1, 3 or 6), or (P, 1, T + 1, 3 or 6).
    """
    for i in range(pair.shape[1]):
        p, w = pair[0, i], pair[1, i]
        if t <= steps[w]:
            row = out[p, w if out.shape[1] > 1 else 0, t]
            row[0], row[1], row[2] = lanes[lk.OUT_X + i], lanes[lk.OUT_Y + i], lanes[lk.THETA + i]
            if row.size == 6:
                row[3], row[4], row[5] = lanes[lk.VX + i], lanes[lk.VY + i], lanes[lk.OMEGA + i]


@njit(cache=True, error_model="numpy")
def roll_group(
    group: Index,
    order: Index,
    parameters: Array,
    initial: Array,
    wrench: Array,
    steps: Index,
    inertia_per_mass: Array,
    com: Array,
    of_com: bool,
    dt: float,
    body_wrench: bool,
    paired: bool,
    lanes: Array,
    pair: Index,
    out: Array,
) -> None:
    """Roll out one group; arguments as of `rollout_serial`, the rooms being those of one worker."""
    count, longest, slides = group[COUNT], 0, False
    for i in range(count):
        number = group[FIRST] + i
        p = order[group[ROWS] + number % group[AMONG]]
        column = number // group[AMONG]
        w = p if paired else column
        pair[0, i], pair[1, i] = p, w
        start = initial[p if initial.shape[0] > 1 else 0, column]
        lk.load_lane(lanes, i, parameters[p], start, inertia_per_mass[p], com[p, 0], com[p, 1], of_com, dt)
        longest = max(longest, steps[w])
        slides = slides or lanes[lk.GROUND + i] > 0.0
        out[p, column, steps[w] + 1 :] = np.nan
    full = lk.fill_up(lanes, count)
    correction = lk.joint_correction(dt)
    for t in range(longest + 1):
        lk.place_lanes(lanes, full)
        write_lanes(lanes, pair[:, :count], steps, t, out)
        if t == longest:
            break
        for i in range(count):
            # A lane whose window has ended goes on unseen: its pushes are there, whatever they are.
            push = wrench[pair[1, i], t]
            lanes[lk.FX + i], lanes[lk.FY + i], lanes[lk.TAU + i] = push[0], push[1], push[2]
        lk.step_lanes(lanes, full, group[KIND], slides, body_wrench, dt, correction)


@njit(cache=True, error_model="numpy", nogil=True)
def rollout_serial(
    parameters: Array,
    initial: Array,
    wrench: Array,
    steps: Index,
    inertia_per_mass: Array,
    com: Array,
    of_com: bool,
    dt: float,
    body_wrench: bool,
    paired: bool,
    order: Index,
    plan: Index,
    lanes: Array,
    pair: Index,
    out: Array,
) -> None:
    """Roll out every parameter row over every window on this core.

    Args:
        parameters: (P, 12) rows of `KERNEL_COLUMNS`.
        initial: (P, W, 6), or (1, W, 6) for one start for all rows.
        wrench: (W, T, 3).
        steps: (W,) steps of each window, at most T.
        inertia_per_mass: (P,) [m^2].
        com: (P, 2) centres of mass in the bodies' frames [m].
        of_com: whether to write poses of the centre of mass, not of the frame's origin.
        dt: [s].
        body_wrench: whether forces are in the bodies' axes, at the heading to which the step leads.
        paired: row p goes with window p alone: W = P, and the second length of `initial` and `out` is one.
        order: (P,) room.
        plan: (>= P * W // LANES + 4, 5) room.
        lanes: (workers, SIZE) room; here one worker is enough.
        pair: (workers, 2, LANES) room.
        out: (P, W, T + 1, 3 or 6), written; NaN past a window's own end.
    """
    groups = plan_groups(parameters, out.shape[1], order, plan)
    for g in range(groups):
        roll_group(
            plan[g],
            order,
            parameters,
            initial,
            wrench,
            steps,
            inertia_per_mass,
            com,
            of_com,
            dt,
            body_wrench,
            paired,
            lanes[0],
            pair[0],
            out,
        )


@njit(cache=True, error_model="numpy", nogil=True, parallel=True)
def rollout_parallel(
    parameters: Array,
    initial: Array,
    wrench: Array,
    steps: Index,
    inertia_per_mass: Array,
    com: Array,
    of_com: bool,
    dt: float,
    body_wrench: bool,
    paired: bool,
    order: Index,
    plan: Index,
    lanes: Array,
    pair: Index,
    out: Array,
) -> None:
    """Do what `rollout_serial` does on all cores, each worker with a room of its own."""
    groups, workers = plan_groups(parameters, out.shape[1], order, plan), lanes.shape[0]
    for worker in prange(workers):
        for g in range(worker, groups, workers):
            roll_group(
                plan[g],
                order,
                parameters,
                initial,
                wrench,
                steps,
                inertia_per_mass,
                com,
                of_com,
                dt,
                body_wrench,
                paired,
                lanes[worker],
                pair[worker],
                out,
            )
