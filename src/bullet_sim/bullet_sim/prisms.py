"""Blocks and fixtures in Bullet: an outline, extruded. An outline with bays is put together from triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from shapely import constrained_delaunay_triangles
from shapely.geometry import Polygon

from bullet_sim.catalogue import Block, Fixture
from bullet_sim.client import BulletClient, yaw_quaternion
from bullet_sim.furniture import Furniture
from bullet_sim.quiet import bullet

Array = NDArray[np.float64]

FIXTURE_FRICTION = 0.6
"""Coulomb coefficient of walls and built-in furniture."""


def build_prism(client: BulletClient, name: str, prism: Block | Fixture, *, mass: float | None = None) -> Furniture:
    """Put a prism into the room: a block of its mass, or a fixture that never moves.

    Args:
        client: the world.
        name: of the body.
        prism: what it is like.
        mass: true mass of a block [kg]; default: the nominal one.
    """
    block = isinstance(prism, Block)
    weight = (prism.nominal_mass if mass is None else mass) if isinstance(prism, Block) else 0.0
    colour = (0.42, 0.55, 0.68, 1.0) if block else (0.70, 0.70, 0.72, 1.0)
    bottom, top = prism.levels
    parts, thickness, middle = convex_parts(prism.footprint), top - bottom, (bottom + top) / 2
    centres = [np.array(Polygon(part).centroid.coords[0]) for part in parts]
    areas = np.array([Polygon(part).area for part in parts])
    masses = weight * areas / areas.sum()
    shapes = [_shapes(client, part - centre, thickness, colour) for part, centre in zip(parts, centres, strict=True)]
    x, y, theta = prism.pose
    cos, sin = np.cos(theta), np.sin(theta)
    base = np.array([x, y]) + np.array([[cos, -sin], [sin, cos]]) @ centres[0]
    others = range(1, len(parts))
    body = client.api.createMultiBody(
        baseMass=float(masses[0]),
        baseCollisionShapeIndex=shapes[0][0],
        baseVisualShapeIndex=shapes[0][1],
        basePosition=[*base, middle],
        baseOrientation=yaw_quaternion(theta).tolist(),
        linkMasses=[float(masses[part]) for part in others],
        linkCollisionShapeIndices=[shapes[part][0] for part in others],
        linkVisualShapeIndices=[shapes[part][1] for part in others],
        linkPositions=[[*(centres[part] - centres[0]), 0] for part in others],
        linkOrientations=[[0, 0, 0, 1] for _ in others],
        linkInertialFramePositions=[[0, 0, 0] for _ in others],
        linkInertialFrameOrientations=[[0, 0, 0, 1] for _ in others],
        linkParentIndices=[0 for _ in others],
        linkJointTypes=[bullet.JOINT_FIXED for _ in others],
        linkJointAxis=[[0, 0, 1] for _ in others],
    )
    client.add(name, body)
    friction = prism.friction if isinstance(prism, Block) else FIXTURE_FRICTION
    for link, (part, centre) in enumerate(zip(parts, centres, strict=True), start=-1):
        options = {"lateralFriction": friction, "rollingFriction": 0, "spinningFriction": 0, "restitution": 0}
        if block:
            options["localInertiaDiagonal"] = _inertia(part - centre, thickness, float(masses[link + 1])).tolist()
        client.api.changeDynamics(body, link, **options)
    return Furniture(client, name, prism, np.array([*-centres[0], middle]))


def convex_parts(outline: Array) -> list[Array]:
    """Split an outline (k, 2) into convex ones; a convex outline comes back alone."""
    polygon = Polygon(outline)
    if polygon.convex_hull.area - polygon.area < 1e-9:
        return [np.asarray(outline, dtype=float)]
    triangles = constrained_delaunay_triangles(polygon).geoms
    return [np.array(triangle.exterior.coords[:-1]) for triangle in triangles]


def _shapes(client: BulletClient, outline: Array, height: float, colour: tuple[float, ...]) -> tuple[int, int]:
    """Make collision and visual shape of a convex prism about its middle."""
    corners = [[x, y, z] for z in (-height / 2, height / 2) for x, y in outline]
    count = len(outline)
    caps = [face for i in range(1, count - 1) for face in ((0, i + 1, i), (count, count + i, count + i + 1))]
    sides = [
        face
        for i, j in zip(range(count), [*range(1, count), 0], strict=True)
        for face in ((i, j, count + j), (i, count + j, count + i))
    ]
    faces = (*caps, *sides)
    collision = client.api.createCollisionShape(bullet.GEOM_MESH, vertices=corners)
    visual = client.api.createVisualShape(  # corners of its own for each face, or the renderer rounds the edges
        bullet.GEOM_MESH,
        vertices=[corners[index] for face in faces for index in face],
        indices=list(range(3 * len(faces))),
        rgbaColor=colour,
    )
    return int(collision), int(visual)


def _inertia(outline: Array, height: float, mass: float) -> Array:
    """Give the diagonal (3,) of the inertia about the middle of a uniform prism with an outline about its centroid."""
    x, y = outline.T
    x_next, y_next = np.roll(x, -1), np.roll(y, -1)
    cross = x * y_next - x_next * y
    area = cross.sum() / 2
    xx = float(np.sum(cross * (x * x + x * x_next + x_next * x_next)) / 12 / area)
    yy = float(np.sum(cross * (y * y + y * y_next + y_next * y_next)) / 12 / area)
    return mass * np.array([yy + height**2 / 12, xx + height**2 / 12, xx + yy])
