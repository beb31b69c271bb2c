"""What the tabletop reports: clock, joints, frames, and the items as pictures or as poses with noise."""

from __future__ import annotations

import math

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from bullet_sim.cameras import ceiling_cameras
from bullet_sim.client import BulletClient, Pose, yaw_quaternion
from bullet_sim.observations import (
    CameraPicture,
    ClockTick,
    JointStates,
    KnownBody,
    KnownScene,
    Observation,
    RobotDescription,
    TagReading,
    Transforms,
)
from bullet_sim.photographer import Photographer
from bullet_sim.sensors import Ticker
from tabletop_sim.arm import JOINTS, Arm, description_path
from tabletop_sim.scene import DeskScene
from tabletop_sim.world import DeskWorld

Array = NDArray[np.float64]

CLOCK_RATE = 100.0
JOINT_RATE = 100.0


class _NoPlates:
    """Nothing wears a tag: pictures are whole."""

    def outlines(self) -> list[tuple[Pose, Array]]:
        """Give none."""
        return []


class Sensing:
    """Truth goes in, readings come out.

    Args:
        client: the world.
        world: the desk in it.
        arm: beside it.
        rng: of all draws.
    """

    def __init__(self, client: BulletClient, world: DeskWorld, arm: Arm, rng: Generator) -> None:
        self._world, self._arm, scene = world, arm, world.scene
        camera_rng, picture_rng, self._noise = rng.spawn(3)
        half = np.array([scene.table.length, scene.table.width]) / 2
        corners = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        self._camera = ceiling_cameras(scene.vision.camera, corners, camera_rng)[0]
        self._photographer = Photographer(client, [self._camera], _NoPlates(), scene.vision.camera, picture_rng)
        self._clock, self._joints = Ticker(CLOCK_RATE), Ticker(JOINT_RATE)
        self._vision = Ticker(scene.vision.rate)
        self._corners = corners

    def latched(self) -> list[Observation]:
        """Give what is known from the start."""
        scene = self._world.scene
        urdf = description_path().read_text(encoding="utf-8")
        x, y, theta = scene.arm
        told = self._camera.told
        fixed = Transforms(
            0.0,
            ("world", "world"),
            ("arm_base", self._camera.frame),
            np.array([[x, y, 0.0], told.position]),
            np.array([yaw_quaternion(theta), told.quaternion]),
            static=True,
        )
        return [RobotDescription(0.0, urdf), KnownScene(0.0, known_items(scene), self._corners), fixed]

    def observe(self, time: float) -> list[Observation]:
        """Give what is published at a time [s]."""
        news: list[Observation] = []
        if self._clock.due(time):
            news.append(ClockTick(time))
        if self._joints.due(time):
            position, velocity = self._arm.joint_state()
            names, places, turns = self._arm.link_poses()
            news.append(JointStates(time, JOINTS, position, velocity))
            news.append(Transforms(time, ("world",) * len(names), names, places, turns))
        if self._vision.due(time):
            rendered = self._world.scene.vision.source == "rendered"
            news += [self.picture(time)] if rendered else self.poses(time)
        return news

    def picture(self, time: float) -> CameraPicture:
        """Take a picture of the table."""
        told, image = self._camera.told, self._photographer.take()[0]
        camera = self._camera
        return CameraPicture(time, 0, image, camera.matrix, camera.distortion, told.position, told.quaternion)

    def poses(self, time: float) -> list[TagReading]:
        """Read the poses of all items that can be moved, with noise; one that fell off the table is not seen."""
        vision, readings = self._world.scene.vision, []
        for name, item in self._world.scene.items.items():
            draws = self._noise.normal(size=3)
            if item.obstacle or self._world.height(name) < 0.0:
                continue
            x, y, theta = self._world.pose(name) + draws * [vision.sigma_xy, vision.sigma_xy, vision.sigma_yaw]
            readings.append(TagReading(time, name, np.array([x, y, item.height]), yaw_quaternion(theta)))
        return readings


def known_items(scene: DeskScene) -> tuple[KnownBody, ...]:
    """Describe what everybody may know of the items: outline, height, whether they can be moved; no mass, no friction.

    Where they stand is for the camera to find out, but for obstacles, which are told.
    """
    found = []
    for name, item in scene.items.items():
        half = np.array([item.length, item.width]) / 2
        footprint = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        pose = np.array(item.pose) if item.obstacle else np.zeros(3)
        found.append(KnownBody(name, footprint, item.height, math.nan, not item.obstacle, pose, np.zeros((0, 2))))
    return tuple(found)
