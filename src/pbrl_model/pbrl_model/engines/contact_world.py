"""Worlds whose bodies may touch: `world.PhysicsWorld` for many parameters in one call, on all cores.

    scene = contact_scene([footprint, ...], walls=[outline, ...])
    states = rollout_contact(scene, parameters, initial, wrench, dt)     # (P, T + 1, B, 6)

Parameters are rows of `CONTACT_COLUMNS` for each body; states (x, y, theta, vx, vy, omega) are of the centre of mass,
as the kernel's; wrenches (fx, fy, tau) at the centre of mass in world axes, constant over a step. `start_states` makes
states of poses of the bodies' frames. The engine is Chipmunk's own C code, driven from compiled code
(`contact_kernel.py`). `several_bodies.py` uses it only for those worlds in which something may touch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pymunk
from numpy.typing import ArrayLike, NDArray

from pbrl_model.engines import contact_kernel
from pbrl_model.engines.chipmunk_kernel import realign_address
from pbrl_model.engines.contact_kernel import Room, Things
from pbrl_model.errors import ModelError
from pbrl_model.geometry import MassProperties, check_polygon, convex_parts, mass_properties
from pbrl_model.kernel import HINGE_RADIUS, MASS, MU_GROUND, MU_X, MU_Y
from pbrl_model.parameters import KERNEL_COLUMNS
from pbrl_model.rollout import DT, KERNEL_LOCK, plain
from pbrl_model.world import ITERATIONS

Array = NDArray[np.float64]

CONTACT_COLUMNS = (*KERNEL_COLUMNS, "restitution", "contact_friction")
SERIAL_STEPS = 500
"""Below this many steps of spaces in all, waking the other cores costs more than it saves."""


@dataclass(frozen=True)
class ContactScene:
    """What is known of a room: shapes, walls, and which bodies are joined.

    Attributes:
        footprints: B outlines (k, 2) [m] in the bodies' frames.
        properties: B centres of mass and inertias over mass.
        things: the same and the walls, as the compiled code takes them.
    """

    footprints: tuple[Array, ...]
    properties: tuple[MassProperties, ...]
    things: Things

    def __len__(self) -> int:
        """Return the number of bodies."""
        return len(self.footprints)

    @property
    def com(self) -> Array:
        """(B, 2) centres of mass in the bodies' frames [m]."""
        return self.things.com

    @property
    def walls(self) -> Array:
        """(S, 4) segments x0, y0, x1, y1 in world [m]."""
        return self.things.walls


def contact_scene(
    footprints: Sequence[ArrayLike],
    walls: Sequence[ArrayLike] = (),
    joins: ArrayLike = (),
    properties: Sequence[MassProperties | None] | None = None,
) -> ContactScene:
    """Describe a room.

    Args:
        footprints: B outlines (k, 2) [m] in the bodies' frames.
        walls: closed outlines (k, 2) [m] in world, or single segments (2, 2).
        joins: (J, 7) first body, second body, anchor of each in its own frame [m], distance that is kept [m].
        properties: of each body; None: of its footprint with uniform density.

    Raises:
        ModelError: an outline is not a simple polygon, or a join names no body.
    """
    outlines = tuple(check_polygon(footprint) for footprint in footprints)
    if not outlines:
        raise ModelError("contact: expected at least one body, got none")
    given = [None] * len(outlines) if properties is None else list(properties)
    if len(given) != len(outlines):
        raise ModelError(f"contact: expected {len(outlines)} mass properties, got {len(given)}")
    told = tuple(own or mass_properties(outline) for own, outline in zip(given, outlines, strict=True))
    pieces = [_parts(outline, own.com) for outline, own in zip(outlines, told, strict=True)]
    flat = [piece for body in pieces for piece in body]
    things = Things(
        np.array([own.com for own in told], dtype=float),
        np.array([own.inertia_per_mass for own in told], dtype=float),
        np.concatenate(flat),
        np.cumsum([0, *(len(piece) for piece in flat)]),
        np.cumsum([0, *(len(body) for body in pieces)]),
        _segments(walls),
        _joins(joins, len(outlines)),
    )
    return ContactScene(outlines, told, things)


def rollout_contact(
    scene: ContactScene,
    parameters: ArrayLike,
    initial: ArrayLike,
    wrench: ArrayLike,
    dt: float = DT,
    *,
    iterations: int = ITERATIONS,
    body_wrench: bool = False,
    parallel: bool = True,
) -> Array:
    """Roll out P worlds of the B bodies of a scene, contact included.

    Args:
        scene: of `contact_scene`.
        parameters: (P, B, 14) rows of `CONTACT_COLUMNS`, or (B, 14) for one world.
        initial: (P, B, 6) or (B, 6) states of the centres of mass in world.
        wrench: (P, T, B, 3) or (T, B, 3) [N, N, N m] at the centres of mass, constant over each step.
        dt: [s].
        iterations: sweeps of the solver in each step.
        body_wrench: the wrenches' forces are in the bodies' axes, at the heading to which the body's own velocity takes
            it in the step (what contact pushes apart in the same step, some 1e-4 rad, left out).
        parallel: False from callers that are parallel themselves. The bytes are the same.

    Returns:
        (P, T + 1, B, 6) states of the centres of mass; P is that of whichever of the three has the most.

    Raises:
        ModelError: a shape does not fit, a value is not finite or not physical, or a motion runs away.
    """
    rows, start, forces = checked_worlds(scene, parameters, initial, wrench, dt)
    count, bodies = max(len(rows), len(start), len(forces)), len(scene)
    if iterations < 1:
        raise ModelError(f"contact: expected at least one iteration, got {iterations}")
    rows = plain(np.broadcast_to(rows, (count, *rows.shape[1:])))
    steps = forces.shape[1]
    out = np.empty((count, steps + 1, bodies, 6))
    arguments = (
        rows,
        start,
        forces,
        scene.things,
        float(dt),
        int(iterations),
        bool(body_wrench),
        realign_address(),
        Room(
            np.zeros((count, bodies, 2, 2)),
            np.zeros((count, bodies + len(scene.things.joins), contact_kernel.HANDLES), dtype=np.int64),
            np.zeros((count, len(scene.things.parts) - 1 + len(scene.things.walls)), dtype=np.int64),
        ),
        out,
    )
    if parallel and count > 1 and count * steps > SERIAL_STEPS:
        with KERNEL_LOCK:
            contact_kernel.contact_parallel(*arguments)
    else:
        contact_kernel.contact_serial(*arguments)
    if not np.isfinite(out[:, -1]).all():
        world, body = (int(index) for index in np.argwhere(~np.isfinite(out[:, -1]).all(axis=2))[0])
        raise ModelError(f"contact: the motion of body {body} in world {world} runs away; dt may be too long")
    return out


def checked_worlds(
    scene: ContactScene, parameters: ArrayLike, initial: ArrayLike, wrench: ArrayLike, dt: float
) -> tuple[Array, Array, Array]:
    """Return parameters (P or 1, B, 14), initial (P or 1, B, 6) and wrench (P or 1, T, B, 3) of a scene, looked at.

    Raises:
        ModelError: a shape does not fit, or a value is not finite or not physical.
    """
    bodies = len(scene)
    rows = _shaped("parameters", parameters, 2, (bodies, len(CONTACT_COLUMNS)))
    start = _shaped("initial", initial, 2, (bodies, 6))
    forces = _shaped("wrench", wrench, 3, (bodies, 3))
    count = max(len(rows), len(start), len(forces))
    for name, value in (("parameters", rows), ("initial", start), ("wrench", forces)):
        if len(value) not in (1, count):
            raise ModelError(f"contact: expected {name} of 1 or {count} worlds, got {len(value)}")
    _check_rows(rows)
    for name, value in (("initial states", start), ("wrenches", forces)):
        if not np.isfinite(value).all():
            raise ModelError(f"contact: expected finite {name}, got {value[~np.isfinite(value)][0]}")
    if not (np.isfinite(dt) and dt > 0.0):
        raise ModelError(f"contact: expected dt above zero [s], got {dt!r}")
    return rows, start, forces


def start_states(scene: ContactScene, pose: ArrayLike, velocity: ArrayLike | None = None) -> Array:
    """Return states (..., B, 6) of the centres of mass for poses (..., B, 3) of the bodies' frames.

    Args:
        scene: of `contact_scene`.
        pose: (..., B, 3) in world.
        velocity: (..., B, 3) of the centres of mass; None: at rest.
    """
    origin = np.asarray(pose, dtype=float)
    speed = np.zeros_like(origin) if velocity is None else np.broadcast_to(np.asarray(velocity, float), origin.shape)
    return np.concatenate([_shift(origin, scene.com), speed], axis=-1)


def frame_poses(scene: ContactScene, states: ArrayLike) -> Array:
    """Return poses (..., B, 3) of the bodies' frames for states (..., B, 6) of the centres of mass."""
    return _shift(np.asarray(states, dtype=float)[..., :3], -scene.com)


def _shift(pose: Array, offset: Array) -> Array:
    moved = np.array(pose)
    c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    moved[..., 0] += c * offset[:, 0] - s * offset[:, 1]
    moved[..., 1] += s * offset[:, 0] + c * offset[:, 1]
    return moved


def _parts(outline: Array, com: Array) -> list[Array]:
    """Return the corners of the convex parts as Chipmunk orders them, about the centre of mass."""
    shapes = [pymunk.Poly(None, [tuple(point) for point in (part - com).tolist()]) for part in convex_parts(outline)]
    return [np.array(shape.get_vertices(), dtype=float) for shape in shapes]


def _segments(walls: Sequence[ArrayLike]) -> Array:
    segments: list[Array] = []
    for wall in walls:
        points = np.asarray(wall, dtype=float)
        if points.shape == (2, 2):
            if not np.isfinite(points).all():
                raise ModelError(f"contact: expected finite walls, got {points.tolist()}")
            segments.append(points.reshape(1, 4))
        else:
            corners = check_polygon(points)
            segments.append(np.concatenate([corners, np.roll(corners, -1, axis=0)], axis=1))
    return np.concatenate(segments) if segments else np.empty((0, 4))


def _joins(joins: ArrayLike, bodies: int) -> Array:
    table = np.asarray(joins, dtype=float).reshape(-1, 7) if np.size(joins) % 7 == 0 else None
    if table is None or not np.isfinite(table).all():
        raise ModelError("contact: expected joins as finite rows of 7 (bodies, two anchors, distance)")
    named = table[:, :2]
    if len(table) and (np.any(named != np.round(named)) or named.min() < 0 or named.max() >= bodies):
        raise ModelError(f"contact: expected joins between bodies 0..{bodies - 1}, got {named.tolist()}")
    if np.any(named[:, 0] == named[:, 1]) or np.any(table[:, 6] < 0.0):
        raise ModelError("contact: expected joins between two bodies at a distance of at least zero")
    return plain(table)


def _shaped(name: str, value: ArrayLike, least: int, tail: tuple[int, int]) -> Array:
    array = plain(value)
    if array.ndim == least:
        array = array[None]
    if array.ndim != least + 1 or array.shape[-2:] != tail:
        shape = ", ".join(["P", *(["T"] if least == 3 else []), *map(str, tail)])
        raise ModelError(f"contact: expected {name} of shape ({shape}), got {array.shape}")
    return array


def _check_rows(rows: Array) -> None:
    radius = rows[..., HINGE_RADIUS]
    legal = np.isfinite(np.delete(rows, HINGE_RADIUS, axis=-1)).all(axis=-1) & ~np.isinf(radius) & ~(radius < 0.0)
    least = rows[..., [MU_X, MU_Y, MU_GROUND, contact_kernel.RESTITUTION, contact_kernel.CONTACT_FRICTION]].min(axis=-1)
    legal &= (rows[..., MASS] > 0.0) & (least >= 0.0)
    if not legal.all():
        world, body = (int(index) for index in np.argwhere(~legal)[0])
        values = ", ".join(f"{n}={v:g}" for n, v in zip(CONTACT_COLUMNS, rows[world, body], strict=True))
        raise ModelError(
            "contact: expected finite parameters with mass > 0, friction and restitution >= 0, hinge_radius >= 0 or "
            f"NaN, got for body {body} of world {world}: {values}"
        )
