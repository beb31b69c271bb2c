"""Overhead cameras of Krang's room: pictures with printed tags in them, and, where a reader is given, what it reads."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from bullet_sim.cameras import Camera, ceiling_cameras
from bullet_sim.client import Pose
from bullet_sim.photographer import Photographer
from bullet_sim.sensors import SLACK, Ticker
from bullet_sim.tag_plates import TagPlates
from bullet_sim.tag_sheet import load_tag_sheet, worn_tags
from bullet_sim.world import World
from krang_sim.errors import KrangError
from krang_sim.observations import CameraPicture, TagReading
from krang_sim.robot import SIDES

Array = NDArray[np.float64]

ReadTags: TypeAlias = Callable[[Sequence[CameraPicture]], Sequence[TagReading]]
"""Finds tags in the pictures of one moment."""


class TagCameras:
    """The cameras of a room: they take pictures at the tags' rate, which are there a latency later.

    Attributes:
        cameras: by number.
    """

    def __init__(self, world: World, tagged: Sequence[str], rng: Generator, read: ReadTags | None = None) -> None:
        """Hang the cameras and glue the tags on.

        Args:
            world: the room.
            tagged: names of the movable bodies, in the order of the scene.
            rng: draws calibration errors and the sensors' noise.
            read: finds the tags; None: pictures are given as they are.

        Raises:
            SimError: a sheet of tags that cannot be used.
            KrangError: a concealed delay of one tag: cameras show all tags at once.
        """
        scene = world.scene
        late = [stream for stream in scene.concealed.time_offset if stream not in SIDES]
        if late:
            raise KrangError(
                f"concealed.time_offset.{late[0]}: expected tags from noise where one is late, got rendered ones"
            )
        lens_rng, noise_rng = rng.spawn(2)
        sheet = load_tag_sheet()
        plates = TagPlates(world.client, sheet, worn_tags(sheet, tagged))
        self.cameras = ceiling_cameras(scene.sensors.cameras, scene.room.outline, lens_rng)
        self._photographer = Photographer(world.client, self.cameras, plates, scene.sensors.cameras, noise_rng)
        self._plates, self._read = plates, read
        self._glued = scene.concealed.pose_bias
        self._ticker, self._latency = Ticker(scene.sensors.tags.rate), scene.sensors.tags.latency
        self._underway: list[tuple[float, list[CameraPicture]]] = []

    def capture_due(self, time: float) -> bool:
        """Say whether pictures are taken at this step; if so, call `capture`."""
        return self._ticker.due(time)

    def capture(self, time: float, tags: Mapping[str, Pose]) -> None:
        """Take a picture with every camera.

        Args:
            time: now [s].
            tags: true pose of the frame that each tag marks, by name.
        """
        glued = {name: self._glued[name].seen(tags[name]) for name in self._glued if name in tags}
        self._plates.move({**tags, **glued})
        pictures = [
            _picture(time, camera, image) for camera, image in zip(self.cameras, self._photographer.take(), strict=True)
        ]
        self._underway.append((time + self._latency, pictures))

    def deliver(self, time: float) -> list[CameraPicture] | list[TagReading]:
        """Give the pictures whose latency has passed, or what was read in them, oldest first."""
        arrived = [pictures for due, pictures in self._underway if due <= time + SLACK]
        self._underway = self._underway[len(arrived) :]
        if self._read is None:
            return [picture for pictures in arrived for picture in pictures]
        return [reading for pictures in arrived for reading in self._read(pictures)]


def _picture(time: float, camera: Camera, image: NDArray[np.uint8]) -> CameraPicture:
    """Give a picture with what is told of its camera, which is not where it truly hangs."""
    told = camera.told
    return CameraPicture(time, camera.number, image, camera.matrix, camera.distortion, told.position, told.quaternion)
