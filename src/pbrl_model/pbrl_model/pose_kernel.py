"""Compiled: simulated poses at recorded times, each (parameter row, window) with its own start and left-out wrench.

`rollout` shares one start and one wrench among all parameter rows and returns every step. The likelihood needs the
opposite: nuisances of every row's own, and only the few steps at which a pose was recorded.

`forcing` (T, 8) is what acts in a window: the wrench in world axes, its change in time, cosine and sine of the recorded
heading. `constants` (5,) are inertia over mass [m^2], the centre of mass in the body's frame [m, m], dt [s] and the
lever that turns a force scale into a torque scale [m].
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from pbrl_model.kernel import integrate

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@njit(cache=True, error_model="numpy")
def simulate_window(
    parameters: Array,
    start: Array,
    offset: Array,
    late: float,
    forcing: Array,
    steps: int,
    place: Array,
    constants: Array,
    force: Array,
    path: Array,
    out: Array,
) -> None:
    """Simulate one window and write its poses at the recorded times into `out` (N, 3).

    Args:
        parameters: (12,).
        start: (6,) state of the centre of mass.
        offset: (3,) left-out wrench, constant in the body's axes: two forces [N], a torque over the lever [N].
        late: by how much poses come after wrenches [s], beyond what the wrenches were shifted by already.
        forcing: (T, 8).
        steps: of the window.
        place: (N,) where each pose lies, in steps.
        constants: (5,).
        force: (>= T, 3) scratch.
        path: (>= T + 1, 3) scratch.
        out: (N, 3), written.
    """
    inertia_per_mass, com_x, com_y, dt, lever = constants[0], constants[1], constants[2], constants[3], constants[4]
    for t in range(steps):
        c, s = forcing[t, 6], forcing[t, 7]
        force[t, 0] = forcing[t, 0] - late * forcing[t, 3] + c * offset[0] - s * offset[1]
        force[t, 1] = forcing[t, 1] - late * forcing[t, 4] + s * offset[0] + c * offset[1]
        force[t, 2] = forcing[t, 2] - late * forcing[t, 5] + lever * offset[2]
    integrate(parameters, start, force, steps, inertia_per_mass, com_x, com_y, com_x, com_y, dt, False, path)
    for n in range(place.shape[0]):
        before = min(int(place[n]), steps - 1)
        share = place[n] - before
        for k in range(3):
            out[n, k] = path[before, k] + share * (path[before + 1, k] - path[before, k])


@njit(cache=True, error_model="numpy")
def simulate_row(
    parameters: Array,
    initial: Array,
    offset: Array,
    late: float,
    forcing: Array,
    steps: Index,
    place: Array,
    constants: Array,
    out: Array,
) -> None:
    """Simulate one parameter row over every window, each from its start (W, 6) with its offset (W, 3)."""
    longest = forcing.shape[1]
    force, path = np.empty((longest, 3)), np.empty((longest + 1, 3))
    for w in range(forcing.shape[0]):
        simulate_window(
            parameters, initial[w], offset[w], late, forcing[w], steps[w], place[w], constants, force, path, out[w]
        )


@njit(cache=True, error_model="numpy")
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
    """Simulate every parameter row over every window on this core.

    Args:
        parameters: (P, 12) rows of `KERNEL_COLUMNS`, physical.
        initial: (P, W, 6) states of the centre of mass at the windows' starts.
        offset: (P, W, 3) see `simulate_window`.
        late: (P,) see `simulate_window`.
        forcing: (W, T, 8).
        steps: (W,).
        place: (W, N).
        constants: (5,).
        out: (P, W, N, 3) poses of the body's frame origin, written.
    """
    for p in range(parameters.shape[0]):
        simulate_row(parameters[p], initial[p], offset[p], late[p], forcing, steps, place, constants, out[p])


@njit(cache=True, error_model="numpy", parallel=True)
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
    """Do what `simulate_serial` does on all cores; each row is its own work, so the bytes are the same."""
    for p in prange(parameters.shape[0]):
        simulate_row(parameters[p], initial[p], offset[p], late[p], forcing, steps, place, constants, out[p])
