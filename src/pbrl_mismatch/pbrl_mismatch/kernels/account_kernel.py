"""Compiled: the account that laws write into.

A law adds to an account `acc` (9,): force and torque (0..2) at the centre of mass in world axes, and the upper
triangle xx, xy, yy, xt, yt, tt (3..8) of a matrix D of resistances, so that the wrench is acc[:3] - D (vx, vy, omega).
Resistances are solved for implicitly, which keeps stiff springs and dry friction steady at any step: a spring adds
its stiffness times dt, dry friction what `friction_kernel` says.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]

CREEP = 1e-3
"""Dry friction is viscous below this sliding speed [m/s]."""
SETTLING = 0.02
"""Time in which a contact's or a cord's oscillation is damped [s]: damping over stiffness."""


@njit(**LEAF, forceinline=True)
def push(acc: Array, rx: float, ry: float, fx: float, fy: float) -> None:
    """Add a force (fx, fy) [N] at the lever (rx, ry) [m]."""
    acc[0] += fx
    acc[1] += fy
    acc[2] += rx * fy - ry * fx


@njit(**LEAF, forceinline=True)
def resist(acc: Array, rx: float, ry: float, nx: float, ny: float, k: float) -> None:
    """Add a resistance k [N s/m] to the motion of the lever's end along the direction (nx, ny)."""
    lever = rx * ny - ry * nx
    acc[3] += k * nx * nx
    acc[4] += k * nx * ny
    acc[5] += k * ny * ny
    acc[6] += k * nx * lever
    acc[7] += k * ny * lever
    acc[8] += k * lever * lever
