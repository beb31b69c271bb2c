"""Compiled: where a footprint meets a disc or a square, what holds it there or at a pivot, and what it pushes along."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_mismatch.kernels import places as at
from pbrl_mismatch.kernels.account_kernel import push, resist
from pbrl_mismatch.kernels.crate_kernel import ROUND, crate_contact
from pbrl_mismatch.kernels.outline_kernel import disc_contact
from pbrl_mismatch.kernels.post_kernel import lean, post_contact

Array = NDArray[np.float64]


@njit(**LEAF, forceinline=True)
def contacts(
    p: Array,
    state: Array,
    c: float,
    s: float,
    mass: float,
    inertia: float,
    com: Array,
    pivot: Array,
    outline: Array,
    dt: float,
    damped: float,
    acc: Array,
) -> None:
    """Add what is too stiff to be seen in a pose, pivots and contacts; for what is not named see `laws_kernel.springs`.

    Args:
        p: see `laws_kernel.springs`.
        state: see `laws_kernel.springs`.
        c: see `laws_kernel.springs`.
        s: see `laws_kernel.springs`.
        mass: see `laws_kernel.springs`.
        inertia: about the centre of mass [kg m^2] now.
        com: see `laws_kernel.springs`.
        pivot: (3,) pose of the body's frame, as tags see it, in which a hidden hinge is at rest, but for what it is
            told to be off.
        outline: (E, 2) footprint, counter-clockwise.
        dt: in which they answer [s].
        damped: `crate_kernel.CRUSHING`, or `LEANING` along a recorded path [s].
        acc: (9,) account.
    """
    if p[at.PIVOT_STIFFNESS] > 0.0:
        # Where the pinned point is in the body, from a pose that tags saw.
        k, turn = p[at.PIVOT_STIFFNESS], pivot[2] - p[at.TAG_THETA]
        c0, s0 = math.cos(turn), math.sin(turn)
        dx, dy = p[at.PIVOT_X] - pivot[0], p[at.PIVOT_Y] - pivot[1]
        ax = c0 * dx + s0 * dy + p[at.TAG_X] + p[at.PIVOT_OFF_X] - com[0]
        ay = -s0 * dx + c0 * dy + p[at.TAG_Y] + p[at.PIVOT_OFF_Y] - com[1]
        rx, ry = c * ax - s * ay, s * ax + c * ay
        push(acc, rx, ry, k * (p[at.PIVOT_X] - state[0] - rx), k * (p[at.PIVOT_Y] - state[1] - ry))
        give = k * dt + 2.0 * p[at.PIVOT_DAMPING] * math.sqrt(k * mass)
        resist(acc, rx, ry, 1.0, 0.0, give)
        resist(acc, rx, ry, 0.0, 1.0, give)
    if p[at.OBSTACLE_STIFFNESS] > 0.0 and p[at.OBSTACLE_ANGLE] > ROUND:
        post_contact(p, outline, state, c, s, com, dt, acc)
    elif p[at.OBSTACLE_STIFFNESS] > 0.0:
        found = disc_contact(outline, state, c, s, com, p[at.OBSTACLE_X], p[at.OBSTACLE_Y], p[at.OBSTACLE_RADIUS])
        depth, rx, ry, nx, ny = found
        if depth > 0.0:
            lean(p, state, rx, ry, nx, ny, depth, dt, acc)
    if p[at.UNSEEN_FORCE] > 0.0:
        crate_contact(p, outline, state, c, s, mass, inertia, com, dt, damped, acc)
