"""Compiled: simulated poses at recorded times, each (parameter row, window) with its own start and left-out wrench.

`rollout` shares one start and one wrench among all parameter rows and returns every step. The likelihood needs the
opposite: nuisances of every row's own, and only the few steps at which a pose was recorded.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from pbrl_model.kernel import integrate

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@njit(cache=True, error_model="numpy")
def simulate_window(
    parameters: Array,
    initial: Array,
    offset: Array,
    heading: Array,
    wrench: Array,
    steps: Index,
    step: Index,
    fraction: Array,
    inertia_per_mass: float,
    com: Array,
    dt: float,
    index: int,
    out: Array,
) -> None:
    """Simulate pair number `index` of (parameter row, window); arguments as of `simulate_serial`."""
    windows, longest = wrench.shape[0], wrench.shape[1]
    p, w = index // windows, index % windows
    force = np.empty((longest, 3))
    for t in range(steps[w]):
        c, s = math.cos(heading[w, t]), math.sin(heading[w, t])
        force[t, 0] = wrench[w, t, 0] + c * offset[p, w, 0] - s * offset[p, w, 1]
        force[t, 1] = wrench[w, t, 1] + s * offset[p, w, 0] + c * offset[p, w, 1]
        force[t, 2] = wrench[w, t, 2] + offset[p, w, 2]
    path = np.empty((longest + 1, 3))
    integrate(parameters[p], initial[p, w], force, steps[w], inertia_per_mass, com[0], com[1], com[0], com[1], dt, path)
    for n in range(step.shape[1]):
        before, share = step[w, n], fraction[w, n]
        for k in range(3):
            out[p, w, n, k] = path[before, k] + share * (path[before + 1, k] - path[before, k])


@njit(cache=True, error_model="numpy")
def simulate_serial(
    parameters: Array,
    initial: Array,
    offset: Array,
    heading: Array,
    wrench: Array,
    steps: Index,
    step: Index,
    fraction: Array,
    inertia_per_mass: float,
    com: Array,
    dt: float,
    out: Array,
) -> None:
    """Simulate every parameter row over every window on this core.

    Args:
        parameters: (P, 12) rows of `KERNEL_COLUMNS`, physical.
        initial: (P, W, 6) states of the centre of mass at the windows' starts.
        offset: (P, W, 3) wrench added in each window, constant in the body's axes [N, N, N m].
        heading: (W, T) that turns those axes into the world's at each step [rad].
        wrench: (W, T, 3) at the centre of mass, world axes.
        steps: (W,) steps of each window.
        step: (W, N) grid step at or before each recorded pose.
        fraction: (W, N) how far the pose lies towards the next step.
        inertia_per_mass: [m^2].
        com: (2,) centre of mass in the body's frame [m].
        dt: [s].
        out: (P, W, N, 3) poses of the body's frame origin, written.
    """
    for index in range(parameters.shape[0] * wrench.shape[0]):
        simulate_window(
            parameters,
            initial,
            offset,
            heading,
            wrench,
            steps,
            step,
            fraction,
            inertia_per_mass,
            com,
            dt,
            index,
            out,
        )


@njit(cache=True, error_model="numpy", parallel=True)
def simulate_parallel(
    parameters: Array,
    initial: Array,
    offset: Array,
    heading: Array,
    wrench: Array,
    steps: Index,
    step: Index,
    fraction: Array,
    inertia_per_mass: float,
    com: Array,
    dt: float,
    out: Array,
) -> None:
    """Do what `simulate_serial` does on all cores; each pair is its own work, so the bytes are the same."""
    for index in prange(parameters.shape[0] * wrench.shape[0]):
        simulate_window(
            parameters,
            initial,
            offset,
            heading,
            wrench,
            steps,
            step,
            fraction,
            inertia_per_mass,
            com,
            dt,
            index,
            out,
        )
