"""Contact sectors (thesis section 5.2.1, figure 19): which parts of each body's boundary have something close by.

A body's boundary is cut into sectors by direction, the first centred on the body's x axis, the next to its left.
Each sector has rays that leave the boundary at right angles; the sector is in contact where one of its rays meets a
wall or another body within the collision radius, or starts inside another body. Sectors turn with the body.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbrl_model.errors import ModelError
from pbrl_model.geometry import check_polygon, mass_properties
from pbrl_model.transitions.data import turn

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

SECTORS = 4  # thesis table 3, n_s
RAYS = 10  # thesis table 3, n_tps
RADIUS = 0.2  # [m] thesis table 3, epsilon_c = 20, its lengths taken to be centimetres


class ContactSectors:
    """Contact predicates of bodies among walls.

    Args:
        footprints: of each body, (k, 2) [m] in its frame.
        walls: (w, 2, 2) ends of segments in world [m].
        sectors: n_s, of each body.
        rays: n_tps, of each sector.
        radius: epsilon_c [m].

    Raises:
        ModelError: a footprint, the walls or an option is not usable.
    """

    def __init__(
        self,
        footprints: Sequence[ArrayLike],
        walls: ArrayLike = (),
        sectors: int = SECTORS,
        rays: int = RAYS,
        radius: float = RADIUS,
    ) -> None:
        if sectors < 1 or rays < 1:
            raise ModelError(f"sectors: expected at least one sector and one ray, got {sectors} and {rays}")
        if not (math.isfinite(radius) and radius > 0.0):
            raise ModelError(f"sectors: expected a collision radius above zero [m], got {radius!r}")
        self.sectors = sectors
        self._walls = _segments(walls)
        self._outlines = [check_polygon(points) - mass_properties(points).com for points in footprints]
        self._rays = [_outward_rays(outline, sectors, rays, radius) for outline in self._outlines]
        self._reach = np.array([np.linalg.norm(outline, axis=1).max() for outline in self._outlines])
        self._radius = radius

    @property
    def bodies(self) -> int:
        """Number of bodies K."""
        return len(self._outlines)

    def contacts(self, state: Array) -> Bools:
        """Return (n, K, n_s) whether each sector is in contact in states (n, K, 6).

        Raises:
            ModelError: the states are of another number of bodies.
        """
        if state.ndim != 3 or state.shape[1:] != (self.bodies, 6):
            raise ModelError(f"sectors: expected states of shape (n, {self.bodies}, 6), got {state.shape}")
        out = np.zeros((len(state), self.bodies, self.sectors), dtype=bool)
        for body in range(self.bodies):
            out[:, body] = self._against_walls(state[:, body], body)
            for other in range(self.bodies):
                if other != body:
                    out[:, body] |= self._against_body(state[:, body], body, state[:, other], other)
        return out

    def conditions(self, state: Array) -> Bools:
        """Return (n, K n_s): the boolean string of every relation (thesis section 5.2.3)."""
        return self.contacts(state).reshape(len(state), -1)

    def _against_walls(self, pose: Array, body: int) -> Bools:
        hit = np.zeros((len(pose), self.sectors), dtype=bool)
        near = _near(pose[:, :2], self._walls, self._reach[body] + self._radius)
        if near.any():
            rays = _placed(self._rays[body], pose[near])
            hit[near] = _meet(rays, np.broadcast_to(self._walls, (len(rays), *self._walls.shape)), self.sectors)
        return hit

    def _against_body(self, pose: Array, body: int, other_pose: Array, other: int) -> Bools:
        hit = np.zeros((len(pose), self.sectors), dtype=bool)
        apart = np.linalg.norm(pose[:, :2] - other_pose[:, :2], axis=1)
        near = apart < self._reach[body] + self._reach[other] + self._radius
        if near.any():
            rays = _placed(self._rays[body], pose[near])
            corners = _placed(self._outlines[other], other_pose[near])
            edges = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)
            hit[near] = _meet(rays, edges, self.sectors) | _inside(rays[:, :, 0], edges, self.sectors)
        return hit


def _segments(walls: ArrayLike) -> Array:
    segments = np.asarray(walls, dtype=float)
    if segments.size == 0:
        return np.empty((0, 2, 2))
    if segments.ndim != 3 or segments.shape[1:] != (2, 2) or not np.isfinite(segments).all():
        raise ModelError(f"sectors: expected walls as finite segments (w, 2, 2), got shape {segments.shape}")
    return segments


def _outward_rays(outline: Array, sectors: int, rays: int, radius: float) -> Array:
    """Return (n_s * n_tps, 2, 2): from points of a counter-clockwise outline, `radius` along the edges' normals.

    The points lie in directions from the middle of the bounding box, at equal angles once the box is made a square:
    four sectors are then the four sides. A direction that misses a hollow body has a ray of no length.
    """
    low, high = outline.min(axis=0), outline.max(axis=0)
    count = sectors * rays
    angle = (np.arange(count) + 0.5) * 2.0 * np.pi / count - np.pi / sectors
    direction = np.column_stack([np.cos(angle), np.sin(angle)]) * (high - low)
    edge = np.roll(outline, -1, axis=0) - outline
    gap = outline - (low + high) / 2.0
    area = _cross(direction[:, None], edge)
    scale = 1.0 / np.where(area == 0.0, np.inf, area)
    along, on_edge = _cross(gap, edge) * scale, _cross(gap, direction[:, None]) * scale
    along = np.where((area != 0.0) & (on_edge >= 0.0) & (on_edge <= 1.0), along, -np.inf)
    last = along.argmax(axis=1)
    reach = along[np.arange(count), last]
    met = reach > 0.0
    start = (low + high) / 2.0 + np.where(met, reach, 0.0)[:, None] * direction
    normal = np.column_stack([edge[:, 1], -edge[:, 0]]) / np.linalg.norm(edge, axis=1, keepdims=True)
    return np.stack([start, start + np.where(met, radius, 0.0)[:, None] * normal[last]], axis=1)


def _placed(points: Array, pose: Array) -> Array:
    """Return (n, *points.shape): points in a body's frame about its centre of mass, at poses (n, >= 3) in world."""
    flat = points.reshape(-1, 2)
    repeated = np.repeat(pose[:, 2], len(flat))
    turned = turn(np.tile(flat, (len(pose), 1)), repeated).reshape(len(pose), len(flat), 2)
    return (turned + pose[:, None, :2]).reshape(len(pose), *points.shape)


def _near(points: Array, segments: Array, distance: float) -> Bools:
    """Return (n,) whether any of the segments (w, 2, 2) comes within a distance of points (n, 2)."""
    if not len(segments):
        return np.zeros(len(points), dtype=bool)
    start, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    length = np.maximum((along * along).sum(axis=1), 1e-300)
    share = np.clip(((points[:, None] - start) * along).sum(axis=2) / length, 0.0, 1.0)
    gap = points[:, None] - start - share[..., None] * along
    return ((gap * gap).sum(axis=2) <= distance * distance).any(axis=1)


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _meet(rays: Array, edges: Array, sectors: int) -> Bools:
    """Return (n, n_s) whether a ray of the sector (n, R, 2, 2) crosses an edge (n, E, 2, 2)."""
    start, along = rays[:, :, None, 0], (rays[:, :, 1] - rays[:, :, 0])[:, :, None]
    first, edge = edges[:, None, :, 0], (edges[:, :, 1] - edges[:, :, 0])[:, None]
    area = _cross(along, edge)
    parallel = area == 0.0
    scale = 1.0 / np.where(parallel, 1.0, area)
    gap = first - start
    on_ray, on_edge = _cross(gap, edge) * scale, _cross(gap, along) * scale
    hit = ~parallel & (on_ray >= 0.0) & (on_ray <= 1.0) & (on_edge >= 0.0) & (on_edge <= 1.0)
    return hit.any(axis=2).reshape(len(rays), sectors, -1).any(axis=2)


def _inside(points: Array, edges: Array, sectors: int) -> Bools:
    """Return (n, n_s) whether a point of the sector (n, R, 2) lies inside the closed outline of edges (n, E, 2, 2)."""
    x, y = points[:, :, None, 0], points[:, :, None, 1]
    (ax, ay), (bx, by) = (np.moveaxis(edges[:, None, :, end], -1, 0) for end in (0, 1))
    spans = (ay > y) != (by > y)
    crossing = ax + (y - ay) * (bx - ax) / np.where(spans, by - ay, 1.0)
    odd = (spans & (x < crossing)).sum(axis=2) % 2 == 1
    return odd.reshape(len(points), sectors, -1).any(axis=2)
