"""Compiled: the wrench that each grip has to apply, for many worlds and motions at once.

The same law as `pbrl_control.constraints.wrench.expected_grip_wrench`, which says what it means; tests hold the two to
each other. The least wrench that wheel and joint leave to the grips is a bounded least squares problem in up to four
unknowns: its solution has each unknown at a bound or free, so all such choices are tried.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_model.kernel import GRAVITY

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

REST_SPEED, REST_RATE = 1e-4, 1e-4
"""[m/s, m/s^2] as of `pbrl_control.constraints.wrench`."""
INSIDE = 1e-9
"""Share of a bound by which rounding may overstep it."""
WORK = 17
"""Rows of four that the work space needs."""
SINGULAR = 1e-12
"""Share of a column's squared length that has to be left of it once others are taken off."""


@njit(**LEAF)
def grip_wrenches(
    physics: Array, twist: Array, rate: Array, contacts: Array, torque_arm: float, work: Array, out: Array
) -> None:
    """Write the wrench (n, 3) of each grip: fx, fy [N], tau [N m] on the thing at its contact, in its axes.

    Args:
        physics: (16,) of the world, in the columns of `worlds.PHYSICS`.
        twist: (3,) of the thing's origin in its axes [m/s, rad/s]; one that its constraints allow.
        rate: (3,) how the components of that change [m/s^2, rad/s^2].
        contacts: (n, 2) in the thing's frame [m].
        torque_arm: [m] a grip's torque tau counts as a force tau / torque_arm.
        work: (WORK, 4) work space.
        out: (n, 3)
    """
    mass, spread, com_x, com_y = physics[0], physics[1], physics[2], physics[3]
    weight = mass * GRAVITY
    needed, rows, limits = work[0], work[1:5], work[5]
    vx, vy, omega = twist[0] - twist[2] * com_y, twist[1] + twist[2] * com_x, twist[2]
    ax, ay, alpha = rate[0] - rate[2] * com_y, rate[1] + rate[2] * com_x, rate[2]
    needed[0], needed[1], needed[2] = mass * (ax - omega * vy), mass * (ay + omega * vx), mass * spread * alpha
    size = math.sqrt(vx * vx + vy * vy + spread * omega * omega)
    start = math.sqrt(ax * ax + ay * ay + spread * alpha * alpha)
    feet = physics[4] * weight
    if size > REST_SPEED:
        needed[0] += feet * vx / size
        needed[1] += feet * vy / size
        needed[2] += feet * spread * omega / size
    elif start > REST_RATE:
        needed[0] += feet * ax / start
        needed[1] += feet * ay / start
        needed[2] += feet * spread * alpha / start
    count = 0
    if physics[11] > 0.0:
        lever_x, lever_y = physics[12] - com_x, physics[13] - com_y
        for k in range(int(physics[11])):
            line_x, line_y = physics[14], physics[15]
            if physics[11] == 2.0:
                line_x, line_y = 1.0 - k, 1.0 * k
            rows[count, 0], rows[count, 1], rows[count, 2] = line_x, line_y, line_y * lever_x - line_x * lever_y
            limits[count] = np.inf
            count += 1
    lever_x, lever_y = physics[5] - com_x, physics[6] - com_y
    for k in range(2):
        axis_x = physics[7] if k == 0 else -physics[8]
        axis_y = physics[8] if k == 0 else physics[7]
        arm = axis_y * lever_x - axis_x * lever_y
        limit = physics[9 + k] * weight
        speed = axis_x * vx + axis_y * vy + arm * omega
        change = axis_x * ax + axis_y * ay + arm * alpha
        way = 0.0
        if abs(speed) > REST_SPEED:
            way = math.copysign(1.0, speed)
        elif abs(change) > REST_RATE:
            way = math.copysign(1.0, change)
        if way != 0.0:
            needed[0] += way * limit * axis_x
            needed[1] += way * limit * axis_y
            needed[2] += way * limit * arm
        elif limit > 0.0:
            rows[count, 0], rows[count, 1], rows[count, 2] = axis_x, axis_y, arm
            limits[count] = limit
            count += 1
    share_among(needed, rows, limits, count, contacts, com_x, com_y, torque_arm, work, out)


@njit(**LEAF)
def share_among(
    needed: Array,
    rows: Array,
    limits: Array,
    count: int,
    contacts: Array,
    com_x: float,
    com_y: float,
    torque_arm: float,
    work: Array,
    out: Array,
) -> None:
    """Take off what the reactions can do, and share the rest among the grips by least norm."""
    grips = contacts.shape[0]
    stiff = 1.0 / (torque_arm * torque_arm)
    # K = sum over grips of T W^-1 T', with T = [[1, 0, 0], [0, 1, 0], [-y, x, 1]] and W = diag(1, 1, stiff)
    sx = sy = s2 = 0.0
    for n in range(grips):
        x, y = contacts[n, 0] - com_x, contacts[n, 1] - com_y
        sx += x
        sy += y
        s2 += x * x + y * y + 1.0 / stiff
    compliance = work[6:9, :3]
    invert_sharing(float(grips), sx, sy, s2, compliance)
    total = work[9]
    least_total(needed, rows, limits, count, compliance, work, total)
    fx = compliance[0, 0] * total[0] + compliance[0, 1] * total[1] + compliance[0, 2] * total[2]
    fy = compliance[1, 0] * total[0] + compliance[1, 1] * total[1] + compliance[1, 2] * total[2]
    tau = compliance[2, 0] * total[0] + compliance[2, 1] * total[1] + compliance[2, 2] * total[2]
    for n in range(grips):
        x, y = contacts[n, 0] - com_x, contacts[n, 1] - com_y
        out[n, 0], out[n, 1], out[n, 2] = fx - y * tau, fy + x * tau, tau / stiff


@njit(cache=True, error_model="numpy", inline="always")
def invert_sharing(n: float, sx: float, sy: float, s2: float, out: Array) -> None:
    """Write the inverse (3, 3) of [[n, 0, -sy], [0, n, sx], [-sy, sx, s2]]."""
    left = s2 - (sx * sx + sy * sy) / n
    out[2, 2] = 1.0 / left
    out[0, 2] = out[2, 0] = sy / (n * left)
    out[1, 2] = out[2, 1] = -sx / (n * left)
    out[0, 0] = 1.0 / n + sy * sy / (n * n * left)
    out[1, 1] = 1.0 / n + sx * sx / (n * n * left)
    out[0, 1] = out[1, 0] = -sx * sy / (n * n * left)


@njit(**LEAF)
def least_total(needed: Array, rows: Array, limits: Array, count: int, metric: Array, work: Array, out: Array) -> None:
    """Write the total (3,) = needed - sum z_k rows_k, |z_k| <= limits_k, with the least total.metric.total."""
    for i in range(3):
        out[i] = needed[i]
    if count == 0:
        return
    best = np.inf
    choices = 1
    for _ in range(count):
        choices *= 3
    trial, values, free = work[10], work[11], work[12]
    for choice in range(choices):
        code, frees, possible = choice, 0, True
        for i in range(3):
            trial[i] = needed[i]
        for k in range(count):
            side = code % 3
            code //= 3
            if side == 0:
                free[frees] = k
                frees += 1
            elif np.isinf(limits[k]):
                possible = False
            else:
                values[k] = limits[k] if side == 1 else -limits[k]
                for i in range(3):
                    trial[i] -= values[k] * rows[k, i]
        if not possible or frees > 3:
            continue
        if not project_off(trial, rows, free, frees, metric, work):
            continue
        kept = True
        for n in range(frees):
            k = int(free[n])
            kept = kept and abs(work[13, n]) <= limits[k] * (1.0 + INSIDE)
        if kept:
            size = 0.0
            for i in range(3):
                for j in range(3):
                    size += trial[i] * metric[i, j] * trial[j]
            if size < best:
                best = size
                for i in range(3):
                    out[i] = trial[i]


@njit(**LEAF)
def project_off(trial: Array, rows: Array, free: Array, frees: int, metric: Array, work: Array) -> bool:
    """Take off `trial` (3,) what some rows can do without bounds; their shares go to work[13]. False: they depend."""
    for n in range(frees):  # normal equations, by Gauss's elimination of a matrix that is symmetric and positive
        for m in range(frees + 1):
            total = 0.0
            for i in range(3):
                for j in range(3):
                    other = trial[j] if m == frees else rows[int(free[m]), j]
                    total += rows[int(free[n]), i] * metric[i, j] * other
            work[14 + n, m] = total
    for n in range(frees):
        size = work[14 + n, n]
        for m in range(n):
            factor = work[14 + n, m] / work[14 + m, m]
            for k in range(m, frees + 1):
                work[14 + n, k] -= factor * work[14 + m, k]
        if not work[14 + n, n] > SINGULAR * size:
            return False
    for n in range(frees - 1, -1, -1):
        total = work[14 + n, frees]
        for m in range(n + 1, frees):
            total -= work[14 + n, m] * work[13, m]
        work[13, n] = total / work[14 + n, n]
    for n in range(frees):
        for i in range(3):
            trial[i] -= work[13, n] * rows[int(free[n]), i]
    return True
