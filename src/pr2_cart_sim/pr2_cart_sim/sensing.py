"""What the PR2 reports, each sense at its own rate. Truth goes in, readings come out; nothing else is published."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from bullet_sim.clamp import GripperSpec
from bullet_sim.client import Pose, yaw_quaternion
from bullet_sim.concealed.sensing import wrist_sensor
from bullet_sim.frames import RobotFrames
from bullet_sim.known import known_scene
from bullet_sim.observations import (
    ClockTick,
    GraspState,
    Hold,
    JointStates,
    RobotDescription,
    Transforms,
    WristReading,
)
from bullet_sim.sensors import Ticker
from pr2_cart_sim.cart_view import BoardNoise, HandsEstimate
from pr2_cart_sim.checkerboard import BoardCamera
from pr2_cart_sim.description import BODY_JOINTS, SIDES, description_path
from pr2_cart_sim.lasers import Laser
from pr2_cart_sim.observations import BaseOdometry, CartReading, KnownMap, Observation, Scan
from pr2_cart_sim.reckoning import Localiser, Odometry
from pr2_cart_sim.scene import OfficeScene
from pr2_cart_sim.sensor_settings import LaserSettings
from pr2_cart_sim.world import Office

Array = NDArray[np.float64]

CLOCK_RATE = 100.0
JOINT_RATE = 100.0
HANDS_RATE = 50.0
LASERS = {"base": "base_laser_link", "tilt": "laser_tilt_link"}
"""Frame by laser."""
TILT_JOINT = BODY_JOINTS.index("laser_tilt_mount_joint")


class Sensing:
    """The robot's senses, and the clock."""

    def __init__(self, office: Office, scene: OfficeScene, specs: Mapping[str, GripperSpec], rng: Generator) -> None:
        """Set the senses up; each draws from a stream of its own, spawned from `rng`.

        Args:
            office: where the robot is.
            scene: says what they are like.
            specs: the fingers, by side.
            rng: of all draws.

        Raises:
            SimError: the scene wants a wrist that is faster than the physics.
        """
        base, tilt, wheels, place, hands, board, *wrists = rng.spawn(6 + len(SIDES))
        sensors, client = scene.sensors, office.world.client
        self._office, self._scene, self._specs = office, scene, dict(specs)
        self._robot = office.robot
        self._lasers = {
            "base": Laser(client, sensors.base_laser, base),
            "tilt": Laser(client, sensors.tilt_laser, tilt),
        }
        self._odometry = Odometry(sensors.odometry, self._robot.base_state()[0], wheels)
        self._localiser = Localiser(sensors.localisation, place)
        self._hands = HandsEstimate(sensors.proprioception_bias, hands)
        self._wrists = {
            side: wrist_sensor(scene, side, stream, client.step_time)
            for side, stream in zip(SIDES, wrists, strict=True)
        }
        self._clock, self._joints = Ticker(CLOCK_RATE), Ticker(JOINT_RATE)
        self._odometer, self._palms = Ticker(sensors.odometry.rate), Ticker(HANDS_RATE)
        self._frames = RobotFrames(client, self._robot)
        self._told = np.array(scene.robot.pose)  # of `odom` in `map`, until a localiser says better
        self._board = self._make_board(board)

    def _make_board(self, rng: Generator) -> BoardNoise | BoardCamera | None:
        settings, cart = self._scene.sensors.checkerboard, self._office.cart
        if cart is None or settings.source == "off":
            return None
        if settings.source == "noise":
            return BoardNoise(settings, cart, rng)
        return BoardCamera(self._office.world.client, settings, cart, rng)

    def latched(self) -> list[Observation]:
        """Give what is known from the start, stamped zero: description, scene, map, static frames, no grasps."""
        news: list[Observation] = [
            RobotDescription(0.0, description_path().read_text(encoding="utf-8")),
            known_scene(self._scene, 0.0),
            self._static_frames(),
            self._map_frame(0.0, self._told),
            GraspState(0.0, ()),
        ]
        return [*news, KnownMap(0.0, self._office.grid)] if self._office.grid is not None else news

    def _static_frames(self) -> Transforms:
        """Give the fixed joints, and `map`, which is `world`."""
        positions, quaternions = self._frames.in_parents()
        return Transforms(
            0.0,
            ("world", *[parent for parent, _ in self._frames.fixed]),
            ("map", *[child for _, child in self._frames.fixed]),
            np.vstack([np.zeros(3), positions]),
            np.vstack([[0.0, 0.0, 0.0, 1.0], quaternions]),
            static=True,
        )

    @staticmethod
    def _map_frame(time: float, odom_in_map: Array) -> Transforms:
        x, y, theta = odom_in_map
        return Transforms(
            time, ("map",), ("odom",), np.array([[x, y, 0.0]]), yaw_quaternion(float(theta)).reshape(1, 4)
        )

    def note_grasp(self, side: str, cart: str) -> None:
        """Take note that a hand has closed on a body, when its heading and the body's are known."""
        self._hands.close(side, self._robot.link_pose(f"{side}_ft").yaw, self._office.world.pose(cart).yaw)

    def observe(self, time: float, holds: Sequence[Hold]) -> list[Observation]:
        """Read every sense that is due at `time` [s]; call once after each physics step.

        Args:
            time: now [s].
            holds: who holds what.

        Returns:
            Observations, the clock first.
        """
        seen: list[Observation] = []
        if self._clock.due(time):
            seen.append(ClockTick(time))
        if self._joints.due(time):
            seen.append(JointStates(time, BODY_JOINTS, *self._robot.joint_state()))
        if self._odometer.due(time):
            seen += self._read_odometry(time)
        seen += self._localise(time)
        seen += self._read_wrists(time)
        seen += self._scan(time)
        seen += self._see_cart(time, holds)
        return seen

    def _read_odometry(self, time: float) -> list[Observation]:
        self._odometry.update(time, self._robot.base_state()[0])
        pose = self._odometry.pose.copy()
        moving = self._frames.moving
        positions, quaternions = self._frames.in_base()
        frames = Transforms(
            time,
            ("odom", *["base"] * len(moving)),
            ("base", *moving),
            np.vstack([[pose[0], pose[1], 0.0], positions]),
            np.vstack([yaw_quaternion(float(pose[2])), quaternions]),
        )
        return [BaseOdometry(time, pose, self._odometry.twist.copy()), frames]

    def _localise(self, time: float) -> list[Observation]:
        """Tell the pose in the map, and where `odom` is, for that to be so."""
        seen: list[Observation] = []
        for told, (x, y, theta) in self._localiser.measure(time, self._robot.base_state()[0], self._odometry.pose):
            turn = told.pose[2] - theta
            cos, sin = math.cos(turn), math.sin(turn)
            odom = told.pose - [cos * x - sin * y, sin * x + cos * y, theta]
            seen += [told, self._map_frame(told.time, odom)]
        return seen

    def _read_wrists(self, time: float) -> list[Observation]:
        seen: list[Observation] = []
        for side, wrist in self._wrists.items():
            reading = wrist.measure(time, *self._robot.wrist_wrench(side))
            if reading is not None:
                seen.append(WristReading(reading.stamp, side, reading.force, reading.torque))
        return seen

    def _scan(self, time: float) -> list[Observation]:
        seen: list[Observation] = []
        sensors = self._scene.sensors
        told: dict[str, LaserSettings] = {"base": sensors.base_laser, "tilt": sensors.tilt_laser}
        for name, laser in self._lasers.items():
            if laser.due(time):
                ranges, settings = laser.scan(self._robot.link_pose(LASERS[name])), told[name]
                span = settings.range_min, settings.range_max
                tilt = float(self._robot.joint_state()[0][TILT_JOINT]) if name == "tilt" else 0.0
                seen.append(
                    Scan(
                        time,
                        "tilt" if name == "tilt" else "base",
                        LASERS[name],
                        laser.angle_min,
                        settings.increment,
                        1 / settings.rate,
                        span,
                        ranges,
                        tilt,
                    )
                )
        return seen

    def _see_cart(self, time: float, holds: Sequence[Hold]) -> list[CartReading]:
        seen: list[CartReading] = []
        cart = self._office.cart
        if cart is None:
            return seen
        if self._palms.due(time) and holds:
            reading = self._hands.estimate(time, cart, holds, self._hands_in_base(holds))
            seen += [reading] if reading is not None else []
        board = self._board
        if board is None:
            return seen
        if board.due(time):
            camera, body = self._robot.link_pose("head_camera_optical"), self._office.world.pose(cart)
            if isinstance(board, BoardCamera):
                board.capture(time, camera, body, self._robot.base_pose())
            else:
                board.capture(time, in_base(self._robot.base_pose(), body), self._in_view(camera, body))
        return seen + board.deliver(time)

    def _hands_in_base(self, holds: Sequence[Hold]) -> dict[str, tuple[Array, float]]:
        """Give where the middles between the holding hands' fingers are in `base`, and the hands' headings."""
        base = self._robot.base_pose()
        hands = {}
        for hold in holds:
            hand = self._robot.link_pose(f"{hold.gripper}_ft")
            middle = base.inverse_point(hand.point(self._specs[hold.gripper].middle))
            hands[hold.gripper] = middle, hand.yaw - base.yaw
        return hands

    def _in_view(self, camera: Pose, body: Pose) -> bool:
        """Say whether the camera has the board's middle in view, with a margin."""
        settings = self._scene.sensors.checkerboard
        x, y, z = camera.inverse_point(body.point(settings.position))
        reach = 0.85 * math.tan(settings.field_of_view / 2)
        return bool(0.2 < z < 4.0 and abs(x) < reach * z and abs(y) < reach * z * settings.lines / settings.width)


def in_base(base: Pose, body: Pose) -> Array:
    """Give the planar pose (3,) of a body in the base's frame."""
    x, y, _ = base.inverse_point(body.position)
    turn = (body.yaw - base.yaw + math.pi) % (2 * math.pi) - math.pi
    return np.array([x, y, turn])
