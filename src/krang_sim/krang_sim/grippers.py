"""Krang's two grippers: what they may close on, what they hold, what has slipped out."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bullet_sim.clamp import GripperSpec, find_clamp
from bullet_sim.client import Pose
from bullet_sim.errors import nearest
from bullet_sim.grip import Grip
from bullet_sim.world import World
from krang_sim.errors import KrangError
from krang_sim.observations import Hold
from krang_sim.robot import NAME, SIDES, Krang

SPECS = {"left": GripperSpec(approach=1.0), "right": GripperSpec(approach=-1.0)}
"""The plates of each hand; the right one reaches along -y of its frame."""


@dataclass(frozen=True)
class GraspOutcome:
    """What came of closing or opening a gripper.

    Attributes:
        success: whether it holds, or holds no more.
        message: one sentence.
        distance: from the middle of the plates to the nearest edge that can be clamped [m]; infinite where there is
            none, NaN where it was not measured.
    """

    success: bool
    message: str
    distance: float = math.nan


class Grippers:
    """Both grippers and their grips."""

    def __init__(self, world: World, robot: Krang) -> None:
        """Start with both open."""
        self._world, self._robot = world, robot
        self._grips: dict[str, Grip] = {}

    def grasp(self, side: str, object_name: str = "") -> GraspOutcome:
        """Close a gripper on the edge between its plates.

        Args:
            side: "left" or "right".
            object_name: the body meant; empty: whatever lies between the plates.

        Returns:
            Success, or a refusal with the distance to the nearest edge.
        """
        if side not in SIDES:
            return GraspOutcome(False, str(no_such_side(side)))
        if side in self._grips:
            held = self._grips[side].clamp.body
            return GraspOutcome(False, f"the {side} gripper already holds {held}; release it first")
        bodies = self._world.furniture
        if object_name and object_name not in bodies:
            return GraspOutcome(False, f"no body {object_name!r} in this scene; {nearest(object_name, bodies)}")
        candidates = [bodies[object_name]] if object_name else list(bodies.values())
        test = find_clamp(candidates, self._hand(side), SPECS[side])
        if test.clamp is None:
            return GraspOutcome(False, test.message, test.distance)
        link = self._robot.links[f"{side}_ft"]
        plates = self._world.plates(SPECS[side], test.clamp.body)
        self._grips[side] = Grip(self._world.client, (NAME, link), plates, bodies[test.clamp.body], test.clamp)
        return GraspOutcome(True, test.message, test.distance)

    def release(self, side: str) -> GraspOutcome:
        """Open a gripper."""
        if side not in SIDES:
            return GraspOutcome(False, str(no_such_side(side)))
        if side not in self._grips:
            return GraspOutcome(False, f"the {side} gripper holds nothing")
        held = self._grips.pop(side).clamp.body
        return GraspOutcome(True, f"the {side} gripper let go of {held}")

    def apply(self) -> None:
        """Push on gripper and object for the next physics step."""
        for grip in self._grips.values():
            grip.apply()

    def drop_lost(self) -> bool:
        """Open every gripper whose edge has left the plates; tell whether there was one."""
        lost = [side for side, grip in self._grips.items() if grip.lost]
        for side in lost:
            del self._grips[side]
        return bool(lost)

    def holds(self) -> tuple[Hold, ...]:
        """Give who holds what, left before right."""
        return tuple(Hold(side, grip.clamp.body, grip.clamp.contact) for side, grip in sorted(self._grips.items()))

    def _hand(self, side: str) -> Pose:
        positions, quaternions = self._robot.link_poses([f"{side}_ft"])
        return Pose(positions[0], quaternions[0])


def no_such_side(side: str) -> KrangError:
    """Make the error for a gripper that Krang does not have."""
    return KrangError(f"gripper {side!r}: expected 'left' or 'right'; {nearest(side, SIDES)}")
