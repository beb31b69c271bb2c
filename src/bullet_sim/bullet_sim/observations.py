"""What simulators publish, as plain values: one frozen dataclass a kind, no ROS needed to look at them.

SI units, seconds of simulated time, quaternions x y z w. Arrays are never written to again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ClockTick:
    """Simulated time [s]."""

    time: float


@dataclass(frozen=True)
class JointStates:
    """Angles [rad] and velocities [rad/s] of the joints `names`, each (n,)."""

    time: float
    names: tuple[str, ...]
    position: Array
    velocity: Array


@dataclass(frozen=True)
class Odometry:
    """Dead reckoning: pose (3,) x, y, theta of `base` in `odom`; twist (2,) forward [m/s], turning [rad/s]."""

    time: float
    pose: Array
    twist: Array


@dataclass(frozen=True)
class Transforms:
    """Frames and where they are in their parents.

    Attributes:
        time: [s].
        parents: (n,) names.
        children: (n,) names.
        positions: (n, 3) [m].
        quaternions: (n, 4).
        static: they never change.
    """

    time: float
    parents: tuple[str, ...]
    children: tuple[str, ...]
    positions: Array
    quaternions: Array
    static: bool = False


@dataclass(frozen=True)
class RobotDescription:
    """The robot's URDF."""

    time: float
    urdf: str


@dataclass(frozen=True)
class KnownBody:
    """What everybody may know of one body: the fields of `pbrl_msgs/Body`.

    Attributes:
        name: of the body.
        footprint: (k, 2) [m] counter-clockwise in the body's frame.
        height: of its top above the floor [m].
        nominal_mass: [kg]; NaN where nobody says.
        movable: False for what is built in.
        pose: (3,) x, y, theta in `world` at the start.
        casters: (c, 2) [m] swivel axes in the body's frame.
    """

    name: str
    footprint: Array
    height: float
    nominal_mass: float
    movable: bool
    pose: Array
    casters: Array


@dataclass(frozen=True)
class KnownScene:
    """The geometry that is known: bodies, and the outline (k, 2) [m] of the free floor in `world`."""

    time: float
    bodies: tuple[KnownBody, ...]
    room: Array


@dataclass(frozen=True)
class Hold:
    """A gripper holds an object: middle of the clamped patch (3,) [m] in the object's frame at closing."""

    gripper: str
    object: str
    contact_point: Array


@dataclass(frozen=True)
class GraspState:
    """Who holds what since `time`."""

    time: float
    holds: tuple[Hold, ...]


@dataclass(frozen=True)
class WristReading:
    """Raw wrist sensor: force (3,) [N] and torque (3,) [N m] on the sensor, in the axes of `<side>_ft`."""

    time: float
    side: str
    force: Array
    torque: Array


@dataclass(frozen=True)
class TagReading:
    """Pose of one tag in `world` as the overhead camera saw it at `time`; `tag` is a body or `<side>_gripper`."""

    time: float
    tag: str
    position: Array
    quaternion: Array


@dataclass(frozen=True)
class CameraPicture:
    """A picture of one overhead camera and what its calibration says.

    Attributes:
        time: when it was taken [s].
        camera: number of the camera.
        image: (height, width) grey levels.
        matrix: (3, 3) of the lens [px].
        distortion: (5,) of OpenCV, "plumb_bob".
        position: (3,) [m] of its optical frame in `world`, as calibrated; messages have it in `/tf_static`.
        quaternion: (4,) of that frame.
    """

    time: float
    camera: int
    image: NDArray[np.uint8]
    matrix: Array
    distortion: Array
    position: Array
    quaternion: Array

    @property
    def frame(self) -> str:
        """Name of the camera and of its optical frame; a topic's names may not be plain numbers."""
        return f"overhead_{self.camera}"


@dataclass(frozen=True)
class Outlines:
    """Known bodies drawn where their tags were last seen: pose (7,) position and quaternion, by name."""

    time: float
    bodies: Mapping[str, KnownBody]
    poses: Mapping[str, Array]


Observation: TypeAlias = (
    ClockTick
    | JointStates
    | Odometry
    | Transforms
    | RobotDescription
    | KnownScene
    | GraspState
    | WristReading
    | TagReading
    | CameraPicture
    | Outlines
)
"""Anything the simulator publishes."""
