"""Compiled: where a base that cannot go sideways should go, so that grippers stay at home, some seconds ahead.

The carried frame (middle of the grippers that work) moves over the floor with a twist that is taken to last. The base
is a unicycle. Sought are its speeds over a horizon such that the carried frame, seen from the base, stays near its
home: nonlinear least squares, a Riccati sweep back and a rollout forward an iteration (iterative LQR, Li and Todorov
2004; with dynamics linear in the error this is Gauss-Newton), warm-started from the tick before.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def carried_frame(grippers: Array) -> tuple[Array, Array, Array]:
    """Return the pose (3,) in the base of the frame that grippers carry, its twist (3,) and its home (3,).

    Its home is the middle of theirs, and it is as far from there as they are from theirs in the mean.

    Args:
        grippers: (n, 3, 3) of each its pose in the base, its home there, and the twist asked of it [m, rad, s].
    """
    count = len(grippers)
    home, away, twist = np.zeros(3), np.zeros(3), np.zeros(3)
    for pose, own, _ in grippers:
        for k in range(3):
            off = pose[k] - own[k]
            if k == 2:
                off = math.pi - (math.pi - off) % (2.0 * math.pi)
            home[k] += own[k] / count
            away[k] += off / count
    carried = home + away
    for pose, _, asked in grippers:
        twist[0] += (asked[0] - asked[2] * (carried[1] - pose[1])) / count
        twist[1] += (asked[1] + asked[2] * (carried[0] - pose[0])) / count
        twist[2] += asked[2] / count
    return carried, twist, home


@njit(cache=True, error_model="numpy")
def steer(
    carried: Array,
    twist: Array,
    home: Array,
    plain: Array,
    ceiling: Array,
    weights: Array,
    step: float,
    plan: Array,
    rounds: int,
) -> float:
    """Improve a plan of base speeds in place; return its cost.

    Args:
        carried: (3,) pose of the carried frame in the base now [m, rad].
        twist: (3,) of it over the floor, at its origin in its own axes, taken to last [m/s, rad/s].
        home: (3,) where it should be in the base.
        plain: (2,) speed and yaw rate of a base that does not steer: what is beyond them costs.
        ceiling: (2,) greatest speed and yaw rate.
        weights: (8,) of errors x, y [1/m^2] and yaw [1/rad^2], of speed, yaw rate, how much more the last counts, the
            yaw [rad] beyond which arms cannot turn a gripper, and how much more it counts there.
        step: of the plan [s].
        plan: (n, 2) speeds and yaw rates, in and out.
        rounds: iterations.
    """
    count = len(plan)
    way = np.empty((count, 3))
    _lay_way(carried, twist, step, way)
    path = np.zeros((count + 1, 3))
    best = _roll(plan, way, home, plain, weights, step, path)
    gains = np.empty((count, 2, 3))
    shifts = np.empty((count, 2))
    trial = np.empty_like(plan)
    trial_path = np.zeros((count + 1, 3))
    damping = 1e-6
    for _ in range(rounds):
        _sweep_back(plan, path, way, home, plain, weights, step, damping, gains, shifts)
        better = False
        share = 1.0
        for _ in range(4):
            _follow(plan, path, gains, shifts, share, ceiling, step, trial, trial_path)
            cost = _roll(trial, way, home, plain, weights, step, trial_path)
            if cost < best:
                better = True
                best = cost
                plan[:] = trial
                path[:] = trial_path
                break
            share *= 0.4
        if not better:
            break
    return best


@njit(**LEAF)
def _lay_way(carried: Array, twist: Array, step: float, way: Array) -> None:
    """Write the poses (n, 3) of the carried frame to come, in axes of the base now: a constant body twist."""
    turn = twist[2] * step
    if abs(turn) < 1e-9:
        dx, dy = twist[0] * step, twist[1] * step
    else:
        s, c = math.sin(turn) / twist[2], (1.0 - math.cos(turn)) / twist[2]
        dx, dy = s * twist[0] - c * twist[1], c * twist[0] + s * twist[1]
    x, y, yaw = carried
    for k in range(len(way)):
        cos, sin = math.cos(yaw), math.sin(yaw)
        x += cos * dx - sin * dy
        y += sin * dx + cos * dy
        yaw += turn
        way[k, 0], way[k, 1], way[k, 2] = x, y, yaw


@njit(**LEAF)
def _step(pose: Array, v: float, w: float, step: float, out: Array) -> None:
    middle = pose[2] + 0.5 * w * step
    out[0] = pose[0] + v * step * math.cos(middle)
    out[1] = pose[1] + v * step * math.sin(middle)
    out[2] = pose[2] + w * step


@njit(**LEAF)
def _roll(plan: Array, way: Array, home: Array, plain: Array, weights: Array, step: float, path: Array) -> float:
    """Write the path of a plan and return its cost."""
    cost = 0.0
    path[0] = 0.0
    for k in range(len(plan)):
        _step(path[k], plan[k, 0], plan[k, 1], step, path[k + 1])
        more = weights[5] if k == len(plan) - 1 else 1.0
        cost += weights[3] * (plan[k, 0] - plain[0]) ** 2 + weights[4] * (plan[k, 1] - plain[1]) ** 2
        dx, dy, yaw = way[k, 0] - path[k + 1, 0], way[k, 1] - path[k + 1, 1], path[k + 1, 2]
        c, s = math.cos(yaw), math.sin(yaw)
        ahead, aside, turned = c * dx + s * dy - home[0], c * dy - s * dx - home[1], way[k, 2] - yaw - home[2]
        beyond = max(abs(turned) - weights[6], 0.0)
        cost += more * (weights[0] * ahead**2 + weights[1] * aside**2)
        cost += more * weights[2] * (turned**2 + weights[7] * beyond**2)
    return cost


@njit(cache=True, error_model="numpy")
def _sweep_back(
    plan: Array,
    path: Array,
    way: Array,
    home: Array,
    plain: Array,
    weights: Array,
    step: float,
    damping: float,
    gains: Array,
    shifts: Array,
) -> None:
    """Write feedback (n, 2, 3) and feedforward (n, 2) of the Riccati recursion along a path."""
    value = np.zeros((3, 3))
    slope = np.zeros(3)
    a = np.eye(3)
    b = np.zeros((3, 2))
    vb, quu, qux, va = np.empty((3, 2)), np.empty((2, 2)), np.empty((2, 3)), np.empty((3, 3))
    for k in range(len(plan) - 1, -1, -1):
        more = weights[5] if k == len(plan) - 1 else 1.0
        dx, dy, yaw = way[k, 0] - path[k + 1, 0], way[k, 1] - path[k + 1, 1], path[k + 1, 2]
        c, s = math.cos(yaw), math.sin(yaw)
        fore, left = c * dx + s * dy, c * dy - s * dx
        # Residuals (ahead, aside, turned) of the carried frame and their derivatives by the base's (x, y, yaw).
        turned = way[k, 2] - yaw - home[2]
        beyond = turned - min(max(turned, -weights[6]), weights[6])
        off = (fore - home[0], left - home[1], turned, beyond)
        slopes = ((-c, -s, left), (s, -c, -fore), (0.0, 0.0, -1.0), (0.0, 0.0, -1.0))
        for row in range(4 if beyond != 0.0 else 3):
            weight = more * (weights[row] if row < 3 else weights[2] * weights[7])
            for i in range(3):
                slope[i] += weight * slopes[row][i] * off[row]
                for j in range(3):
                    value[i, j] += weight * slopes[row][i] * slopes[row][j]
        v, w = plan[k]
        middle = path[k, 2] + 0.5 * w * step
        cos, sin = math.cos(middle), math.sin(middle)
        a[0, 2], a[1, 2] = -v * step * sin, v * step * cos
        b[0, 0], b[1, 0] = step * cos, step * sin
        b[0, 1], b[1, 1], b[2, 1] = -0.5 * v * step**2 * sin, 0.5 * v * step**2 * cos, step
        _multiply(value, b, vb)
        _transposed(b, vb, quu)
        quu[0, 0] += weights[3] + damping
        quu[1, 1] += weights[4] + damping
        qu0 = b[0, 0] * slope[0] + b[1, 0] * slope[1] + weights[3] * (v - plain[0])
        qu1 = b[0, 1] * slope[0] + b[1, 1] * slope[1] + b[2, 1] * slope[2] + weights[4] * (w - plain[1])
        _transposed(vb, a, qux)
        det = quu[0, 0] * quu[1, 1] - quu[0, 1] * quu[1, 0]
        shifts[k, 0] = -(quu[1, 1] * qu0 - quu[0, 1] * qu1) / det
        shifts[k, 1] = -(quu[0, 0] * qu1 - quu[1, 0] * qu0) / det
        for j in range(3):
            gains[k, 0, j] = -(quu[1, 1] * qux[0, j] - quu[0, 1] * qux[1, j]) / det
            gains[k, 1, j] = -(quu[0, 0] * qux[1, j] - quu[1, 0] * qux[0, j]) / det
        slope[2] += a[0, 2] * slope[0] + a[1, 2] * slope[1]
        for j in range(3):
            slope[j] += qux[0, j] * shifts[k, 0] + qux[1, j] * shifts[k, 1]
        _multiply(value, a, va)
        _transposed(a, va, value)
        for i in range(3):
            for j in range(3):
                value[i, j] += qux[0, i] * gains[k, 0, j] + qux[1, i] * gains[k, 1, j]


@njit(cache=True, error_model="numpy", inline="always")
def _multiply(a: Array, b: Array, out: Array) -> None:
    """Write a b; for so small ones a call of BLAS costs more."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            total = 0.0
            for k in range(a.shape[1]):
                total += a[i, k] * b[k, j]
            out[i, j] = total


@njit(cache=True, error_model="numpy", inline="always")
def _transposed(a: Array, b: Array, out: Array) -> None:
    """Write a' b."""
    for i in range(a.shape[1]):
        for j in range(b.shape[1]):
            total = 0.0
            for k in range(a.shape[0]):
                total += a[k, i] * b[k, j]
            out[i, j] = total


@njit(cache=True, error_model="numpy")
def _follow(
    plan: Array,
    path: Array,
    gains: Array,
    shifts: Array,
    share: float,
    ceiling: Array,
    step: float,
    out: Array,
    out_path: Array,
) -> None:
    """Write the plan with its corrections, as far as speeds allow."""
    out_path[0] = 0.0
    for k in range(len(plan)):
        off = out_path[k] - path[k]
        for i in range(2):
            more = share * shifts[k, i]
            for j in range(3):
                more += gains[k, i, j] * off[j]
            out[k, i] = min(max(plan[k, i] + more, -ceiling[i]), ceiling[i])
        _step(out_path[k], out[k, 0], out[k, 1], step, out_path[k + 1])
