"""What Krang and the overhead camera report, each at its own rate."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from bullet_sim.client import Pose, yaw_quaternion
from bullet_sim.concealed.sensing import tag_camera, wrist_sensor
from bullet_sim.sensors import TagReading as SeenTag
from bullet_sim.sensors import Ticker
from bullet_sim.world import World
from krang_sim.errors import KrangError
from krang_sim.frames import RobotFrames
from krang_sim.known import known_scene
from krang_sim.observations import (
    CameraPicture,
    ClockTick,
    GraspState,
    JointStates,
    Observation,
    Odometry,
    Outlines,
    RobotDescription,
    TagReading,
    Transforms,
    WristReading,
)
from krang_sim.robot import JOINTS, SIDES, Krang, WheelOdometry, description_path
from krang_sim.tag_cameras import ReadTags, TagCameras

Array = NDArray[np.float64]

CLOCK_RATE = 100.0
JOINT_RATE = 100.0
ODOMETRY_RATE = 50.0
MARKER_RATE = 5.0


class Sensing:
    """The robot's and the room's sensors, and the clock.

    Truth goes in, readings come out; nothing else of the simulation is published.

    Attributes:
        tagged: names of the bodies that wear a tag: those that can move.
    """

    def __init__(self, world: World, robot: Krang, rng: Generator, read_tags: ReadTags | None = None) -> None:
        """Set the sensors up; each draws from a stream of its own, spawned from `rng`.

        Args:
            world: the room.
            robot: in it.
            rng: of all draws.
            read_tags: finds tags in pictures, where the scene wants them rendered; None: pictures are published.

        Raises:
            SimError: rendered tags that cannot be, or a wrist that is faster than the physics.
            KrangError: a reader of pictures, and no pictures.
        """
        rendered = world.scene.sensors.tags.source == "rendered"
        if read_tags is not None and not rendered:
            raise KrangError("sensors.tags.source: expected rendered for a reader of pictures, got noise")
        camera_rng, *wrist_rngs = rng.spawn(1 + len(SIDES))
        self._world, self._robot = world, robot
        self._known = known_scene(world.scene, 0.0)
        self._bodies = {body.name: body for body in self._known.bodies}
        self.tagged = tuple(body.name for body in self._known.bodies if body.movable)
        self._camera = (
            TagCameras(world, self.tagged, camera_rng, read_tags) if rendered else tag_camera(world.scene, camera_rng)
        )
        self._wrists = {
            side: wrist_sensor(world.scene, side, wrist_rng, world.client.step_time)
            for side, wrist_rng in zip(SIDES, wrist_rngs, strict=True)
        }
        self._clock, self._joints = Ticker(CLOCK_RATE), Ticker(JOINT_RATE)
        self._odometer, self._markers = Ticker(ODOMETRY_RATE), Ticker(MARKER_RATE)
        self._odometry = WheelOdometry()
        self._frames = RobotFrames(world.client, robot)
        # What is built in wears no tag and stays where the scene says; the rest appears once its tag is seen.
        self._seen = {
            body.name: _planar_to_pose(body.pose, body.height) for body in self._known.bodies if not body.movable
        }

    def latched(self) -> list[Observation]:
        """Give what is known from the start, stamped zero: description, scene, static frames, no grasps."""
        return [
            RobotDescription(0.0, description_path().read_text(encoding="utf-8")),
            self._known,
            self._static_frames(),
            GraspState(0.0, ()),
        ]

    @property
    def cameras(self) -> int:
        """How many cameras publish pictures."""
        return len(self._camera.cameras) if isinstance(self._camera, TagCameras) else 0

    def _static_frames(self) -> Transforms:
        """Give the fixed joints, `odom` where the robot starts, and the cameras where their calibration has them."""
        start = _planar_to_pose(np.array(self._world.scene.robot.pose), 0.0)
        positions, quaternions = self._frames.in_parents()
        hung = self._camera.cameras if isinstance(self._camera, TagCameras) else ()
        return Transforms(
            0.0,
            ("world", *[parent for parent, _ in self._frames.fixed], *["world"] * len(hung)),
            ("odom", *[child for _, child in self._frames.fixed], *[camera.frame for camera in hung]),
            np.vstack([start[:3], positions, *[camera.told.position for camera in hung]]),
            np.vstack([start[3:], quaternions, *[camera.told.quaternion for camera in hung]]),
            static=True,
        )

    def observe(self, time: float) -> list[Observation]:
        """Read every sensor that is due at `time` [s]; call once after each physics step.

        Returns:
            Observations, the clock first.
        """
        seen: list[Observation] = []
        if self._clock.due(time):
            seen.append(ClockTick(time))
        if self._joints.due(time):
            seen.append(JointStates(time, JOINTS, *self._robot.joint_state()))
        if self._odometer.due(time):
            seen += self._read_odometry(time)
        seen += self._read_wrists(time)
        seen += self._read_tags(time)
        if self._markers.due(time):
            seen.append(Outlines(time, self._bodies, dict(self._seen)))
        return seen

    def _read_odometry(self, time: float) -> list[Observation]:
        self._odometry.update(time, self._robot.joint_state()[0][:2])
        pose = self._odometry.pose.copy()
        moving = self._frames.moving
        positions, quaternions = self._frames.in_base()
        base = _planar_to_pose(pose, 0.0)
        frames = Transforms(
            time,
            ("odom", *["base"] * len(moving)),
            ("base", *moving),
            np.vstack([base[:3], positions]),
            np.vstack([base[3:], quaternions]),
        )
        return [Odometry(time, pose, self._odometry.twist.copy()), frames]

    def _read_wrists(self, time: float) -> list[Observation]:
        seen: list[Observation] = []
        for side, wrist in self._wrists.items():
            reading = wrist.measure(time, *self._robot.wrist_wrench(side))
            if reading is not None:
                seen.append(WristReading(reading.stamp, side, reading.force, reading.torque))
        return seen

    def _read_tags(self, time: float) -> list[Observation]:
        if self._camera.capture_due(time):
            positions, quaternions = self._robot.link_poses([f"{side}_ft" for side in SIDES])
            tags = {name: self._world.pose(name) for name in self.tagged}
            for side, position, quaternion in zip(SIDES, positions, quaternions, strict=True):
                tags[f"{side}_gripper"] = Pose(position, quaternion)
            self._camera.capture(time, tags)
        seen = [_observed(news) for news in self._camera.deliver(time)]
        for reading in seen:
            if isinstance(reading, TagReading) and reading.tag in self._bodies:
                self._seen[reading.tag] = np.concatenate([reading.position, reading.quaternion])
        return [*seen]


def _observed(news: SeenTag | TagReading | CameraPicture) -> TagReading | CameraPicture:
    """Give what a camera delivers as what is published."""
    if isinstance(news, SeenTag):
        return TagReading(news.stamp, news.name, news.position, news.quaternion)
    return news


def _planar_to_pose(pose: Array, height: float) -> Array:
    """Make position and quaternion (7,) of a planar pose (3,) at a height [m]."""
    return np.array([pose[0], pose[1], height, *yaw_quaternion(float(pose[2]))])
