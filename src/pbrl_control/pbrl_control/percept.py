"""What the robot perceives at one moment, as plain arrays: no ROS types, no simulator types."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pbrl_control.errors import ControlError
from pbrl_control.kinematics import APPROACH, GRIP, SIDES, Posture
from pbrl_control.planar import Array, rotate_vector, wrap, yaw_of
from pbrl_control.types import Hold


@dataclass(frozen=True)
class Tag:
    """A tag's pose in `world` when it was seen: time [s], position (3,) [m], quaternion (4,) x y z w."""

    time: float
    position: Array
    quaternion: Array

    def finite(self) -> bool:
        """Say whether every number of it is one."""
        return bool(np.isfinite([self.time, *self.position, *self.quaternion]).all())


@dataclass(frozen=True)
class BodyShape:
    """Known geometry of a body: footprint (k, 2) [m], counter-clockwise in its frame, and height [m]."""

    footprint: Array
    height: float


@dataclass(frozen=True)
class Grip:
    """A gripper is closed: on which object, and where, contact (2,) in the object's frame [m]."""

    object: str
    contact: Array


@dataclass(frozen=True)
class Percept:
    """The latest of every stream.

    Attributes:
        posture: joint positions; None where nobody needs them (the executive alone does not).
        tags: by object name, and `left_gripper`, `right_gripper` for the `<side>_ft` frames.
        wrenches: raw wrist sensor (6,) force then torque in `<side>_ft`, by gripper.
        grips: closed grippers.
        bodies: known geometry by name.
        share: of the last command that the body controller could do, 0 to 1.
    """

    posture: Posture | None = None
    tags: Mapping[str, Tag] = field(default_factory=dict)
    wrenches: Mapping[str, Array] = field(default_factory=dict)
    grips: Mapping[str, Grip] = field(default_factory=dict)
    bodies: Mapping[str, BodyShape] = field(default_factory=dict)
    share: float = 1.0


def gripper_tag(side: str) -> str:
    """Return the name of a gripper's tag."""
    return f"{side}_gripper"


def object_planar(tag: Tag) -> Array:
    """Return the planar pose (3,) of an object in `world` [m, rad]."""
    return np.array([tag.position[0], tag.position[1], yaw_of(tag.quaternion)])


def plates_planar(side: str, tag: Tag) -> tuple[Array, float]:
    """Return the planar pose (3,) of a gripper's plates in `world`, and their height [m].

    The pose's x, y are the middle of the plates, its yaw is that of the approach direction. The tag's tilt
    noise is left out: plates are kept level, so the way from wrist to plates is taken as horizontal.
    """
    approach = rotate_vector(tag.quaternion, APPROACH[side])
    yaw = math.atan2(approach[1], approach[0])
    x, y = tag.position[:2] + GRIP * np.array([math.cos(yaw), math.sin(yaw)])
    return np.array([x, y, yaw]), float(tag.position[2])


def holds_of(percept: Percept) -> dict[str, Hold]:
    """Return what each gripper holds, with the object's yaw in the gripper's axes as the tags show it.

    Raises:
        ControlError: a tag of a held object or of its gripper has not been seen yet.
    """
    holds = {}
    for side, grip in percept.grips.items():
        if side not in SIDES:
            raise ControlError(f"grasp: expected gripper left or right, got {side!r}")
        missing = [name for name in (grip.object, gripper_tag(side)) if name not in percept.tags]
        if missing:
            raise ControlError(f"grasp of {grip.object!r}: expected a tag of {missing[0]!r}, none was seen yet")
        plates, _ = plates_planar(side, percept.tags[gripper_tag(side)])
        yaw = wrap(object_planar(percept.tags[grip.object])[2] - plates[2])
        holds[side] = Hold(grip.object, np.asarray(grip.contact, dtype=float)[:2], yaw)
    return holds
