"""Rollouts of several bodies: by the kernel in those worlds where nothing touches, by Chipmunk in the others.

Bodies that do not touch move as if each were alone. So all are rolled out alone first; where their footprints then keep
clear of each other and of the walls at every step, nothing was touched, and what the kernel found is the motion.
Chipmunk looks for contact at the poses of whole steps and nowhere between, hence poses of whole steps are looked at
here. The two engines agree as `world.py` says: to rounding, but for a wheel and a joint on one body, where Chipmunk's
sweeps converge slowly and the kernel is the more exact.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from pbrl_model.engines.contact_world import ContactScene, checked_worlds, frame_poses, rollout_contact
from pbrl_model.parameters import KERNEL_COLUMNS
from pbrl_model.rollout import DT, rollout_each
from pbrl_model.world import ITERATIONS, WALL_THICKNESS

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MARGIN = 1e-3
"""Bodies nearer to each other than this [m] may touch: as far as contacts are let sink in."""


def rollout_bodies(
    scene: ContactScene,
    parameters: ArrayLike,
    initial: ArrayLike,
    wrench: ArrayLike,
    dt: float = DT,
    *,
    iterations: int = ITERATIONS,
    body_wrench: bool = False,
    parallel: bool = True,
) -> tuple[Array, Flags]:
    """Roll out P worlds of B bodies, each world by the engine that it needs.

    Args:
        scene: of `contact_scene`.
        parameters: (P, B, 14) or (B, 14) rows of `CONTACT_COLUMNS`.
        initial: (P, B, 6) or (B, 6) states of the centres of mass in world.
        wrench: (P, T, B, 3) or (T, B, 3) [N, N, N m] at the centres of mass, constant over each step.
        dt: [s].
        iterations: sweeps of Chipmunk in each step.
        body_wrench: as of `rollout_contact`.
        parallel: False from callers that are parallel themselves. The bytes are the same.

    Returns:
        (P, T + 1, B, 6) states, and (P,) in which worlds Chipmunk was needed.

    Raises:
        ModelError: as `rollout_contact`.
    """
    rows, start, forces = checked_worlds(scene, parameters, initial, wrench, dt)
    count, bodies = max(len(rows), len(start), len(forces)), len(scene)
    rows, start, forces = (np.broadcast_to(value, (count, *value.shape[1:])) for value in (rows, start, forces))
    states = rollout_each(
        rows[..., : len(KERNEL_COLUMNS)].reshape(count * bodies, -1),
        start.reshape(count * bodies, 6),
        np.swapaxes(forces, 1, 2).reshape(count * bodies, -1, 3),
        np.tile(scene.things.inertia_per_mass, count),
        np.tile(scene.com, (count, 1)),
        dt,
        parallel=parallel,
        body_wrench=body_wrench,
    )
    states = np.ascontiguousarray(np.swapaxes(states.reshape(count, bodies, -1, 6), 1, 2))
    touching = needs_contact(scene, states)
    if touching.any():
        states[touching] = rollout_contact(
            scene,
            rows[touching],
            start[touching],
            forces[touching],
            dt,
            iterations=iterations,
            body_wrench=body_wrench,
            parallel=parallel,
        )
    return states, touching


def needs_contact(scene: ContactScene, states: ArrayLike, margin: float = MARGIN) -> Flags:
    """Tell in which windows bodies come so near to each other or to a wall that they may touch.

    Circles about the footprints decide most windows; where they overlap, the footprints themselves are measured.

    Args:
        scene: of `contact_scene`. Bodies that are joined need Chipmunk always.
        states: (P, T, B, 3 or more) poses or states of the centres of mass, simulated alone or recorded; what is not
            finite may be anywhere.
        margin: what is nearer than this may touch [m].

    Returns:
        (P,) flags.
    """
    poses = np.asarray(states, dtype=float)[..., :3]
    flags = (len(scene.things.joins) > 0) | ~np.isfinite(poses).all(axis=(1, 2, 3))
    reach = [
        float(np.linalg.norm(outline - com, axis=1).max())
        for outline, com in zip(scene.footprints, scene.com, strict=True)
    ]
    frames = frame_poses(scene, poses)
    for b in range(len(scene)):
        for wall in scene.walls:
            near = _to_segment(poses[:, :, b, :2], wall) <= reach[b] + WALL_THICKNESS + margin
            _measure(flags, near, scene, frames, b, shapely.LineString(wall.reshape(2, 2)), WALL_THICKNESS + margin)
        for other in range(b):
            apart = np.linalg.norm(poses[:, :, b, :2] - poses[:, :, other, :2], axis=-1)
            _measure(flags, apart <= reach[b] + reach[other] + margin, scene, frames, b, other, margin)
    return flags


def _measure(
    flags: Flags, near: Flags, scene: ContactScene, frames: Array, b: int, other: int | shapely.LineString, limit: float
) -> None:
    """Raise the flags of windows in which body `b` is within `limit` of another body or a wall, at the steps `near`."""
    window, step = np.nonzero(near & ~flags[:, None])
    if not window.size:
        return
    here = _outlines(scene.footprints[b], frames[window, step, b])
    there = _outlines(scene.footprints[other], frames[window, step, other]) if isinstance(other, int) else other
    flags[window[shapely.distance(here, there) <= limit]] = True


def _outlines(footprint: Array, pose: Array) -> NDArray[np.object_]:
    """Return polygons of one footprint at poses (n, 3) of its frame."""
    c, s = np.cos(pose[:, 2:]), np.sin(pose[:, 2:])
    x = pose[:, :1] + c * footprint[:, 0] - s * footprint[:, 1]
    y = pose[:, 1:2] + s * footprint[:, 0] + c * footprint[:, 1]
    polygons: NDArray[np.object_] = shapely.polygons(np.stack([x, y], axis=-1))
    return polygons


def _to_segment(points: Array, wall: Array) -> Array:
    """Return the distances of points (..., 2) from a segment (4,)."""
    along = wall[2:] - wall[:2]
    square = float(along @ along)
    share = np.clip((points - wall[:2]) @ along / square, 0.0, 1.0) if square > 0.0 else np.zeros(points.shape[:-1])
    return np.asarray(np.linalg.norm(points - wall[:2] - share[..., None] * along, axis=-1))
