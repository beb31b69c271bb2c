"""Forward kinematics and Jacobians of the two-armed robot, in the frame `base`, with Pinocchio.

The wheels are locked out of the model: `base` is where odometry moves it, everything here is relative to it.
A gripper's *planar axes* are x along its approach direction (out of the wrist, between the plates), y to
the left and z up; they are the same for both grippers, whose `<side>_ft` frames are mirror images.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pinocchio as pin

from pbrl_control.errors import ControlError
from pbrl_control.planar import Array

SIDES = ("left", "right")
ARM_JOINTS = {side: tuple(f"{side[0].upper()}J{i}" for i in range(1, 8)) for side in SIDES}
BODY_JOINTS = ("waist", "torso")
TIP = 0.217  # [m] from the force-torque sensor's origin to the end of the plates
GRIP = 0.172  # [m] from the force-torque sensor's origin to the middle of the plates
APPROACH = {"left": np.array([0.0, 1.0, 0.0]), "right": np.array([0.0, -1.0, 0.0])}  # in `<side>_ft`


@dataclass(frozen=True)
class Posture:
    """Joint positions of everything above the wheels.

    Attributes:
        waist, torso: [rad].
        left, right: (7,) [rad], J1 to J7.
    """

    waist: float
    torso: float
    left: Array = field(default_factory=lambda: np.zeros(7))
    right: Array = field(default_factory=lambda: np.zeros(7))

    def arm(self, side: str) -> Array:
        """Return the (7,) positions of one arm."""
        return self.left if side == "left" else self.right

    @classmethod
    def from_joint_states(cls, names: Sequence[str], positions: Sequence[float]) -> Posture:
        """Pick the posture out of a joint-state message's arrays; raise ControlError where a joint is missing."""
        if len(names) != len(positions):
            raise ControlError(f"joint states: expected a position a name, {len(names)}, got {len(positions)}")
        table = dict(zip(names, positions, strict=True))
        wanted = (*BODY_JOINTS, *ARM_JOINTS["left"], *ARM_JOINTS["right"])
        missing = [name for name in wanted if name not in table]
        if missing:
            raise ControlError(f"joint states: expected {', '.join(wanted)}; {', '.join(missing)} missing")
        strange = [name for name in wanted if not math.isfinite(table[name])]
        if strange:
            raise ControlError(f"joint states: expected finite positions, got {table[strange[0]]} of {strange[0]}")
        left, right = (np.array([table[name] for name in ARM_JOINTS[side]], dtype=float) for side in SIDES)
        return cls(float(table["waist"]), float(table["torso"]), left, right)

    def vector(self) -> Array:
        """Return waist, torso, left, right as (16,)."""
        return np.concatenate(([self.waist, self.torso], self.left, self.right))


@dataclass(frozen=True)
class FramePose:
    """Pose of a frame in `base`: position (3,) [m], rotation (3, 3) whose columns are the frame's axes."""

    position: Array
    rotation: Array

    def quaternion(self) -> Array:
        """Return the rotation as (4,) x y z w, w not negative."""
        q = np.asarray(pin.Quaternion(self.rotation).coeffs())
        return q if q[3] >= 0.0 else -q


@dataclass(frozen=True)
class GripperState:
    """Where a gripper is, for control in the plane.

    Attributes:
        pose: of `<side>_ft` in `base`.
        planar: (3,) x, y of the middle of the plates and yaw of the approach direction, in `base` [m, rad].
        height: of the middle of the plates above `base` [m].
        jacobian: (6, 7) of the middle of the plates, axes of `base`: linear rows, then angular rows.
    """

    pose: FramePose
    planar: Array
    height: float
    jacobian: Array


@dataclass(frozen=True)
class JointLimits:
    """Limits of one arm: lower, upper (7,) [rad] and velocity (7,) [rad/s]."""

    lower: Array
    upper: Array
    velocity: Array


class RobotKinematics:
    """Forward kinematics, gripper Jacobians and limits, from the text of a URDF.

    Attributes:
        urdf: that text.

    Raises:
        ControlError: the text is no URDF, or a joint or frame that control needs is not in it.
    """

    def __init__(self, urdf: str) -> None:
        try:
            whole = pin.buildModelFromXML(urdf)
        except (ValueError, RuntimeError) as error:
            raise ControlError(f"robot description: expected URDF text, got {urdf[:40]!r}: {error}") from error
        self.urdf = urdf
        self._model = _without_wheels(whole)
        self._frames = {name: self._frame(name) for name in ("left_ft", "right_ft")}
        self._plates = {side: self._add_plates(side) for side in SIDES}
        self._data = self._model.createData()
        self._columns = {side: [self._joint(name).idx_v for name in ARM_JOINTS[side]] for side in SIDES}
        order = (*BODY_JOINTS, *ARM_JOINTS["left"], *ARM_JOINTS["right"])
        self._order = np.array([self._joint(name).idx_q for name in order])

    @classmethod
    def from_file(cls, path: Path) -> RobotKinematics:
        """Read the URDF at `path`; raise ControlError where there is none."""
        try:
            return cls(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise ControlError(f"robot description: expected a readable URDF file, got {path}: {error}") from error

    def limits(self, side: str) -> JointLimits:
        """Return position and velocity limits of one arm."""
        columns = self._columns[side]
        model = self._model
        return JointLimits(
            np.array(model.lowerPositionLimit[columns]),
            np.array(model.upperPositionLimit[columns]),
            np.array(model.velocityLimit[columns]),
        )

    def frame(self, posture: Posture, name: str) -> FramePose:
        """Return the pose of any frame of the URDF in `base`."""
        index = self._frames.get(name) or self._frame(name)
        pin.forwardKinematics(self._model, self._data, self._configuration(posture))
        placement = pin.updateFramePlacement(self._model, self._data, index)
        return FramePose(np.array(placement.translation), np.array(placement.rotation))

    def tip(self, posture: Posture, side: str) -> Array:
        """Return the position (3,) [m] of the end of a gripper's plates in `base`."""
        pose = self.frame(posture, f"{side}_ft")
        return pose.position + pose.rotation @ APPROACH[side] * TIP

    def grippers(self, posture: Posture) -> Mapping[str, GripperState]:
        """Return both grippers' states, one pass of kinematics for both."""
        pin.computeJointJacobians(self._model, self._data, self._configuration(posture))
        return {side: self._gripper(side) for side in SIDES}

    def _gripper(self, side: str) -> GripperState:
        sensor = pin.updateFramePlacement(self._model, self._data, self._frames[f"{side}_ft"])
        pose = FramePose(np.array(sensor.translation), np.array(sensor.rotation))
        index = self._plates[side]
        middle = pin.updateFramePlacement(self._model, self._data, index).translation
        whole = pin.getFrameJacobian(self._model, self._data, index, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        approach = pose.rotation @ APPROACH[side]
        planar = np.array([middle[0], middle[1], math.atan2(approach[1], approach[0])])
        return GripperState(pose, planar, float(middle[2]), whole[:, self._columns[side]])

    def _add_plates(self, side: str) -> int:
        """Add the middle of a gripper's plates to the frames; return its number."""
        sensor = self._model.frames[self._frames[f"{side}_ft"]]
        placement = sensor.placement * pin.SE3(np.eye(3), GRIP * np.asarray(APPROACH[side]))
        plates = pin.Frame(f"{side}_plates_middle", sensor.parentJoint, placement, pin.FrameType.OP_FRAME)
        return int(self._model.addFrame(plates))

    def _configuration(self, posture: Posture) -> Array:
        q = np.empty(self._model.nq)
        q[self._order] = posture.vector()
        return q

    def _joint(self, name: str) -> pin.JointModel:
        if not self._model.existJointName(name):
            raise ControlError(f"robot description: expected a joint {name!r}, got {', '.join(self._model.names[1:])}")
        return self._model.joints[self._model.getJointId(name)]

    def _frame(self, name: str) -> int:
        if not self._model.existFrame(name):
            known = ", ".join(frame.name for frame in self._model.frames)
            raise ControlError(f"robot description: expected a frame {name!r}, got {known}")
        return int(self._model.getFrameId(name))


def _without_wheels(model: pin.Model) -> pin.Model:
    """Lock every joint that is neither waist, torso nor arm: wheels, fingers, a head."""
    wanted = {*BODY_JOINTS, *ARM_JOINTS["left"], *ARM_JOINTS["right"]}
    locked = [model.getJointId(name) for name in model.names[1:] if name not in wanted]
    return pin.buildReducedModel(model, locked, pin.neutral(model)) if locked else model
