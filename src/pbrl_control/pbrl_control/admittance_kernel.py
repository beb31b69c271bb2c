"""Compiled: what a grip feels, how it gives way to that, and what it is to do in a tick."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]

LAW = 7
"""Numbers of an axis's law: damping, centring, forget, yielding, leak, dead band, greatest speed."""


@njit(cache=True, error_model="numpy")
def held_task(
    rotation: Array,
    yaw: float,
    approach: Array,
    grip: float,
    raw: Array,
    bias: Array,
    twist: Array,
    contact: Array,
    object_yaw: float,
    expected: Array,
    firm: bool,
    laws: Array,
    memory: Array,
    gains: Array,
    above: float,
    share: float,
    dt: float,
    wanted: Array,
    added: Array,
    against: Array,
) -> float:
    """Write what a gripper that holds something is to do over the floor, in base axes; return its new share.

    Args:
        rotation: (3, 3) of `<side>_ft` in the base.
        yaw: of the approach direction there [rad].
        approach: (3,) that direction in `<side>_ft`.
        grip: way from the sensor to the middle of the plates [m].
        raw: (6,) of the sensor; a number that is not finite: nothing is felt.
        bias: (6,) of it.
        twist: (3,) asked of the object's origin in its axes.
        contact: (2,) of the grip in them [m].
        object_yaw: of the object in the gripper's planar axes [rad].
        expected: (3,) wrench that moving the object takes of this grip, object axes; zeros where nobody knows.
        firm: whether it is known.
        laws: (2, 4, LAW) of the soft and the firm axes: along, left, about the vertical, up.
        memory: (2, 4, 2) in and out: of each its slow part, and what it gave way.
        gains: (5,) of levelling and height [1/s]; greatest horizontal force [N], how fast the share goes down at twice
            that force and comes back [1/s].
        above: height to be gained [m].
        share: of its speed that the gripper may go against the force that it feels.
        dt: since the last tick [s].
        wanted: (3,) out: planar twist asked of the plates.
        added: (6,) out: twist on top of it.
        against: (2,) out: unit vector against the horizontal force, zero where there is none.
    """
    held = yaw + object_yaw
    _turn(twist[0] - twist[2] * contact[1], twist[1] + twist[2] * contact[0], held, wanted)
    wanted[2] = twist[2]
    felt, bare = np.empty(4), np.zeros(6)
    if np.isfinite(raw).all():
        bare[:] = raw - bias
    wrench_at_plates(rotation, yaw, approach, grip, bare, felt)
    _turn(-felt[0], -felt[1], yaw, against)
    strong = math.hypot(felt[0], felt[1])
    if strong > 0.0:
        against /= strong
    beyond = strong / gains[2] - 1.0
    share += dt * (-gains[3] * beyond if beyond > 0.0 else gains[4])
    # The object pushes back with what moving it takes; only to the rest is yielded, and that firmly.
    rest = np.empty(2)
    _turn(expected[0], expected[1], object_yaw, rest)
    felt[0] += rest[0]
    felt[1] += rest[1]
    felt[2] += expected[2]
    way = np.empty(4)
    for k in range(4):
        way[k] = axis_velocity(laws[int(firm), k], memory[int(firm), k], felt[k], dt)
    _turn(way[0], way[1], yaw, added)
    added[2] = way[3] + gains[1] * above
    # Level: z of the sensor x (0, 0, 1).
    added[3], added[4] = gains[0] * rotation[1, 2], -gains[0] * rotation[0, 2]
    added[5] = way[2]
    return min(max(share, 0.0), 1.0)


@njit(cache=True, error_model="numpy")
def wrench_at_plates(rotation: Array, yaw: float, approach: Array, grip: float, wrench: Array, out: Array) -> None:
    """Write (f_along, f_left, tau_up, f_up) at the middle of the plates, planar axes, of a wrench at the sensor.

    Args:
        rotation: (3, 3) of `<side>_ft` in the base.
        yaw: of the approach direction there [rad].
        approach: (3,) that direction in `<side>_ft`.
        grip: way from the sensor to the middle of the plates [m].
        wrench: (6,) force, torque in `<side>_ft` [N, N m].
        out: (4,).
    """
    lever, force, torque = np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(3):
        for j in range(3):
            lever[i] += grip * rotation[i, j] * approach[j]
            force[i] += rotation[i, j] * wrench[j]
            torque[i] += rotation[i, j] * wrench[3 + j]
    _turn(force[0], force[1], -yaw, out)
    out[2] = torque[2] - (lever[0] * force[1] - lever[1] * force[0])
    out[3] = force[2]


@njit(**LEAF)
def axis_velocity(law: Array, memory: Array, force: float, dt: float) -> float:
    """Return the velocity [m/s or rad/s] of an axis that yields to a force; it comes back by and by from where it gave.

    What is come back from is what this axis gave way itself, not how far the gripper is from some place: base and
    arms may carry it wherever the task is, and the compliance neither knows nor resists.

    Args:
        law: (LAW,); an infinite `forget`: nothing is forgotten, an infinite `yielding`: no slow part.
        memory: (2,) in and out: slow part [m/s or rad/s], what it gave way [m or rad].
        force: of the object on the gripper [N or N m].
        dt: since the last step [s].
    """
    damping, centring, forget, yielding, leak, dead_band, most = law
    fast = math.copysign(max(abs(force) - dead_band, 0.0), force) / damping
    memory[0] += dt * (fast / yielding - memory[0] / leak)
    velocity = min(max(fast + memory[0] - centring * memory[1], -most), most)
    memory[1] += dt * (velocity - memory[1] / forget)
    return velocity


@njit(cache=True, error_model="numpy", inline="always")
def _turn(x: float, y: float, theta: float, out: Array) -> None:
    """Write (2,) a vector of axes that are turned by theta, in axes that are not."""
    c, s = math.cos(theta), math.sin(theta)
    out[0] = c * x - s * y
    out[1] = s * x + c * y
