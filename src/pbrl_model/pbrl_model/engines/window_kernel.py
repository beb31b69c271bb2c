"""Compiled: simulated poses at recorded times, each (parameter row, window) with its own start and left-out wrench.

`rollout` shares one wrench among all parameter rows and returns every step. The likelihood needs the opposite:
nuisances of every row's own, and only the few steps at which a pose was recorded. Both work in lanes
(`lane_kernel.py`).

`forcing` (T, 8) is what acts in a window: the wrench in world axes, its change in time, cosine and sine of the recorded
heading. `constants` (5,) are inertia over mass [m^2], the centre of mass in the body's frame [m, m], dt [s] and the
lever that turns a force scale into a torque scale [m].
"""

from __future__ import annotations

import numba
import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_model.engines import lane_kernel as lk
from pbrl_model.engines.lane_kernel import LANES
from pbrl_model.engines.rollout_kernel import AMONG, COUNT, FIRST, KIND, KINDS, ROWS, plan_groups

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@njit(**LEAF)
def force_lane(lanes: Array, i: int, now: Array, offset: Array, late: float, lever: float) -> None:
    """Push lane `i` by what acts in this step (8,) and by what is left out (3,), constant in the body's axes."""
    c, s = now[6], now[7]
    lanes[lk.FX + i] = now[0] - late * now[3] + c * offset[0] - s * offset[1]
    lanes[lk.FY + i] = now[1] - late * now[4] + s * offset[0] + c * offset[1]
    lanes[lk.TAU + i] = now[2] - late * now[5] + lever * offset[2]


@njit(**LEAF)
def keep_lanes(lanes: Array, count: int, t: int, path: Array) -> None:
    """Write the poses of `count` lanes at step `t` into `path` (T + 1, 3, LANES)."""
    lk.place_lanes(lanes, count)
    for i in range(count):
        path[t, 0, i], path[t, 1, i], path[t, 2, i] = lanes[lk.OUT_X + i], lanes[lk.OUT_Y + i], lanes[lk.THETA + i]


@njit(**LEAF)
def read_path(path: Array, i: int, steps: int, place: Array, out: Array) -> None:
    """Write lane `i`'s poses at recorded places (N,) [steps], straight between steps, into `out` (N, 3)."""
    for n in range(place.shape[0]):
        before = min(int(place[n]), steps - 1)
        share = place[n] - before
        for k in range(3):
            out[n, k] = path[before, k, i] + share * (path[before + 1, k, i] - path[before, k, i])


@njit(**LEAF)
def simulate_starts(
    parameters: Array,
    start: Array,
    offset: Array,
    late: float,
    forcing: Array,
    steps: int,
    place: Array,
    constants: Array,
    lanes: Array,
    path: Array,
    out: Array,
) -> None:
    """Simulate one parameter row over one window from several starts at once: a likelihood's differences.

    Args:
        parameters: (12,).
        start: (n, 6) states of the centre of mass, n <= LANES.
        offset: (n, 3) left-out wrenches, see `simulate_serial`.
        late: see `simulate_serial`.
        forcing: (T, 8).
        steps: of the window.
        place: (N,) where each pose lies, in steps.
        constants: (5,).
        lanes: (SIZE,) room.
        path: (>= T + 1, 3, LANES) room.
        out: (n, N, 3), written.
    """
    count, kind, dt = start.shape[0], lk.kind_of(parameters), constants[3]
    for i in range(count):
        lk.load_lane(lanes, i, parameters, start[i], constants[0], constants[1], constants[2], False, dt)
    slides = lanes[lk.GROUND] > 0.0
    full = lk.fill_up(lanes, count)
    correction = lk.joint_correction(dt)
    keep_lanes(lanes, full, 0, path)
    for t in range(steps):
        for i in range(count):
            force_lane(lanes, i, forcing[t], offset[i], late, constants[4])
        lk.step_lanes(lanes, full, kind, slides, False, dt, correction)
        keep_lanes(lanes, full, t + 1, path)
    for i in range(count):
        read_path(path, i, steps, place, out[i])


@njit(**LEAF)
def simulate_group(
    group: Index,
    order: Index,
    parameters: Array,
    initial: Array,
    offset: Array,
    late: Array,
    forcing: Array,
    steps: Index,
    place: Array,
    constants: Array,
    lanes: Array,
    pair: Index,
    path: Array,
    out: Array,
) -> None:
    """Simulate one group of (row, window) pairs; arguments as of `simulate_serial`, the rooms those of one worker."""
    count, longest, slides, dt = group[COUNT], 0, False, constants[3]
    for i in range(count):
        number = group[FIRST] + i
        p, w = order[group[ROWS] + number % group[AMONG]], number // group[AMONG]
        pair[0, i], pair[1, i] = p, w
        lk.load_lane(lanes, i, parameters[p], initial[p, w], constants[0], constants[1], constants[2], False, dt)
        longest = max(longest, steps[w])
        slides = slides or lanes[lk.GROUND + i] > 0.0
    full = lk.fill_up(lanes, count)
    correction = lk.joint_correction(dt)
    keep_lanes(lanes, full, 0, path)
    for t in range(longest):
        for i in range(count):
            p, w = pair[0, i], pair[1, i]
            force_lane(lanes, i, forcing[w, t], offset[p, w], late[p], constants[4])
        lk.step_lanes(lanes, full, group[KIND], slides, False, dt, correction)
        keep_lanes(lanes, full, t + 1, path)
    for i in range(count):
        p, w = pair[0, i], pair[1, i]
        read_path(path, i, steps[w], place[w], out[p, w])


@njit(**LEAF, nogil=True)
def run_serial(
    parameters: Array,
    initial: Array,
    offset: Array,
    late: Array,
    forcing: Array,
    steps: Index,
    place: Array,
    constants: Array,
    out: Array,
    order: Index,
    plan: Index,
    lanes: Array,
    pair: Index,
    path: Array,
) -> None:
    """Do the work of `simulate_serial` in the rooms of the first worker."""
    groups = plan_groups(parameters, forcing.shape[0], order, plan)
    for g in range(groups):
        simulate_group(
            plan[g],
            order,
            parameters,
            initial,
            offset,
            late,
            forcing,
            steps,
            place,
            constants,
            lanes[0],
            pair[0],
            path[0],
            out,
        )


@njit(cache=True, error_model="numpy", nogil=True, parallel=True)
def run_parallel(
    parameters: Array,
    initial: Array,
    offset: Array,
    late: Array,
    forcing: Array,
    steps: Index,
    place: Array,
    constants: Array,
    out: Array,
    order: Index,
    plan: Index,
    lanes: Array,
    pair: Index,
    path: Array,
) -> None:
    """Do the work of `simulate_parallel`, each worker in rooms of its own."""
    groups, workers = plan_groups(parameters, forcing.shape[0], order, plan), lanes.shape[0]
    for worker in prange(workers):
        for g in range(worker, groups, workers):
            simulate_group(
                plan[g],
                order,
                parameters,
                initial,
                offset,
                late,
                forcing,
                steps,
                place,
                constants,
                lanes[worker],
                pair[worker],
                path[worker],
                out,
            )


def _rooms(rows: int, windows: int, longest: int, workers: int) -> tuple[Index, Index, Array, Index, Array]:
    """Make what the compiled code works in: order, plan, lanes, pairs and paths."""
    return (
        np.empty(rows, dtype=np.int64),
        np.empty((rows * windows // LANES + KINDS, 5), dtype=np.int64),
        np.empty((workers, lk.SIZE)),
        np.empty((workers, 2, LANES), dtype=np.int64),
        np.empty((workers, longest + 1, 3, LANES)),
    )


def simulate_serial(
    parameters: Array,
    initial: Array,
    offset: Array,
    late: Array,
    forcing: Array,
    steps: Index,
    place: Array,
    constants: Array,
    out: Array,
) -> None:
    """Simulate every parameter row over every window on this core. Nothing is checked.

    Args:
        parameters: (P, 12) rows of `KERNEL_COLUMNS`, physical.
        initial: (P, W, 6) states of the centre of mass at the windows' starts.
        offset: (P, W, 3) left-out wrench, constant in the body's axes: two forces [N], a torque over the lever [N].
        late: (P,) by how much poses come after wrenches [s], beyond what the wrenches were shifted by already.
        forcing: (W, T, 8).
        steps: (W,) of each window, at least one.
        place: (W, N) where each pose lies, in steps.
        constants: (5,).
        out: (P, W, N, 3) poses of the body's frame origin, written.
    """
    rooms = _rooms(parameters.shape[0], forcing.shape[0], forcing.shape[1], 1)
    run_serial(parameters, initial, offset, late, forcing, steps, place, constants, out, *rooms)


def simulate_parallel(
    parameters: Array,
    initial: Array,
    offset: Array,
    late: Array,
    forcing: Array,
    steps: Index,
    place: Array,
    constants: Array,
    out: Array,
) -> None:
    """Do what `simulate_serial` does on all cores; a lane's bytes are its own, so the bytes are the same."""
    rooms = _rooms(parameters.shape[0], forcing.shape[0], forcing.shape[1], numba.get_num_threads())
    run_parallel(parameters, initial, offset, late, forcing, steps, place, constants, out, *rooms)
