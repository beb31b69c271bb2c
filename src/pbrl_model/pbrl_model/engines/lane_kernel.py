"""One step of many bodies at once: a lane for each, written such that the compiler makes it vector instructions.

The step is that of `kernel.py`. Everything a lane needs lies in one flat array, quantity by quantity, `LANES` numbers
each: `lanes[VX + i]` is the velocity of lane `i`. All offsets are constants of the program, so that the compiler can
prove that no two quantities overlap; loops over lanes have no branch, only choices between two numbers that were both
worked out. No operation is reordered or fused for speed, hence a lane's bytes are the same whichever lanes are beside
it.

Lanes of one group are of one kind, for a kind is a loop of its own: `FREE`, `WHEEL`, `ROD` (a distance joint, with or
without a wheel), `PIVOT` (a joint of length zero, with or without a wheel).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_model.kernel import (
    ANCHOR_X,
    ANCHOR_Y,
    ERROR_BIAS,
    GRAVITY,
    HINGE_RADIUS,
    HINGE_X,
    HINGE_Y,
    MASS,
    MIN_DISTANCE,
    MU_GROUND,
    MU_X,
    MU_Y,
    SINGULAR,
    WHEEL_THETA,
    WHEEL_X,
    WHEEL_Y,
    box_impulses,
    clamp,
    cos_sin,
)

Array = NDArray[np.float64]

LANES = 16  # two vectors of the widest kind: one hides the other's waiting
FULL = 8  # lanes that are worked on at once
FREE, WHEEL, ROD, PIVOT = range(4)

# What a lane consists of: its state and the cosine and sine of its heading; ...
X, Y, THETA, VX, VY, OMEGA, C, S = (LANES * k for k in range(8))
# ... what pushes it in this step; ...
FX, FY, TAU = (LANES * k for k in range(8, 11))
# ... its body: one over mass and inertia, friction on the floor, the written point; ...
INVERSE_MASS, INVERSE_INERTIA, INERTIA_PER_MASS, GROUND, ORIGIN_X, ORIGIN_Y = (LANES * k for k in range(11, 17))
# ... its wheel: axis, levers, what impulses do to velocities, limits, and what of it can be worked out beforehand; ...
WHEEL_C, WHEEL_S, LEVER_0, LEVER_1, A00, A01, A11, LIMIT_0, LIMIT_1 = (LANES * k for k in range(17, 26))
STICK_0, STICK_1, SLIDE_0, SLIDE_1, REACH = (LANES * k for k in range(26, 31))
# ... its joint: hinge, anchor, length; ...
PIN_X, PIN_Y, ARM_X, ARM_Y, LENGTH = (LANES * k for k in range(31, 36))
# ... and the pose that is written.
OUT_X, OUT_Y = (LANES * k for k in range(36, 38))
SIZE = 38 * LANES
"""Length of the array that holds all lanes."""


@njit(**LEAF)
def kind_of(parameters: Array) -> int:
    """Return which loop a (12,) row of `KERNEL_COLUMNS` needs."""
    radius = parameters[HINGE_RADIUS]
    if not math.isnan(radius):
        return ROD if radius > 0.0 else PIVOT
    return WHEEL if parameters[MU_X] > 0.0 or parameters[MU_Y] > 0.0 else FREE


@njit(**LEAF)
def load_lane(
    lanes: Array,
    i: int,
    parameters: Array,
    initial: Array,
    inertia_per_mass: float,
    com_x: float,
    com_y: float,
    of_com: bool,
    dt: float,
) -> None:
    """Put one body into lane `i`.

    Args:
        lanes: (SIZE,) written.
        i: which lane.
        parameters: (12,) row of `KERNEL_COLUMNS`.
        initial: (6,) state of the centre of mass.
        inertia_per_mass: [m^2].
        com_x: centre of mass in the body's frame [m].
        com_y: as `com_x`.
        of_com: whether poses are written of the centre of mass, not of the frame's origin.
        dt: [s].
    """
    inverse_mass = 1.0 / parameters[MASS]
    inverse_inertia = inverse_mass / inertia_per_mass
    for k in range(6):
        lanes[k * LANES + i] = initial[k]
    lanes[C + i], lanes[S + i] = cos_sin(initial[2])
    lanes[INVERSE_MASS + i], lanes[INVERSE_INERTIA + i] = inverse_mass, inverse_inertia
    lanes[INERTIA_PER_MASS + i], lanes[GROUND + i] = inertia_per_mass, parameters[MU_GROUND] * GRAVITY * dt
    lanes[ORIGIN_X + i], lanes[ORIGIN_Y + i] = (0.0, 0.0) if of_com else (com_x, com_y)
    # The wheel's rows seen from the body never change: unit vectors, their levers about the centre of
    # mass, and therefore what an impulse along one row does to the velocity along the other.
    x, y = parameters[WHEEL_X] - com_x, parameters[WHEEL_Y] - com_y
    c, s = math.cos(parameters[WHEEL_THETA]), math.sin(parameters[WHEEL_THETA])
    lever0, lever1 = x * s - y * c, x * c + y * s
    a00 = inverse_mass + lever0 * lever0 * inverse_inertia
    a01 = lever0 * lever1 * inverse_inertia
    a11 = inverse_mass + lever1 * lever1 * inverse_inertia
    limit = parameters[MASS] * GRAVITY * dt
    lanes[WHEEL_C + i], lanes[WHEEL_S + i] = c, s
    lanes[LEVER_0 + i], lanes[LEVER_1 + i] = lever0, lever1
    lanes[A00 + i], lanes[A01 + i], lanes[A11 + i] = a00, a01, a11
    lanes[LIMIT_0 + i], lanes[LIMIT_1 + i] = parameters[MU_X] * limit, parameters[MU_Y] * limit
    # No division is left for the steps of a body with a wheel alone; see `kernel.box_impulses`.
    determinant = a00 * a11 - a01 * a01
    lanes[STICK_0 + i], lanes[STICK_1 + i] = a11 / determinant, -a01 / determinant
    lanes[SLIDE_0 + i], lanes[SLIDE_1 + i] = 1.0 / a00, 1.0 / a11
    lanes[REACH + i] = abs(a01) * lanes[LIMIT_1 + i] / a00
    lanes[PIN_X + i], lanes[PIN_Y + i] = parameters[HINGE_X], parameters[HINGE_Y]
    lanes[ARM_X + i], lanes[ARM_Y + i] = parameters[ANCHOR_X] - com_x, parameters[ANCHOR_Y] - com_y
    lanes[LENGTH + i] = parameters[HINGE_RADIUS]


@njit(**LEAF)
def fill_up(lanes: Array, count: int) -> int:
    """Copy the last of `count` lanes until whole vectors are full; return how many there are then."""
    full = (count + FULL - 1) // FULL * FULL
    for quantity in range(0, SIZE, LANES):
        for i in range(count, full):
            lanes[quantity + i] = lanes[quantity + count - 1]
    return full


@njit(**LEAF)
def place_lanes(lanes: Array, count: int) -> None:
    """Work out the poses that are written."""
    for i in range(count):
        c, s, x, y = lanes[C + i], lanes[S + i], lanes[ORIGIN_X + i], lanes[ORIGIN_Y + i]
        lanes[OUT_X + i] = lanes[X + i] - c * x + s * y
        lanes[OUT_Y + i] = lanes[Y + i] - s * x - c * y


@njit(**LEAF)
def joint_correction(dt: float) -> float:
    """Return the share of a joint's error that goes in a step, over the step [1/s]: Chipmunk's Baumgarte term."""
    return (1.0 - ERROR_BIAS**dt) / dt


@njit(**LEAF)
def step_lanes(
    lanes: Array, count: int, kind: int, slides: bool, body_wrench: bool, dt: float, correction: float
) -> None:
    """Advance `count` lanes of one kind by a step, pushed by what FX, FY and TAU hold.

    Args:
        lanes: (SIZE,).
        count: lanes.
        kind: `FREE`, `WHEEL`, `ROD` or `PIVOT`.
        slides: whether any of them has friction on the floor.
        body_wrench: whether FX, FY are in the body's axes, at the heading that the step leads to.
        dt: [s].
        correction: of `joint_correction` [1/s].
    """
    advance_lanes(lanes, count, dt)
    if body_wrench:
        turn_pushes(lanes, count)
    push_lanes(lanes, count, dt)
    if kind == WHEEL:
        wheel_lanes(lanes, count)
    elif kind == ROD:
        rod_lanes(lanes, count, correction)
    elif kind == PIVOT:
        pivot_lanes(lanes, count, correction)
    if slides:
        slow_lanes(lanes, count)


@njit(**LEAF)
def advance_lanes(lanes: Array, count: int, dt: float) -> None:
    """Advance poses with the velocities of the step before."""
    for i in range(count):
        lanes[X + i] += lanes[VX + i] * dt
        lanes[Y + i] += lanes[VY + i] * dt
        theta = lanes[THETA + i] + lanes[OMEGA + i] * dt
        lanes[THETA + i] = theta
        lanes[C + i], lanes[S + i] = cos_sin(theta)


@njit(**LEAF)
def turn_pushes(lanes: Array, count: int) -> None:
    """Turn forces from the bodies' axes into the world's."""
    for i in range(count):
        c, s, fx, fy = lanes[C + i], lanes[S + i], lanes[FX + i], lanes[FY + i]
        lanes[FX + i], lanes[FY + i] = c * fx - s * fy, s * fx + c * fy


@njit(**LEAF)
def push_lanes(lanes: Array, count: int, dt: float) -> None:
    """Let forces and torques change velocities."""
    for i in range(count):
        lanes[VX + i] += lanes[FX + i] * lanes[INVERSE_MASS + i] * dt
        lanes[VY + i] += lanes[FY + i] * lanes[INVERSE_MASS + i] * dt
        lanes[OMEGA + i] += lanes[TAU + i] * lanes[INVERSE_INERTIA + i] * dt


@njit(**LEAF)
def wheel_lanes(lanes: Array, count: int) -> None:
    """Let wheels hold or slip: `kernel.box_impulses` with all divisions done beforehand."""
    for i in range(count):
        c, s, wheel_c, wheel_s = lanes[C + i], lanes[S + i], lanes[WHEEL_C + i], lanes[WHEEL_S + i]
        ex, ey = c * wheel_c - s * wheel_s, s * wheel_c + c * wheel_s
        vx, vy, omega = lanes[VX + i], lanes[VY + i], lanes[OMEGA + i]
        lever0, lever1 = lanes[LEVER_0 + i], lanes[LEVER_1 + i]
        slip0 = ex * vx + ey * vy + lever0 * omega
        slip1 = ex * vy - ey * vx + lever1 * omega
        stick = -(lanes[STICK_0 + i] * slip0 + lanes[STICK_1 + i] * slip1)
        slide, reach = -(slip0 * lanes[SLIDE_0 + i]), lanes[REACH + i]
        p0 = clamp(min(max(stick, slide - reach), slide + reach), lanes[LIMIT_0 + i])
        p1 = clamp(-(slip1 + lanes[A01 + i] * p0) * lanes[SLIDE_1 + i], lanes[LIMIT_1 + i])
        lanes[VX + i] = vx + (ex * p0 - ey * p1) * lanes[INVERSE_MASS + i]
        lanes[VY + i] = vy + (ey * p0 + ex * p1) * lanes[INVERSE_MASS + i]
        lanes[OMEGA + i] = omega + (lever0 * p0 + lever1 * p1) * lanes[INVERSE_INERTIA + i]


@njit(**LEAF)
def rod_lanes(lanes: Array, count: int, correction: float) -> None:
    """Let joints of a length act, then wheels seen through them: a joint is unlimited.

    The joint's row is (d, r x d) with d from hinge to anchor, not divided by the distance: rows may have any length.
    """
    for i in range(count):
        inverse_mass, inverse_inertia = lanes[INVERSE_MASS + i], lanes[INVERSE_INERTIA + i]
        c, s, arm_x, arm_y = lanes[C + i], lanes[S + i], lanes[ARM_X + i], lanes[ARM_Y + i]
        rx, ry = c * arm_x - s * arm_y, s * arm_x + c * arm_y
        dx, dy = lanes[X + i] + rx - lanes[PIN_X + i], lanes[Y + i] + ry - lanes[PIN_Y + i]
        square = dx * dx + dy * dy
        lever = rx * dy - ry * dx
        stiff = 1.0 / (inverse_mass * square + lever * lever * inverse_inertia)
        h = stiff if square >= MIN_DISTANCE * MIN_DISTANCE else 0.0
        error = square - lanes[LENGTH + i] * math.sqrt(square)
        vx, vy, omega = lanes[VX + i], lanes[VY + i], lanes[OMEGA + i]
        j = -h * (dx * vx + dy * vy + lever * omega + correction * error)
        vx += dx * j * inverse_mass
        vy += dy * j * inverse_mass
        omega += lever * j * inverse_inertia

        wheel_c, wheel_s = lanes[WHEEL_C + i], lanes[WHEEL_S + i]
        ex, ey = c * wheel_c - s * wheel_s, s * wheel_c + c * wheel_s
        lever0, lever1 = lanes[LEVER_0 + i], lanes[LEVER_1 + i]
        q0 = (dx * ex + dy * ey) * inverse_mass + lever * lever0 * inverse_inertia
        q1 = (dy * ex - dx * ey) * inverse_mass + lever * lever1 * inverse_inertia
        g0, g1 = -h * q0, -h * q1  # impulse along the joint that answers one along each of the wheel's rows
        k00 = max(lanes[A00 + i] + q0 * g0, SINGULAR * lanes[A00 + i])
        k11 = max(lanes[A11 + i] + q1 * g1, SINGULAR * lanes[A11 + i])
        slip0 = ex * vx + ey * vy + lever0 * omega
        slip1 = ex * vy - ey * vx + lever1 * omega
        p0, p1 = box_impulses(k00, lanes[A01 + i] + q0 * g1, k11, slip0, slip1, lanes[LIMIT_0 + i], lanes[LIMIT_1 + i])
        j = g0 * p0 + g1 * p1
        lanes[VX + i] = vx + (ex * p0 - ey * p1 + dx * j) * inverse_mass
        lanes[VY + i] = vy + (ey * p0 + ex * p1 + dy * j) * inverse_mass
        lanes[OMEGA + i] = omega + (lever0 * p0 + lever1 * p1 + lever * j) * inverse_inertia


@njit(**LEAF)
def pivot_lanes(lanes: Array, count: int, correction: float) -> None:
    """Let joints of length zero act, as two rows along the world's axes, then wheels seen through them."""
    for i in range(count):
        inverse_mass, inverse_inertia = lanes[INVERSE_MASS + i], lanes[INVERSE_INERTIA + i]
        c, s, arm_x, arm_y = lanes[C + i], lanes[S + i], lanes[ARM_X + i], lanes[ARM_Y + i]
        rx, ry = c * arm_x - s * arm_y, s * arm_x + c * arm_y
        dx, dy = lanes[X + i] + rx - lanes[PIN_X + i], lanes[Y + i] + ry - lanes[PIN_Y + i]
        k00 = inverse_mass + ry * ry * inverse_inertia
        k01 = -rx * ry * inverse_inertia
        k11 = inverse_mass + rx * rx * inverse_inertia
        scale = 1.0 / (k00 * k11 - k01 * k01)
        h00, h01, h11 = k11 * scale, -k01 * scale, k00 * scale
        vx, vy, omega = lanes[VX + i], lanes[VY + i], lanes[OMEGA + i]
        u0 = vx - ry * omega + correction * dx
        u1 = vy + rx * omega + correction * dy
        j0, j1 = -h00 * u0 - h01 * u1, -h01 * u0 - h11 * u1
        vx += j0 * inverse_mass
        vy += j1 * inverse_mass
        omega += (rx * j1 - ry * j0) * inverse_inertia

        wheel_c, wheel_s = lanes[WHEEL_C + i], lanes[WHEEL_S + i]
        ex, ey = c * wheel_c - s * wheel_s, s * wheel_c + c * wheel_s
        lever0, lever1 = lanes[LEVER_0 + i], lanes[LEVER_1 + i]
        q00 = ex * inverse_mass - ry * lever0 * inverse_inertia
        q01 = -ey * inverse_mass - ry * lever1 * inverse_inertia
        q10 = ey * inverse_mass + rx * lever0 * inverse_inertia
        q11 = ex * inverse_mass + rx * lever1 * inverse_inertia
        # Impulse along each of the joint's rows (first index) that answers one along each of the wheel's.
        g00, g01 = -h00 * q00 - h01 * q10, -h00 * q01 - h01 * q11
        g10, g11 = -h01 * q00 - h11 * q10, -h01 * q01 - h11 * q11
        k00 = max(lanes[A00 + i] + q00 * g00 + q10 * g10, SINGULAR * lanes[A00 + i])
        k01 = lanes[A01 + i] + q00 * g01 + q10 * g11
        k11 = max(lanes[A11 + i] + q01 * g01 + q11 * g11, SINGULAR * lanes[A11 + i])
        slip0 = ex * vx + ey * vy + lever0 * omega
        slip1 = ex * vy - ey * vx + lever1 * omega
        p0, p1 = box_impulses(k00, k01, k11, slip0, slip1, lanes[LIMIT_0 + i], lanes[LIMIT_1 + i])
        j0, j1 = g00 * p0 + g01 * p1, g10 * p0 + g11 * p1
        lanes[VX + i] = vx + (ex * p0 - ey * p1 + j0) * inverse_mass
        lanes[VY + i] = vy + (ey * p0 + ex * p1 + j1) * inverse_mass
        lanes[OMEGA + i] = omega + (lever0 * p0 + lever1 * p1 + rx * j1 - ry * j0) * inverse_inertia


@njit(**LEAF)
def slow_lanes(lanes: Array, count: int) -> None:
    """Take from each body's speed what friction on the floor takes, all velocities by the same share."""
    for i in range(count):
        vx, vy, omega, loss = lanes[VX + i], lanes[VY + i], lanes[OMEGA + i], lanes[GROUND + i]
        speed = math.sqrt(vx * vx + vy * vy + lanes[INERTIA_PER_MASS + i] * omega * omega)
        share = 1.0 - loss / speed
        kept = share if speed > loss else 0.0
        kept = kept if loss > 0.0 else 1.0
        lanes[VX + i] = vx * kept
        lanes[VY + i] = vy * kept
        lanes[OMEGA + i] = omega * kept
