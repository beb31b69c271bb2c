"""Printed tags in Bullet: textured plates without mass that nothing can touch, carried where their bodies go."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bullet_sim.client import BulletClient, Pose, multiply
from bullet_sim.errors import SimError
from bullet_sim.quiet import bullet
from bullet_sim.tag_sheet import TagMount, TagSheet

Array = NDArray[np.float64]

TEXELS = 40
"""Of the texture along each side of a tag's cell."""


def tag_image(sheet: TagSheet, number: int) -> NDArray[np.uint8]:
    """Draw a tag with its white margin.

    Args:
        sheet: says of which family, and how wide a margin.
        number: id of the tag.

    Returns:
        (n, n) grey levels, the upper edge first.
    """
    cells = sheet.family.markerSize + 2
    inner = cells * TEXELS
    margin = round(inner * sheet.quiet)
    image = np.full((inner + 2 * margin,) * 2, 255, np.uint8)
    image[margin:-margin, margin:-margin] = cv2.aruco.generateImageMarker(sheet.family, number, inner, borderBits=1)
    return image


class TagPlates:
    """The plates of a room.

    Attributes:
        names: of the bodies that wear some.
    """

    def __init__(self, client: BulletClient, sheet: TagSheet, worn: Mapping[str, tuple[TagMount, ...]]) -> None:
        """Make the plates, in the origin; `move` puts them where they belong.

        Args:
            client: the world.
            sheet: what tags look like.
            worn: mounts by body.

        Raises:
            SimError: Bullet could not read a texture.
        """
        self._client, self._mounts = client, dict(worn)
        self.names = tuple(worn)
        self._half = {mount.id: mount.size * (0.5 + sheet.quiet) for each in worn.values() for mount in each}
        with tempfile.TemporaryDirectory() as folder:
            self._plates = {
                mount.id: self._make(mount, tag_image(sheet, mount.id), Path(folder))
                for mounts in worn.values()
                for mount in mounts
            }
        self._poses: dict[int, Pose] = {}

    def _make(self, mount: TagMount, image: NDArray[np.uint8], folder: Path) -> int:
        file = folder / f"tag_{mount.id}.png"
        cv2.imwrite(str(file), cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
        half, api = self._half[mount.id], self._client.api
        shape = api.createVisualShape(
            bullet.GEOM_MESH,
            vertices=[[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]],
            indices=[0, 1, 2, 0, 2, 3],
            uvs=[[0, 0], [1, 0], [1, 1], [0, 1]],
            normals=[[0, 0, 1]] * 4,
            rgbaColor=[1, 1, 1, 1],
        )
        texture = api.loadTexture(str(file))
        if texture < 0:
            raise SimError(
                f"tag {mount.id}: expected Bullet to read its texture, it did not; check the temporary folder"
            )
        body = int(api.createMultiBody(baseMass=0, baseCollisionShapeIndex=-1, baseVisualShapeIndex=shape))
        api.changeVisualShape(body, -1, textureUniqueId=texture)
        return body

    def move(self, bodies: Mapping[str, Pose]) -> None:
        """Carry the plates of bodies where those are; plates of other bodies stay.

        Args:
            bodies: pose of each body's frame in `world`, by name.
        """
        for name, pose in bodies.items():
            for mount in self._mounts.get(name, ()):
                place = Pose(pose.point(mount.position), multiply(pose.quaternion, np.array(mount.quaternion)))
                self._poses[mount.id] = place
                self._client.api.resetBasePositionAndOrientation(
                    self._plates[mount.id], place.position.tolist(), place.quaternion.tolist()
                )

    def outlines(self) -> list[tuple[Pose, Array]]:
        """Give the pose of each plate that was moved, and its corners (4, 3) [m] in `world`."""
        out = []
        for number, pose in self._poses.items():
            half = self._half[number]
            local = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
            out.append((pose, pose.position + local @ pose.matrix.T))
        return out
