"""A person's body in Bullet: a head, an elliptic trunk, and two legs that swing, which a laser low over the floor sees.

It has no mass: nothing pushes it, it stands where it is put.
"""

from __future__ import annotations

import math

import numpy as np

from bullet_sim.casters import LinkTable
from bullet_sim.client import BulletClient, yaw_quaternion
from bullet_sim.quiet import bullet
from pr2_cart_sim.scene import Person

LEG_SHARE = 0.48
"""Height of the hips as a share of the whole."""
LEG_RADIUS = 0.07
"""[m]"""
STRIDE = 0.30
"""How far a foot swings ahead of the hip at full speed [m]."""
CADENCE = 2 * math.pi / 1.4
"""Phase of the gait per way walked [rad/m]: a double step is 1.4 m."""
HEAD_RADIUS = 0.11
"""[m]"""
CORNERS = 16
"""Of the prism that stands for an ellipse."""
SHIRTS = (
    (0.75, 0.30, 0.28, 1),
    (0.26, 0.45, 0.70, 1),
    (0.30, 0.58, 0.38, 1),
    (0.78, 0.62, 0.25, 1),
    (0.5, 0.4, 0.6, 1),
)
SKIN = (0.86, 0.70, 0.58, 1)
TROUSERS = (0.22, 0.24, 0.32, 1)


class PersonBody:
    """One person's body.

    Attributes:
        number: Bullet's.
    """

    def __init__(self, client: BulletClient, name: str, person: Person, which: int) -> None:
        """Make the body in the origin; `put` puts it where it belongs.

        Args:
            client: the world.
            name: of the person, and of the body.
            person: their size.
            which: chooses the colour of the shirt.
        """
        api = client.api
        self._api, self._person = api, person
        low = LEG_SHARE * person.height if person.legs else 0.0
        shoulders = max(person.height - 2.2 * HEAD_RADIUS, low + 0.1)
        angles = 2 * math.pi * np.arange(CORNERS) / CORNERS
        ring = np.column_stack([person.depth * np.cos(angles), person.radius * np.sin(angles)])
        corners = [[*place, z] for z in (low, shoulders) for place in ring.tolist()]
        hull = api.createCollisionShape(bullet.GEOM_MESH, vertices=corners)
        look = api.createVisualShape(
            bullet.GEOM_MESH, vertices=corners, indices=_faces(), rgbaColor=SHIRTS[which % len(SHIRTS)]
        )
        links = LinkTable()
        if person.legs:
            sizes = {"radius": LEG_RADIUS}
            for side in (1, -1):
                felt = api.createCollisionShape(bullet.GEOM_CYLINDER, height=low, **sizes)
                seen = api.createVisualShape(bullet.GEOM_CYLINDER, length=low, rgbaColor=TROUSERS, **sizes)
                place = (0, side * max(person.radius / 2, LEG_RADIUS), low / 2)
                links.add(0.0, (felt, seen), place, -1, (1, 0, 0), joint=bullet.JOINT_PRISMATIC)
        head = api.createCollisionShape(bullet.GEOM_SPHERE, radius=HEAD_RADIUS)
        face = api.createVisualShape(bullet.GEOM_SPHERE, radius=HEAD_RADIUS, rgbaColor=SKIN)
        links.add(0.0, (head, face), (0, 0, max(person.height, shoulders) - HEAD_RADIUS), -1, (0, 0, 1), rigid=True)
        self.number = int(
            api.createMultiBody(baseMass=0, baseCollisionShapeIndex=hull, baseVisualShapeIndex=look, **links.columns)
        )
        client.add(name, self.number)

    def put(self, x: float, y: float, heading: float, walked: float, swing: float) -> None:
        """Put the body somewhere.

        Args:
            x: [m] in `world`.
            y: [m].
            heading: [rad].
            walked: way so far [m], which is the phase of the gait.
            swing: 1 at full speed, 0 when standing.
        """
        self._api.resetBasePositionAndOrientation(self.number, [x, y, 0.0], yaw_quaternion(heading).tolist())
        if self._person.legs:
            ahead = swing * STRIDE / 2 * math.sin(CADENCE * walked)
            for leg, way in enumerate((ahead, -ahead)):
                self._api.resetJointState(self.number, leg, way)


def _faces() -> list[int]:
    """Give triangles over the corners of the prism: lower ring first."""
    n = CORNERS
    sides = [(i, (i + 1) % n, n + (i + 1) % n, i, n + (i + 1) % n, n + i) for i in range(n)]
    caps = [(0, i + 1, i, n, n + i, n + i + 1) for i in range(1, n - 1)]
    return [corner for face in (*sides, *caps) for corner in face]
