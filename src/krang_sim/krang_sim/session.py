"""One run of Krang in a scene: commands in, physics, observations out. No ROS, no threads, no wall clock.

Same scene, same seed and same commands at the same steps: same observations, bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np

from bullet_sim.client import STEP, BulletClient
from bullet_sim.errors import SimError
from bullet_sim.fence import Fence, Watch
from bullet_sim.scene import Posture as PostureSettings
from bullet_sim.scene import Scene
from bullet_sim.window import Window
from bullet_sim.world import BodyTruth, World
from krang_sim.commands import CommandWatchdog
from krang_sim.grippers import GraspOutcome, Grippers, no_such_side
from krang_sim.observations import GraspState, Observation
from krang_sim.postures import Posture, mirrored, posture
from krang_sim.robot import BODY_JOINTS, SIDES, Krang
from krang_sim.sensing import Sensing
from krang_sim.tag_cameras import ReadTags

OVERLAP = 0.005  # [m] a body that reaches further than this into the robot stands in its place


class KrangSession:
    """Krang and furniture, one physics step at a time.

    Attributes:
        world: the scene in Bullet.
        robot: the robot in it.
        tagged: names of the bodies that wear a tag.
        fence: about what may not be entered; None: there is nothing.
        cameras: how many overhead cameras give pictures; none where tags are made by their noise.
    """

    def __init__(
        self, scene: Scene, *, seed: int, gui: bool = False, step: float = STEP, read_tags: ReadTags | None = None
    ) -> None:
        """Build the scene and put the robot into it.

        Args:
            scene: what to build, concealed part included.
            seed: of every random draw. World and sensors draw from streams of their own.
            gui: open Bullet's window.
            step: physics step [s].
            read_tags: finds tags in the pictures of a scene that has them rendered; None: pictures are given out.

        Raises:
            SimError: a scene that cannot be built, a body where the robot stands, an unknown posture, a bad step.
        """
        world_seed, sensor_seed = np.random.SeedSequence(seed).spawn(2)
        self._client = BulletClient(step=step, gui=gui)
        try:
            self.world = World(self._client, scene, np.random.default_rng(world_seed))
            self.robot = Krang(self._client, scene.robot.pose, _start_posture(scene.robot.posture))
            self._check_start(scene)
            self._sensing = Sensing(self.world, self.robot, np.random.default_rng(sensor_seed), read_tags)
        except BaseException:
            self._client.close()
            raise
        if self._client.window is not None:
            self._aim(self._client.window, scene)
        self.tagged, self.cameras = self._sensing.tagged, self._sensing.cameras
        self._commands = CommandWatchdog({"base": 2, "left": 7, "right": 7, "body": 2})
        self._grippers = Grippers(self.world, self.robot)
        self.fence = Fence(self._client, self.robot, scene, self.world.furniture) if scene.keep_out else None
        self._watch = Watch(self.fence)
        self._news: list[Observation] = self._sensing.latched()

    def _check_start(self, scene: Scene) -> None:
        """Raise SimError where a body of the scene reaches into the robot."""
        for name in scene.bodies:
            near = self._client.api.getClosestPoints(self.robot.number, self._client.bodies[name], 0.0)
            if near and min(point[8] for point in near) < -OVERLAP:
                raise SimError(
                    f"bodies.{name}: expected a place clear of the robot, which stands at {list(scene.robot.pose)}; "
                    f"got pose {list(scene.bodies[name].pose)}"
                )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self._client.time

    def command_base(self, v: float, w: float) -> None:
        """Ask for a speed forward [m/s] and a rate of turning left [rad/s]; holds for `commands.TIMEOUT`.

        Raises:
            KrangError: a value that is not finite; as for the other commands, the one before stays in force.
        """
        self._commands.set("base", (v, w), self.time)

    def command_arm(self, side: str, velocity: Sequence[float]) -> None:
        """Ask for the velocities (7,) [rad/s] of an arm's joints; holds for `commands.TIMEOUT`."""
        self._commands.set(_known_side(side), velocity, self.time)

    def command_body(self, waist: float, torso: float) -> None:
        """Ask for the velocities [rad/s] of waist and torso; holds for `commands.TIMEOUT`."""
        self._commands.set("body", (waist, torso), self.time)

    def grasp(self, side: str, object_name: str = "") -> GraspOutcome:
        """Close the gripper `side` on `object_name`, or, without a name, on the edge between its plates.

        Returns:
            Success, or a refusal with the distance to the nearest edge.
        """
        return self._told(self._grippers.grasp(side, object_name))

    def release(self, side: str) -> GraspOutcome:
        """Open the gripper `side`."""
        return self._told(self._grippers.release(side))

    @staticmethod
    def _aim(window: Window, scene: Scene) -> None:
        """Look at the whole room, over the robot's shoulder."""
        outline = np.array(scene.room.outline)
        low, high = outline.min(axis=0), outline.max(axis=0)
        size = float(np.hypot(*(high - low)))
        window.look_at((*(low + high) / 2, 0.5), 0.55 * size, scene.robot.pose[2] + 0.5, -0.8)

    def _told(self, outcome: GraspOutcome) -> GraspOutcome:
        if outcome.success:
            self._tell_grasps()
        return outcome

    def _tell_grasps(self) -> None:
        self._news.append(GraspState(self.time, self._grippers.holds()))

    def step(self) -> list[Observation]:
        """Advance by one physics step.

        Returns:
            What is published now, in the order of their topics' rates; with the first step also what is known from
            the start (description, scene, static frames, no grasps), stamped zero.
        """
        now = self.time
        base = self._commands.current("base", now)
        allowed = self._watch.allowed(now, np.array([base[0], 0.0, base[1]]), self.held)
        self.robot.command_base(*(base if allowed.base else np.zeros(2)))
        for first, group in (
            (BODY_JOINTS[0], "body"),
            *((f"{side[0].upper()}J1", side) for side in SIDES),
        ):
            wanted = self._commands.current(group, now)
            self.robot.command_joints(first, wanted if allowed.joints else np.zeros(len(wanted)))
        self.robot.drive()
        self._grippers.apply()
        self.world.step()
        if self._grippers.drop_lost():
            self._tell_grasps()
        news, self._news = self._news, []
        return news + self._sensing.observe(self.time)

    @property
    def held(self) -> tuple[str, ...]:
        """Names of what the grippers hold."""
        return tuple(hold.object for hold in self._grippers.holds())

    @property
    def halted(self) -> str:
        """Say that the fence holds the robot back, in a sentence; empty where it does not."""
        return self._watch.halted

    def truth(self, name: str) -> BodyTruth:
        """Give a body's true pose and velocity: for scoring only, never for a topic.

        Raises:
            SimError: no body has this name.
        """
        return self.world.truth(name)

    def close(self) -> None:
        """End the Bullet client; a second call does nothing."""
        self._client.close()


def _known_side(side: str) -> str:
    if side not in SIDES:
        raise no_such_side(side)
    return side


def _start_posture(wanted: str | PostureSettings) -> Posture:
    if isinstance(wanted, str):
        return posture(wanted)
    if wanted.right is None:
        return mirrored(wanted.waist, wanted.left, wanted.torso)
    return Posture(wanted.waist, wanted.torso, wanted.left, wanted.right)
