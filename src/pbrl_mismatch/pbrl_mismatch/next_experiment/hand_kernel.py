"""Compiled: planned pushes by a hand that follows a path, simulated under many parameter rows.

The hand is a spring and damper between a reference that moves along the path and the contact point. What comes out is
what a recording of it would hold: poses as tags would see them, and the wrench as the wrist's sensor would feel it,
faults of sensors included.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_mismatch.kernels import places as at
from pbrl_mismatch.kernels.friction_kernel import FOOT
from pbrl_mismatch.kernels.motion_kernel import rehearse
from pbrl_mismatch.kernels.sense_kernel import as_seen, feel, load_now, to_truth
from pbrl_mismatch.kernels.state import SLOSH, STATE, UNSEEN
from pbrl_mismatch.kernels.step_kernel import fixed_axes, step_body
from pbrl_model.kernel import cos_sin

Array = NDArray[np.float64]
Index = NDArray[np.int64]

CHANNELS = 6
"""Of an outcome: x, y [m], yaw [rad], force felt along the body's axes [N, N], torque at the contact [N m]."""
STIFFNESS, DAMPING, TURN_STIFFNESS, TURN_DAMPING, MOST_FORCE, MOST_TORQUE, GRIPPED, FRICTION, RAMP = range(9)
"""Entries of a hand."""


@njit(**LEAF, forceinline=True)
def reference_speed(time: float, duration: float, speed: float, ramp: float) -> float:
    """Return the speed of the reference [m/s]: up, steady, down."""
    return speed * max(0.0, min(1.0, time / ramp, (duration - time) / ramp))


@njit(**LEAF, forceinline=True)
def hold_back(force: Array, normal: Array, c: float, s: float, hand: Array) -> None:
    """Bring a hand's force and torque (3,) within what it can do; an open hand pushes within its friction cone.

    Args:
        force: changed.
        normal: (2,) of the outline, inwards, in the body's frame.
        c: cosine of the heading.
        s: sine of the heading.
        hand: see the constants.
    """
    if hand[GRIPPED] == 0.0:
        nx, ny = c * normal[0] - s * normal[1], s * normal[0] + c * normal[1]
        into = max(0.0, force[0] * nx + force[1] * ny)
        along = force[1] * nx - force[0] * ny
        along = max(-hand[FRICTION] * into, min(hand[FRICTION] * into, along))
        force[0], force[1], force[2] = into * nx - along * ny, into * ny + along * nx, 0.0
    size = math.sqrt(force[0] * force[0] + force[1] * force[1])
    if size > hand[MOST_FORCE]:
        force[0] *= hand[MOST_FORCE] / size
        force[1] *= hand[MOST_FORCE] / size
    force[2] = max(-hand[MOST_TORQUE], min(hand[MOST_TORQUE], force[2]))


@njit(cache=True, error_model="numpy")
def push_once(
    p: Array,
    contact: Array,
    normal: Array,
    direction: Array,
    speed: float,
    duration: float,
    told: Array,
    began: float,
    seen: Array,
    span: Index,
    pivot: Array,
    body: Array,
    outline: Array,
    feet: Array,
    hand: Array,
    out: Array,
) -> None:
    """Simulate one push under one parameter row, see `push_all`; its arguments without their first axes."""
    state, com, acc, force = np.empty(STATE), np.empty(2), np.empty(9), np.empty(3)
    axes, pose, before, felt = np.empty(7), np.empty(3), np.empty(3), np.empty(3)
    room = np.empty((feet.shape[0] + 2, FOOT))
    dt, segments = body[3], out.shape[0]
    steps = max(segments, round(duration / dt))
    mass, inertia = load_now(p, began, body, com)
    to_truth(p, told, body, com, state)
    rehearse(p, seen, span, body, outline, feet, com, state)
    state[SLOSH : SLOSH + 4] = state[UNSEEN + 3 :] = 0.0
    fixed_axes(p, dt, axes)
    late = (p[at.DELAY] + p[at.TIME_OFFSET]) / dt
    c, s = cos_sin(state[2])
    ax, ay = contact[0] - com[0], contact[1] - com[1]
    rx, ry = state[0] + c * ax - s * ay, state[1] + s * ax + c * ay
    yaw = state[2]
    as_seen(p, state, com, before)
    out[:] = 0.0
    for k in range(steps):
        time = began + k * dt
        way = reference_speed(k * dt, steps * dt, speed, hand[RAMP])
        ax, ay = contact[0] - com[0], contact[1] - com[1]
        lx, ly = c * ax - s * ay, s * ax + c * ay
        force[0] = hand[STIFFNESS] * (rx - state[0] - lx)
        force[1] = hand[STIFFNESS] * (ry - state[1] - ly)
        force[0] += hand[DAMPING] * (direction[0] * way - state[3] + state[5] * ly)
        force[1] += hand[DAMPING] * (direction[1] * way - state[4] - state[5] * lx)
        force[2] = hand[TURN_STIFFNESS] * (yaw - state[2]) - hand[TURN_DAMPING] * state[5]
        hold_back(force, normal, c, s, hand)
        # The hand lets go and takes hold anew: its sensor is read at rest as the push begins.
        feel(p, force, c, s, time, k * dt, felt)
        # The reference waits where the hand cannot follow, as a robot's would.
        lag = hand[MOST_FORCE] / hand[STIFFNESS]
        if (rx - state[0] - lx) ** 2 + (ry - state[1] - ly) ** 2 < lag * lag:
            rx += direction[0] * way * dt
            ry += direction[1] * way * dt
        force[2] += lx * force[1] - ly * force[0]
        c, s = step_body(p, state, force, time, mass, inertia, com, pivot, outline, feet, axes, acc, room, dt)
        as_seen(p, state, com, pose)
        segment = k * segments // steps
        for j in range(3):
            # Poses that come late show where the body was before; over a moment its velocity changes little.
            out[segment, j] += pose[j] - late * (pose[j] - before[j])
            out[segment, 3 + j] += felt[j]
            before[j] = pose[j]
    for segment in range(segments):
        first = -(-segment * steps // segments)
        last = -(-(segment + 1) * steps // segments)
        out[segment] /= last - first


@njit(cache=True, error_model="numpy", nogil=True)
def push_all(
    rows: Array,
    contact: Array,
    normal: Array,
    direction: Array,
    speed: Array,
    duration: Array,
    told: Array,
    began: float,
    seen: Array,
    span: Index,
    pivot: Array,
    body: Array,
    outline: Array,
    feet: Array,
    hand: Array,
    out: Array,
) -> None:
    """Simulate every push under every parameter row.

    Args:
        rows: (P, WIDTH).
        contact: (C, 2) in the body's frame [m].
        normal: (C, 2) of the outline there, inwards, in the body's frame.
        direction: (C, 2) of the reference, world axes, of unit length.
        speed: (C,) [m/s].
        duration: (C,) [s].
        told: (6,) state of the nominal centre of mass to begin with, as tags would see it.
        began: when [s].
        seen: (T, 6) smoothed states of what was recorded: what has a memory is taken along them first.
        span: (4,) last step, 0, first and last step of the last episode.
        pivot: (3,) pose of the body's frame at the start of that episode.
        body: (4,) see `sense_kernel.load_now`.
        outline: (E, 2) footprint [m].
        feet: (F, 2) points that carry the load [m].
        hand: (9,) see the constants.
        out: (P, C, S, CHANNELS) means over S equal parts of the duration, written.
    """
    for job in range(rows.shape[0] * contact.shape[0]):
        r, k = job // contact.shape[0], job % contact.shape[0]
        push_once(
            rows[r],
            contact[k],
            normal[k],
            direction[k],
            speed[k],
            duration[k],
            told,
            began,
            seen,
            span,
            pivot,
            body,
            outline,
            feet,
            hand,
            out[r, k],
        )
