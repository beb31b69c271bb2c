"""The PR2's arms from its description: joints and Jacobians of both hands, and where its laser is, with Pinocchio."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from pbrl_control.cart.arms import ArmState
from pbrl_control.errors import ControlError
from pbrl_control.planar import Array

PREFIXES = ("l", "r")
JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "upper_arm_roll_joint",
    "elbow_flex_joint",
    "forearm_roll_joint",
    "wrist_flex_joint",
    "wrist_roll_joint",
)
TOOL = "gripper_tool_frame"
"""Between the fingertips."""


class Pr2Arms:
    """Kinematics of both arms in `base`.

    Args:
        urdf: text of the description, which ends at `base`.

    Raises:
        ControlError: the text is no URDF, or a joint or frame that is needed is not in it.
    """

    def __init__(self, urdf: str) -> None:
        try:
            self._model = pin.buildModelFromXML(urdf)
        except (ValueError, RuntimeError) as error:
            raise ControlError(f"robot description: expected URDF text, got {urdf[:40]!r}: {error}") from error
        model = self._model
        names = [f"{side}_{joint}" for side in PREFIXES for joint in JOINTS]
        frames = [f"{side}_{TOOL}" for side in PREFIXES]
        missing = [name for name in names if not model.existJointName(name)]
        missing += [name for name in frames if not model.existFrame(name)]
        if missing:
            raise ControlError(f"robot description: expected {', '.join((*names, *frames))}; no {missing[0]}")
        self._names, self._frames = names, [model.getFrameId(name) for name in frames]
        joints = [model.joints[model.getJointId(name)] for name in names]
        self._columns = np.array([joint.idx_v for joint in joints]).reshape(2, 7)
        self._speed = np.array(model.velocityLimit)[self._columns]
        turning = np.array([joint.nq == 2 for joint in joints]).reshape(2, 7)
        places = np.array([joint.idx_q for joint in joints]).reshape(2, 7)
        self._lower = np.where(turning, -math.inf, np.array(model.lowerPositionLimit)[places])
        self._upper = np.where(turning, math.inf, np.array(model.upperPositionLimit)[places])
        self._data = model.createData()

    def state(self, names: Sequence[str], positions: Sequence[float] | Array) -> ArmState:
        """Return joints, limits and Jacobians of the middles between the fingertips.

        Args:
            names: of the joints whose positions are known.
            positions: (n,) of them [rad], [m]; other joints are taken at zero.

        Raises:
            ControlError: an arm's joint is missing, or there are not as many positions as names.
        """
        table = self._arms_table(names, positions)
        pin.computeJointJacobians(self._model, self._data, self._configuration(table))
        jacobians = np.stack([self._jacobian(k) for k in range(2)])
        joints = np.array([table[name] for name in self._names]).reshape(2, 7)
        return ArmState(jacobians, joints, self._lower, self._upper, self._speed)

    def apart(self, names: Sequence[str], positions: Sequence[float] | Array) -> float:
        """Return how far from each other the middles between the fingertips are, as seen from above [m].

        Args:
            names: of the joints whose positions are known.
            positions: (n,) of them [rad], [m]; other joints are taken at zero.

        Raises:
            ControlError: an arm's joint is missing, or there are not as many positions as names.
        """
        pin.forwardKinematics(self._model, self._data, self._configuration(self._arms_table(names, positions)))
        left, right = (pin.updateFramePlacement(self._model, self._data, each).translation[:2] for each in self._frames)
        return float(np.hypot(*(left - right)))

    def planar_pose(self, frame: str) -> Array:
        """Return x, y and yaw (3,) in `base` of a frame that no arm moves, with every joint at zero [m, rad].

        Raises:
            ControlError: there is no such frame.
        """
        found = self._frame(frame)
        pin.forwardKinematics(self._model, self._data, pin.neutral(self._model))
        placed = pin.updateFramePlacement(self._model, self._data, found)
        x, y, _ = placed.translation
        return np.array([x, y, math.atan2(placed.rotation[1, 0], placed.rotation[0, 0])])

    def frame_pose(self, frame: str, names: Sequence[str], positions: Sequence[float] | Array) -> Array:
        """Return the pose (4, 4) in `base` of a frame, with joints where they are.

        Args:
            frame: its name.
            names: of the joints whose positions are known.
            positions: (n,) of them [rad], [m]; other joints are taken at zero.

        Raises:
            ControlError: there is no such frame, or there are not as many positions as names.
        """
        table = _table(names, positions)
        pin.forwardKinematics(self._model, self._data, self._configuration(table))
        placed = pin.updateFramePlacement(self._model, self._data, self._frame(frame))
        return np.array(placed.homogeneous)

    def _arms_table(self, names: Sequence[str], positions: Sequence[float] | Array) -> dict[str, float]:
        table = _table(names, positions)
        missing = [name for name in self._names if name not in table]
        if missing:
            raise ControlError(f"joint states: expected both arms' joints, {missing[0]} is missing")
        return table

    def _frame(self, name: str) -> int:
        if not self._model.existFrame(name):
            raise ControlError(f"robot description: expected a frame {name!r}, got none of that name")
        return int(self._model.getFrameId(name))

    def _jacobian(self, side: int) -> Array:
        frame = self._frames[side]
        pin.updateFramePlacement(self._model, self._data, frame)
        whole = pin.getFrameJacobian(self._model, self._data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        return np.array(whole[:, self._columns[side]])

    def _configuration(self, table: dict[str, float]) -> Array:
        model = self._model
        q = pin.neutral(model)
        for name, angle in table.items():
            if not model.existJointName(name):
                continue
            joint = model.joints[model.getJointId(name)]
            if joint.nq == 2:  # one that turns on is kept as cosine and sine
                q[joint.idx_q : joint.idx_q + 2] = math.cos(angle), math.sin(angle)
            else:
                q[joint.idx_q] = angle
        return np.asarray(q)


def _table(names: Sequence[str], positions: Sequence[float] | Array) -> dict[str, float]:
    if len(names) != len(positions):
        raise ControlError(f"joint states: expected a position a name, {len(names)}, got {len(positions)}")
    return dict(zip(names, map(float, positions), strict=True))
