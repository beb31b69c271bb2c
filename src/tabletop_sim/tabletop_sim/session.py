"""One run of a desk: commands in, physics, observations out. No ROS, no threads, no wall clock.

Same scene, same seed and same commands at the same steps: same observations, bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np
from numpy.typing import NDArray

from bullet_sim.client import STEP, BulletClient
from bullet_sim.observations import CameraPicture, Observation, TagReading
from tabletop_sim.arm import Arm
from tabletop_sim.scene import DeskScene
from tabletop_sim.sensing import Sensing
from tabletop_sim.world import DeskWorld

Array = NDArray[np.float64]


class DeskSession:
    """A desk and an arm, one physics step at a time.

    Attributes:
        world: table and items.
        arm: beside them.
        step_time: physics step [s].
    """

    def __init__(self, scene: DeskScene, *, seed: int, gui: bool = False, step: float = STEP) -> None:
        """Build it.

        Args:
            scene: what to build.
            seed: of every random draw. World and sensors draw from streams of their own.
            gui: open Bullet's window.
            step: physics step [s].

        Raises:
            SimError: a scene that cannot be built, or a bad step.
        """
        world_seed, sensor_seed = np.random.SeedSequence(seed).spawn(2)
        self._client = BulletClient(step=step, gui=gui)
        try:
            self.world = DeskWorld(self._client, scene, np.random.default_rng(world_seed))
            self.arm = Arm(self._client, scene.arm)
            self._sensing = Sensing(self._client, self.world, self.arm, np.random.default_rng(sensor_seed))
        except BaseException:
            self._client.close()
            raise
        if self._client.window is not None:
            self._client.window.look_at((0.0, 0.0, 0.0), 1.2, 0.4, -0.9)
        self.step_time = step
        self._news: list[Observation] = self._sensing.latched()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self._client.time

    def command_joints(self, angles: Sequence[float]) -> None:
        """Ask for the angles (4,) [rad] of the arm's joints; they hold until others are asked for.

        Raises:
            TabletopError: not four finite angles within their limits; those before stay in force.
        """
        self.arm.command(angles)

    def step(self) -> list[Observation]:
        """Advance by one physics step; give what is published now, the first time what is known from the start too."""
        self._advance()
        news, self._news = self._news, []
        return news + self._sensing.observe(self.time)

    def follow(self, joints: Array, period: float) -> None:
        """Let the arm follow angles (k, 4) [rad], one each period [s], without observations: many times faster.

        Raises:
            TabletopError: see `command_joints`.
        """
        for row in joints:
            self.command_joints(row)
            for _ in range(round(period / self.step_time)):
                self._advance()

    def look(self) -> CameraPicture | list[TagReading]:
        """Look at the table now: a picture or poses, as the scene says."""
        rendered = self.world.scene.vision.source == "rendered"
        return self._sensing.picture(self.time) if rendered else self._sensing.poses(self.time)

    def photograph(self, eye: Sequence[float], target: Sequence[float], width: int, height: int) -> NDArray[np.uint8]:
        """Take a picture (height, width, 3) of the desk from anywhere: for people; see `BulletClient.photograph`."""
        return self._client.photograph(eye, target, width=width, height=height)

    def close(self) -> None:
        """End the Bullet client; a second call does nothing."""
        self._client.close()

    def _advance(self) -> None:
        self.arm.drive()
        self.world.step()
