"""The compiled world model: one body with a wheel and a distance joint, and the mathematics of its step.

A step is Chipmunk's `cpSpaceStep`, in its order: the pose advances with the old velocity; the
constraints are laid out at the new pose; the wrench changes the velocity; then impulses are sought
such that each constraint holds or is at its limit. The constraints are

- the wheel: two rows, the velocity of the wheel's point along the wheel's x and y axis is zero as long
  as the impulse stays within `mu * mass * g * dt` (thesis section 5.3.1, anisotropic friction);
- the distance joint: one row along the line from hinge to anchor (two rows, x and y, where the radius
  is zero), unlimited, with Chipmunk's Baumgarte term `-(1 - ERROR_BIAS**dt) * error / dt`.

Chipmunk finds the impulses by Gauss-Seidel sweeps with accumulated clamping, warm-started. They converge
to the one minimum of a quadratic in a box. With one body there are two rows in the box (the wheel) and at most two
unlimited ones (the joint), so the minimum has a closed form: the joint's rows are eliminated and the
2 x 2 rest is solved (`box_impulses`). That is what this file does; it is what Chipmunk tends to as its iterations
grow, and a converged solution needs no warm start. `world.py` is the readable reference and the tests
hold the two to each other.

`integrate` is the plain loop, for one body. `lane_kernel.py` is the same step for many bodies at once, several times as
fast; what rolls out many does so in lanes.

Last comes the friction of the whole body on the floor (feet that slide, casters that resist rolling), which
Chipmunk does not have: all three velocities shrink by the same share, such that sqrt(v^2 + omega^2 I/m) falls by
`mu_ground * g * dt`, or to rest. This is Coulomb friction whose limit surface is the ellipsoid of the body's
inertia: exact for a body that slides without turning, within a few per cent for one on four casters that turns about
one of them, a third too weak for one that spins on the spot. Since the share is common, what the joints hold stays
held, and a body at rest stays at rest.

Arrays in, caller's buffers out: no allocation, no callables, no checks. `rollout.py` does the checking.
State (x, y, theta, vx, vy, omega) of the centre of mass in world; wrench (fx, fy, tau) at the centre of
mass in world axes, constant over a step.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]

GRAVITY = 9.81  # [m/s^2]
# Chipmunk's default: a tenth of a joint's error goes in a sixtieth of a second (0.9 in single precision, as there).
ERROR_BIAS = float(np.float32(1.0) - np.float32(0.1)) ** 60.0
MIN_DISTANCE = 1e-9  # [m] nearer to the hinge than this a distance joint has no direction and rests for the step
SINGULAR = 1e-12  # a 2 x 2 matrix with a smaller determinant than this share of its diagonal's product is singular
# A quarter turn in three parts of which the first two have so few digits that whole multiples of them are exact.
QUARTER = (1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624871116645580e-21)
SIN = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
COS = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)
MASS, WHEEL_X, WHEEL_Y, WHEEL_THETA, MU_X, MU_Y, HINGE_X, HINGE_Y, HINGE_RADIUS, ANCHOR_X, ANCHOR_Y, MU_GROUND = range(
    12
)


@njit(**LEAF, forceinline=True)
def clamp(value: float, limit: float) -> float:
    """Return the value, brought into [-limit, limit]."""
    return min(max(value, -limit), limit)


@njit(**LEAF, forceinline=True)
def cos_sin(angle: float) -> tuple[float, float]:
    """Return cosine and sine, both within 2.3e-16 for angles up to 1e6 rad, by multiplications and choices alone.

    The angle is brought into [-pi/4, pi/4] by whole quarter turns taken off in three parts (Cody and Waite), there the
    polynomials of the fdlibm library hold, and the quarter turns decide which is which and the signs. The
    library's own functions cannot work on several numbers at once.
    """
    turns = math.floor(angle * (2.0 / math.pi) + 0.5)
    rest = ((angle - turns * QUARTER[0]) - turns * QUARTER[1]) - turns * QUARTER[2]
    z = rest * rest
    sine = rest + rest * z * (SIN[0] + z * (SIN[1] + z * (SIN[2] + z * (SIN[3] + z * (SIN[4] + z * SIN[5])))))
    cosine = 1.0 - 0.5 * z + z * z * (COS[0] + z * (COS[1] + z * (COS[2] + z * (COS[3] + z * (COS[4] + z * COS[5])))))
    half = math.floor(0.5 * turns)
    odd = turns - 2.0 * half
    sign = 1.0 - 2.0 * (half - 2.0 * math.floor(0.5 * half))
    c = sine if odd > 0.5 else cosine
    s = cosine if odd > 0.5 else sine
    return c * (sign * (1.0 - 2.0 * odd)), s * sign


@njit(**LEAF, forceinline=True)
def box_impulses(
    a00: float, a01: float, a11: float, b0: float, b1: float, limit0: float, limit1: float
) -> tuple[float, float]:
    """Minimise p.A.p / 2 + b.p over |p_i| <= limit_i: the impulses two sweeping rows converge to.

    For a given p0 the best p1 is that of row 1 alone, brought into its limits: the middle one of its free value and
    the two limits. So what is left along row 0, g(p0) = a00 p0 + a01 p1(p0) + b0, is the middle one of three straight
    lines that all rise with p0: row 1 sticking, or sliding at either limit. The root of the middle one of rising lines
    is the middle one of their roots. Then p0 is brought into its limits, for the problem that is left is convex in p0.
    No case is tried and rejected, so that many can be worked out at once.

    Args:
        a00: [1/kg] what an impulse of row 0 does to the velocity along row 0, above zero; `a01`, `a11` likewise.
        a01: see `a00`.
        a11: see `a00`.
        b0: [m/s] velocity along row 0 without the impulses.
        b1: [m/s] the same for row 1.
        limit0: [N s].
        limit1: [N s].

    Returns:
        The two impulses [N s].
    """
    # Rows all but parallel: the sticking root then lies far out on its proper side, or anywhere if it does not matter.
    determinant = max(a00 * a11 - a01 * a01, SINGULAR * a00 * a11)
    stick = (a01 * b1 - a11 * b0) / determinant
    slide, reach = -b0 / a00, abs(a01) * limit1 / a00
    p0 = clamp(min(max(stick, slide - reach), slide + reach), limit0)
    return p0, clamp(-(b1 + a01 * p0) / a11, limit1)


@njit(**LEAF)
def joint_rows(
    dx: float, dy: float, rx: float, ry: float, radius: float, inverse_mass: float, inverse_inertia: float
) -> tuple[float, float, float, float, float, float, float, float, float, float, float]:
    """Lay out the distance joint as two rows (direction n, lever l), the second empty where the radius is not zero.

    Args:
        dx: from hinge to anchor, world axes [m].
        dy: as `dx`.
        rx: from centre of mass to anchor, world axes [m].
        ry: as `rx`.
        radius: length of the joint [m].
        inverse_mass: [1/kg].
        inverse_inertia: [1/(kg m^2)].

    Returns:
        n0x, n0y, l0, n1x, n1y, l1 of the rows; h00, h01, h11 their effective mass, the inverse of what impulses along
        the rows do to the velocities along them; error0, error1 of their lengths, times the length of n.
    """
    if radius > 0.0:
        # The row is (d, r x d), not divided by the distance: rows may have any length, and the square root is
        # then off the critical path.
        square = dx * dx + dy * dy
        if square < MIN_DISTANCE * MIN_DISTANCE:
            return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        lever = rx * dy - ry * dx
        h = 1.0 / (inverse_mass * square + lever * lever * inverse_inertia)
        return dx, dy, lever, 0.0, 0.0, 0.0, h, 0.0, 0.0, square - radius * math.sqrt(square), 0.0
    k00 = inverse_mass + ry * ry * inverse_inertia
    k01 = -rx * ry * inverse_inertia
    k11 = inverse_mass + rx * rx * inverse_inertia
    scale = 1.0 / (k00 * k11 - k01 * k01)
    return 1.0, 0.0, -ry, 0.0, 1.0, rx, k11 * scale, -k01 * scale, k00 * scale, dx, dy


@njit(**LEAF)
def integrate(
    parameters: Array,
    initial: Array,
    wrench: Array,
    steps: int,
    inertia_per_mass: float,
    com_x: float,
    com_y: float,
    origin_x: float,
    origin_y: float,
    dt: float,
    body_wrench: bool,
    out: Array,
) -> None:
    """Roll one body out and write its motion.

    Args:
        parameters: (12,) row of `KERNEL_COLUMNS`.
        initial: (6,) state of the centre of mass at row 0 of `out`.
        wrench: (T, 3) [N, N, N m], T >= steps.
        steps: number of steps.
        inertia_per_mass: [m^2] moment of inertia over mass.
        com_x: centre of mass in the body's frame [m].
        com_y: as `com_x`.
        origin_x: centre of mass minus the point whose pose is written, in the body's frame [m]: 0 for the centre of
            mass itself, `com_x` for the origin of the body's frame.
        origin_y: as `origin_x`.
        dt: [s].
        body_wrench: whether the wrench's force is in the body's axes, carried along with the simulated heading.
        out: (>= steps + 1, 3) poses, or (.., 6) with velocities of the centre of mass; rows 0..steps are written.
    """
    inverse_mass = 1.0 / parameters[MASS]
    inverse_inertia = inverse_mass / inertia_per_mass
    x, y, theta = initial[0], initial[1], initial[2]
    vx, vy, omega = initial[3], initial[4], initial[5]
    velocities = out.shape[1] == 6

    # The wheel's rows seen from the body never change: unit vectors, their levers about the centre of
    # mass, and therefore what an impulse along one row does to the velocity along the other.
    wheel_x, wheel_y = parameters[WHEEL_X] - com_x, parameters[WHEEL_Y] - com_y
    wheel_c, wheel_s = math.cos(parameters[WHEEL_THETA]), math.sin(parameters[WHEEL_THETA])
    lever0 = wheel_x * wheel_s - wheel_y * wheel_c
    lever1 = wheel_x * wheel_c + wheel_y * wheel_s
    a00 = inverse_mass + lever0 * lever0 * inverse_inertia
    a01 = lever0 * lever1 * inverse_inertia
    a11 = inverse_mass + lever1 * lever1 * inverse_inertia
    limit = parameters[MASS] * GRAVITY * dt
    limit0, limit1 = parameters[MU_X] * limit, parameters[MU_Y] * limit
    wheel = limit0 > 0.0 or limit1 > 0.0
    ground = parameters[MU_GROUND] * GRAVITY * dt

    radius = parameters[HINGE_RADIUS]
    hinge = not math.isnan(radius)
    anchor_x, anchor_y = parameters[ANCHOR_X] - com_x, parameters[ANCHOR_Y] - com_y
    correction = (1.0 - ERROR_BIAS**dt) / dt
    n0x = n0y = l0 = n1x = n1y = l1 = h00 = h01 = h11 = 0.0
    g00 = g01 = g10 = g11 = 0.0  # impulse along each joint row (first index) that answers one along each wheel row

    c, s = cos_sin(theta)
    for t in range(steps + 1):
        out[t, 0] = x - c * origin_x + s * origin_y
        out[t, 1] = y - s * origin_x - c * origin_y
        out[t, 2] = theta
        if velocities:
            out[t, 3], out[t, 4], out[t, 5] = vx, vy, omega
        if t == steps:
            break
        x += vx * dt
        y += vy * dt
        theta += omega * dt
        c, s = cos_sin(theta)
        fx, fy = wrench[t, 0], wrench[t, 1]
        if body_wrench:
            fx, fy = c * fx - s * fy, s * fx + c * fy
        vx += fx * inverse_mass * dt
        vy += fy * inverse_mass * dt
        omega += wrench[t, 2] * inverse_inertia * dt

        ex, ey = c * wheel_c - s * wheel_s, s * wheel_c + c * wheel_s
        k00, k01, k11 = a00, a01, a11
        if hinge:
            # The joint is unlimited: it acts first, and the wheel's rows are then seen through it.
            rx, ry = c * anchor_x - s * anchor_y, s * anchor_x + c * anchor_y
            dx, dy = x + rx - parameters[HINGE_X], y + ry - parameters[HINGE_Y]
            rows = joint_rows(dx, dy, rx, ry, radius, inverse_mass, inverse_inertia)
            n0x, n0y, l0, n1x, n1y, l1, h00, h01, h11, error0, error1 = rows
            u0 = n0x * vx + n0y * vy + l0 * omega + correction * error0
            u1 = n1x * vx + n1y * vy + l1 * omega + correction * error1
            j0, j1 = -h00 * u0 - h01 * u1, -h01 * u0 - h11 * u1
            vx += (n0x * j0 + n1x * j1) * inverse_mass
            vy += (n0y * j0 + n1y * j1) * inverse_mass
            omega += (l0 * j0 + l1 * j1) * inverse_inertia
            if wheel:
                q00 = (n0x * ex + n0y * ey) * inverse_mass + l0 * lever0 * inverse_inertia
                q01 = (n0y * ex - n0x * ey) * inverse_mass + l0 * lever1 * inverse_inertia
                q10 = (n1x * ex + n1y * ey) * inverse_mass + l1 * lever0 * inverse_inertia
                q11 = (n1y * ex - n1x * ey) * inverse_mass + l1 * lever1 * inverse_inertia
                g00, g01 = -h00 * q00 - h01 * q10, -h00 * q01 - h01 * q11
                g10, g11 = -h01 * q00 - h11 * q10, -h01 * q01 - h11 * q11
                k00 += q00 * g00 + q10 * g10
                k01 += q00 * g01 + q10 * g11
                k11 += q01 * g01 + q11 * g11
        if wheel:
            slip0 = ex * vx + ey * vy + lever0 * omega
            slip1 = ex * vy - ey * vx + lever1 * omega
            k00, k11 = max(k00, SINGULAR * a00), max(k11, SINGULAR * a11)
            p0, p1 = box_impulses(k00, k01, k11, slip0, slip1, limit0, limit1)
            j0, j1 = g00 * p0 + g01 * p1, g10 * p0 + g11 * p1
            vx += (ex * p0 - ey * p1 + n0x * j0 + n1x * j1) * inverse_mass
            vy += (ey * p0 + ex * p1 + n0y * j0 + n1y * j1) * inverse_mass
            omega += (lever0 * p0 + lever1 * p1 + l0 * j0 + l1 * j1) * inverse_inertia
        if ground > 0.0:
            speed = math.sqrt(vx * vx + vy * vy + inertia_per_mass * omega * omega)
            kept = 1.0 - ground / speed if speed > ground else 0.0
            vx *= kept
            vy *= kept
            omega *= kept
