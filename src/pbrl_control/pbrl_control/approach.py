"""Coming to the edge: gripper twists from tags alone, so that camera offsets common to both cancel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrl_control.edges import EdgePoint, nearest_edge
from pbrl_control.grasp_plan import GraspPlan
from pbrl_control.kinematics import GRIP, TIP
from pbrl_control.percept import BodyShape, Percept, gripper_tag, object_planar, plates_planar
from pbrl_control.planar import Array, rotation, wrap
from pbrl_control.types import PlanarTwist, gripper_frame

GAIN = 1.2  # [1/s] error to velocity
LATERAL_SPEED, YAW_RATE, LIFT_SPEED = 0.08, 0.2, 0.06  # [m/s, rad/s, m/s]
CLEARANCE = 0.04  # [m] between plates and edge until they are lined up
SMOOTHING = 0.2  # [s] time constant over which errors seen by the camera are averaged
IN = np.array([0.025, 0.10, 0.010])  # lateral [m], yaw [rad], height [m]: lined up
OUT = 2.0  # times IN: lined up no more
ARRIVED = 0.006  # [m] along the approach
DEEPEST = 0.03  # [m] that refused grasps may add to the depth in all


@dataclass
class GripError:
    """Way left to the goal: along, left [m], yaw [rad], up [m], in the gripper's planar axes, smoothed."""

    value: Array
    aligned: bool = False

    def take(self, fresh: Array, share: float) -> None:
        """Blend in what is seen now."""
        self.value += share * (fresh - self.value)
        worst = float(np.max(np.abs(self.value[1:]) / IN))
        self.aligned = worst <= (OUT if self.aligned else 1.0)


class Approacher:
    """Servoes the grippers of a plan to their places on the object's edge."""

    def __init__(self, plan: GraspPlan, shape: BodyShape) -> None:
        self._plan = plan
        self._edges: dict[str, EdgePoint] = {
            grip.gripper: nearest_edge(shape.footprint, np.array(grip.point)) for grip in plan.grips
        }
        self._errors: dict[str, GripError] = {}
        self._depth = plan.approach.depth

    def go_deeper(self, distance: float) -> None:
        """Aim further past the edge, after a grasp was refused with this distance [m]."""
        more = distance if np.isfinite(distance) else 0.0
        self._depth = min(self._depth + float(np.clip(more, 0.0, 0.01)), self._plan.approach.depth + DEEPEST)

    def step(self, percept: Percept, dt: float) -> tuple[dict[str, PlanarTwist], bool, str]:
        """Return a twist for each gripper, whether all have arrived, and a sentence on where they are."""
        share = 1.0 - float(np.exp(-dt / SMOOTHING))
        for side in self._edges:
            fresh = self._see(side, percept)
            self._errors.setdefault(side, GripError(fresh.copy())).take(fresh, share)
        aligned = all(error.aligned for error in self._errors.values())
        arrived = aligned and all(abs(error.value[0]) <= ARRIVED for error in self._errors.values())
        twists = {gripper_frame(side): self._servo(error.value, aligned) for side, error in self._errors.items()}
        side, error = max(self._errors.items(), key=lambda item: float(np.abs(item[1].value[[0, 1, 3]]).max()))
        ahead, left, yaw, up = error.value
        sentence = f"{side} gripper has {ahead:.3f} m to go, {left:+.3f} m left, {up:+.3f} m up, {yaw:+.2f} rad to turn"
        return twists, arrived, sentence

    def _see(self, side: str, percept: Percept) -> Array:
        plates, height = plates_planar(side, percept.tags[gripper_tag(side)])
        tag = percept.tags[self._plan.object]
        goal = self._edges[side].plates_goal(object_planar(tag), self._depth)
        ahead, left = rotation(plates[2]).T @ (goal[:2] - plates[:2])
        edge = tag.position[2] - self._plan.approach.edge_below_top
        return np.array([ahead, left, wrap(goal[2] - plates[2]), edge - height])

    def _servo(self, error: Array, aligned: bool) -> PlanarTwist:
        ahead, left, yaw, up = error
        if not aligned:
            ahead -= self._depth + (TIP - GRIP) + CLEARANCE
        speed = self._plan.approach.speed
        bounds = np.array([speed, LATERAL_SPEED, YAW_RATE, LIFT_SPEED])
        vx, vy, omega, vz = np.clip(GAIN * np.array([ahead, left, yaw, up]), -bounds, bounds)
        return PlanarTwist(float(vx), float(vy), float(omega), float(vz))
