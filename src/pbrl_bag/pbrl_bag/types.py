"""What a recording holds once it has been read: streams, bodies, grasps.

SI units, seconds, radians. Times are those of the message headers, on the recording's own clock.
Quaternions are (x, y, z, w). Arrays are read-only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PoseStream:
    """Poses of one frame in `world`.

    Attributes:
        time: (n,) strictly increasing [s].
        position: (n, 3) [m].
        quaternion: (n, 4) unit, x y z w; NaN rows where orientation was not observed.
    """

    time: Array
    position: Array
    quaternion: Array


@dataclass(frozen=True)
class WrenchStream:
    """Force and torque in the sensor's own axes, at the sensor's origin.

    Attributes:
        time: (n,) strictly increasing [s].
        force: (n, 3) [N].
        torque: (n, 3) [N m]; NaN where the sensor has no torque.
        exerted_on: "gripper": what gripper weight and world exert on the sensor (raw sensor, the
            contract's form); "object": what the gripper exerts on the object, already compensated.
        frame: "sensor", or "world" for a wrench already turned to world axes.
        covariance: (6, 6) [N, N m] of an error that stays for seconds, in the axes of `frame`, typical of the time in
            which something is held; NaN where torque is. None: a sensor's, which is small.
    """

    time: Array
    force: Array
    torque: Array
    exerted_on: str = "gripper"
    frame: str = "sensor"
    covariance: Array | None = None


@dataclass(frozen=True)
class Grasp:
    """One gripper held one object from `start` to `end` [s]; `contact` (2,) [m] in the object's frame."""

    gripper: str
    object: str
    start: float
    end: float
    contact: Array


@dataclass(frozen=True)
class BodyGeometry:
    """The known geometry of a body: footprint (k, 2) [m], counter-clockwise, in the body's frame."""

    name: str
    footprint: Array
    height: float
    nominal_mass: float
    movable: bool
    pose: Array  # (3,) x, y, theta in world when the scene was published
    casters: Array = field(default_factory=lambda: np.empty((0, 2)))


@dataclass(frozen=True)
class Recording:
    """Everything the learners are given.

    Attributes:
        path: where it was read from.
        bodies: by name.
        object_poses: by body name.
        gripper_poses: pose of the force-torque sensor's frame, by gripper ("left", "right").
        wrenches: by gripper.
        grasps: in order of start.
        room: (k, 2) outline of the free floor in world, possibly empty.
        notes: what a reader should tell its user, one sentence each: a file cut short by a crash and
            how much was lost, repeated samples left out.
    """

    path: Path
    bodies: Mapping[str, BodyGeometry]
    object_poses: Mapping[str, PoseStream]
    gripper_poses: Mapping[str, PoseStream]
    wrenches: Mapping[str, WrenchStream]
    grasps: tuple[Grasp, ...]
    room: Array = field(default_factory=lambda: np.empty((0, 2)))
    notes: tuple[str, ...] = ()
