"""Compiled: rollouts of worlds of several bodies that touch, each in a Chipmunk space of its own.

What `world.PhysicsWorld` does through pymunk, in the same order with the same calls of Chipmunk, so that the motion is
the same to the last bits; but a space is built, stepped and freed without Python. Building costs no more than a step
or two, and a space that was never stepped before remembers no impulses: the bytes do not depend on what was simulated
before.

Arrays in, caller's buffers out; `contact_world.py` does the checking.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_model import kernel
from pbrl_model.engines import chipmunk_kernel as cp
from pbrl_model.world import COLLISION_SLOP, LEVER, WALL_THICKNESS

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Whole = int | np.int64

RESTITUTION, CONTACT_FRICTION = kernel.MU_GROUND + 1, kernel.MU_GROUND + 2
HANDLES = 4
"""Handles of Chipmunk a body needs room for: itself, two joints of its wheel, one of its hinge."""
BODY, WHEEL_JOINT, HINGE_JOINT = 0, 1, 3
FASTEST = 1e6
"""A motion faster than this [m/s, rad/s] is not stepped on: the next overflow would end the process."""


class Things(NamedTuple):
    """What all worlds of a call share.

    Attributes:
        com: (B, 2) centres of mass in the bodies' frames [m].
        inertia_per_mass: (B,) [m^2].
        corners: (V, 2) of all convex parts of all bodies, counter-clockwise, about the centres of mass [m].
        parts: (K + 1,) where each part starts in `corners`, and where the last ends.
        owners: (B + 1,) the same for which parts are of which body.
        walls: (S, 4) segments x0, y0, x1, y1 in world [m].
        joins: (J, 7) first body, second body, anchor of each in its own frame [m], distance [m].
    """

    com: Array
    inertia_per_mass: Array
    corners: Array
    parts: Index
    owners: Index
    walls: Array
    joins: Array


class Room(NamedTuple):
    """What each world writes into while it lives.

    Attributes:
        far_ends: (P, B, 2, 2) far ends of the wheels' joints in the bodies' axes [m].
        handles: (P, B + J, HANDLES) Chipmunk's bodies and joints; 0: none.
        shapes: (P, K + S) Chipmunk's shapes.
    """

    far_ends: Array
    handles: Index
    shapes: Index


@njit(**LEAF)
def add_wheel(space: int, body: int, row: Array, com: Array, realign: int, far_ends: Array, handles: Index) -> None:
    """Give a body the two joints of its wheel, each with a force of at most mu * mass * g; see `world.py`.

    Args:
        space: Chipmunk's.
        body: Chipmunk's.
        row: (14,) parameters.
        com: (2,) [m].
        realign: what `chipmunk_kernel.realign_address` says.
        far_ends: (2, 2) written; has to outlive the space.
        handles: (HANDLES,) written.
    """
    x, y = row[kernel.WHEEL_X] - com[0], row[kernel.WHEEL_Y] - com[1]
    for axis in range(2):
        mu = row[kernel.MU_X + axis]
        if mu == 0.0:
            continue
        turn = row[kernel.WHEEL_THETA] + axis * (math.pi / 2.0)
        far_ends[axis, 0] = x - LEVER * math.cos(turn)
        far_ends[axis, 1] = y - LEVER * math.sin(turn)
        far_x, far_y = cp.body_local_to_world(body, far_ends[axis, 0], far_ends[axis, 1])
        joint = cp.pin_new(cp.space_static_body(space), body, far_x, far_y, x, y)
        cp.constraint_set_max_bias(joint, 0.0)
        cp.constraint_set_max_force(joint, mu * row[kernel.MASS] * kernel.GRAVITY)
        cp.constraint_set_data(joint, far_ends[axis].ctypes.data)
        cp.constraint_set_before_solve(joint, realign)
        cp.space_add_constraint(space, joint)
        handles[WHEEL_JOINT + axis] = joint


@njit(**LEAF)
def distance_joint(a: int, b: int, ax: float, ay: float, bx: float, by: float, radius: float) -> int:
    """Make a joint that keeps two anchors at a distance: a pin, or a pivot where it is zero."""
    if radius == 0.0:
        return cp.pivot_new(a, b, ax, ay, bx, by)
    joint = cp.pin_new(a, b, ax, ay, bx, by)
    cp.pin_set_distance(joint, radius)
    return joint


@njit(**LEAF)
def add_body(space: int, b: int, row: Array, state: Array, things: Things, realign: int, p: Whole, room: Room) -> None:
    """Put body `b` of world `p` with its shapes, wheel and hinge into a space.

    Args:
        space: Chipmunk's.
        b: which body.
        row: (14,) its parameters.
        state: (6,) of its centre of mass.
        things: what is known of all bodies.
        realign: what `chipmunk_kernel.realign_address` says.
        p: which world.
        room: written.
    """
    com, handles = things.com[b], room.handles[p, b]
    body = cp.body_new(row[kernel.MASS], row[kernel.MASS] * things.inertia_per_mass[b])
    cp.body_set_angle(body, state[2])
    cp.body_set_position(body, state[0], state[1])
    cp.body_set_velocity(body, state[3], state[4])
    cp.body_set_angular_velocity(body, state[5])
    cp.space_add_body(space, body)
    handles[:] = 0
    handles[BODY] = body
    for part in range(things.owners[b], things.owners[b + 1]):
        first, last = things.parts[part], things.parts[part + 1]
        shape = cp.polygon_new(body, last - first, things.corners[first].ctypes.data, 0.0)
        add_shape(space, shape, row[RESTITUTION], row[CONTACT_FRICTION])
        room.shapes[p, part] = shape
    add_wheel(space, body, row, com, realign, room.far_ends[p, b], handles)
    if not math.isnan(row[kernel.HINGE_RADIUS]):
        static = cp.space_static_body(space)
        x, y = row[kernel.ANCHOR_X] - com[0], row[kernel.ANCHOR_Y] - com[1]
        joint = distance_joint(static, body, row[kernel.HINGE_X], row[kernel.HINGE_Y], x, y, row[kernel.HINGE_RADIUS])
        cp.space_add_constraint(space, joint)
        handles[HINGE_JOINT] = joint


@njit(**LEAF)
def add_shape(space: int, shape: int, restitution: float, friction: float) -> None:
    """Put a shape into a space."""
    cp.shape_set_elasticity(shape, restitution)
    cp.shape_set_friction(shape, friction)
    cp.space_add_shape(space, shape)


@njit(**LEAF)
def add_walls(space: int, things: Things, p: Whole, room: Room) -> None:
    """Put the walls into the space of world `p`; their coefficients are 1, so that a body's own hold."""
    pieces = things.parts.size - 1
    static = cp.space_static_body(space)
    for k in range(things.walls.shape[0]):
        wall = things.walls[k]
        shape = cp.segment_new(static, wall[0], wall[1], wall[2], wall[3], WALL_THICKNESS)
        add_shape(space, shape, 1.0, 1.0)
        room.shapes[p, pieces + k] = shape


@njit(**LEAF)
def add_joins(space: int, things: Things, p: Whole, room: Room) -> None:
    """Join the bodies of world `p` that are to be kept at a distance."""
    bodies = things.com.shape[0]
    for k in range(things.joins.shape[0]):
        join = things.joins[k]
        a, b = int(join[0]), int(join[1])
        joint = distance_joint(
            room.handles[p, a, BODY],
            room.handles[p, b, BODY],
            join[2] - things.com[a, 0],
            join[3] - things.com[a, 1],
            join[4] - things.com[b, 0],
            join[5] - things.com[b, 1],
            join[6],
        )
        cp.space_add_constraint(space, joint)
        room.handles[p, bodies + k, BODY] = joint


@njit(**LEAF)
def slow(body: int, loss: float, inertia_per_mass: float) -> None:
    """Take `loss` [m/s] from a body's speed in the metric of its inertia, all velocities by the same share."""
    vx, vy = cp.body_velocity(body)
    omega = cp.body_angular_velocity(body)
    speed = math.sqrt(vx * vx + vy * vy + omega * omega * inertia_per_mass)
    kept = 1.0 - loss / speed if speed > loss else 0.0
    cp.body_set_velocity(body, vx * kept, vy * kept)
    cp.body_set_angular_velocity(body, omega * kept)


@njit(**LEAF)
def read_state(body: int, out: Array) -> bool:
    """Write a body's (6,) state; tell whether the next pose will be finite, for Chipmunk ends the process where not."""
    out[0], out[1] = cp.body_position(body)
    out[2] = cp.body_angle(body)
    out[3], out[4] = cp.body_velocity(body)
    out[5] = cp.body_angular_velocity(body)
    return abs(out[3]) + abs(out[4]) + abs(out[5]) < FASTEST


@njit(cache=True, error_model="numpy")
def roll_space(
    space: int,
    rows: Array,
    wrench: Array,
    inertia_per_mass: Array,
    dt: float,
    body_wrench: bool,
    handles: Index,
    out: Array,
) -> None:
    """Step a space that has been built, writing states; NaN from where the motion ran away.

    Args:
        space: Chipmunk's.
        rows: (B, 14).
        wrench: (T, B, 3).
        inertia_per_mass: (B,) [m^2].
        dt: [s].
        body_wrench: see `contact_world.rollout_contact`.
        handles: (B, HANDLES).
        out: (T + 1, B, 6) written.
    """
    bodies, steps = rows.shape[0], wrench.shape[0]
    out[:] = np.nan
    for t in range(steps + 1):
        tame = True
        for b in range(bodies):
            tame = read_state(handles[b, BODY], out[t, b]) and tame
        if t == steps or not tame:
            break
        for b in range(bodies):
            fx, fy = wrench[t, b, 0], wrench[t, b, 1]
            if body_wrench:
                heading = out[t, b, 2] + out[t, b, 5] * dt
                c, s = math.cos(heading), math.sin(heading)
                fx, fy = c * fx - s * fy, s * fx + c * fy
            cp.body_set_force(handles[b, BODY], fx, fy)
            cp.body_set_torque(handles[b, BODY], wrench[t, b, 2])
        cp.space_step(space, dt)
        for b in range(bodies):
            if rows[b, kernel.MU_GROUND] > 0.0:
                slow(handles[b, BODY], rows[b, kernel.MU_GROUND] * kernel.GRAVITY * dt, inertia_per_mass[b])


@njit(**LEAF)
def free_space(space: int, things: Things, p: Whole, room: Room) -> None:
    """Free the space of world `p`, then what it held: Chipmunk asks of its bodies while a space goes."""
    bodies = things.com.shape[0]
    cp.space_free(space)
    for b in range(bodies):
        for joint in range(WHEEL_JOINT, HINGE_JOINT + 1):
            if room.handles[p, b, joint] != 0:
                cp.constraint_free(room.handles[p, b, joint])
    for k in range(things.joins.shape[0]):
        cp.constraint_free(room.handles[p, bodies + k, BODY])
    for k in range(room.shapes.shape[1]):
        cp.shape_free(room.shapes[p, k])
    for b in range(bodies):
        cp.body_free(room.handles[p, b, BODY])


@njit(cache=True, error_model="numpy")
def contact_world(
    index: int,
    rows: Array,
    initial: Array,
    wrench: Array,
    things: Things,
    dt: float,
    iterations: int,
    body_wrench: bool,
    realign: int,
    room: Room,
    out: Array,
) -> None:
    """Build world number `index`, roll it out and free it; arguments as of `contact_serial`."""
    p = np.int64(index)  # a parallel loop counts without sign, which does not mix with what is below
    start, forces = initial[min(p, initial.shape[0] - 1)], wrench[min(p, wrench.shape[0] - 1)]
    space = cp.space_new()
    cp.space_set_iterations(space, iterations)
    cp.space_set_collision_slop(space, COLLISION_SLOP)
    add_walls(space, things, p, room)
    for b in range(rows.shape[1]):
        add_body(space, b, rows[p, b], start[b], things, realign, p, room)
    add_joins(space, things, p, room)
    roll_space(space, rows[p], forces, things.inertia_per_mass, dt, body_wrench, room.handles[p], out[p])
    free_space(space, things, p, room)


@njit(cache=True, error_model="numpy", nogil=True)
def contact_serial(
    rows: Array,
    initial: Array,
    wrench: Array,
    things: Things,
    dt: float,
    iterations: int,
    body_wrench: bool,
    realign: int,
    room: Room,
    out: Array,
) -> None:
    """Roll out P worlds on this core.

    Args:
        rows: (P, B, 14) parameters of every body: `KERNEL_COLUMNS`, restitution, contact friction.
        initial: (P or 1, B, 6) states of the centres of mass.
        wrench: (P or 1, T, B, 3).
        things: bodies and walls.
        dt: [s].
        iterations: sweeps a step.
        body_wrench: see `contact_world.rollout_contact`.
        realign: what `chipmunk_kernel.realign_address` says.
        room: to work in.
        out: (P, T + 1, B, 6) written; NaN from where a motion ran away.
    """
    for p in range(rows.shape[0]):
        contact_world(p, rows, initial, wrench, things, dt, iterations, body_wrench, realign, room, out)


@njit(cache=True, error_model="numpy", nogil=True, parallel=True)
def contact_parallel(
    rows: Array,
    initial: Array,
    wrench: Array,
    things: Things,
    dt: float,
    iterations: int,
    body_wrench: bool,
    realign: int,
    room: Room,
    out: Array,
) -> None:
    """Do what `contact_serial` does on all cores; each world is its own work, so the bytes are the same."""
    for p in prange(rows.shape[0]):
        contact_world(p, rows, initial, wrench, things, dt, iterations, body_wrench, realign, room, out)
