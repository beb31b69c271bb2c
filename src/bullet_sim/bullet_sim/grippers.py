"""A robot's grippers: what they may close on, what they hold, what has slipped out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from bullet_sim.clamp import GripperSpec, find_clamp
from bullet_sim.client import Pose
from bullet_sim.errors import nearest
from bullet_sim.grip import Grip
from bullet_sim.observations import Hold
from bullet_sim.world import World


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
    """All grippers of a robot and their grips."""

    def __init__(self, world: World, robot: str, links: Mapping[str, int], specs: Mapping[str, GripperSpec]) -> None:
        """Start with all open.

        Args:
            world: where the robot and what it can hold are.
            robot: its name in Bullet.
            links: number of the link that carries the plates, by side.
            specs: the plates, by side.
        """
        self._world, self._robot, self._links, self._specs = world, robot, dict(links), dict(specs)
        self._grips: dict[str, Grip] = {}

    def grasp(self, side: str, object_name: str = "") -> GraspOutcome:
        """Close a gripper on the edge between its plates.

        Args:
            side: "left" or "right".
            object_name: the body meant; empty: whatever lies between the plates.

        Returns:
            Success, or a refusal with the distance to the nearest edge.
        """
        if side not in self._links:
            return GraspOutcome(False, no_such_side(side, self._links))
        if side in self._grips:
            held = self._grips[side].clamp.body
            return GraspOutcome(False, f"the {side} gripper already holds {held}; release it first")
        bodies = self._world.furniture
        if object_name and object_name not in bodies:
            return GraspOutcome(False, f"no body {object_name!r} in this scene; {nearest(object_name, bodies)}")
        candidates = [bodies[object_name]] if object_name else list(bodies.values())
        test = find_clamp(candidates, self._hand(side), self._specs[side])
        if test.clamp is None:
            return GraspOutcome(False, test.message, test.distance)
        plates = self._world.plates(self._specs[side], test.clamp.body)
        self._grips[side] = Grip(
            self._world.client, (self._robot, self._links[side]), plates, bodies[test.clamp.body], test.clamp
        )
        return GraspOutcome(True, test.message, test.distance)

    def release(self, side: str) -> GraspOutcome:
        """Open a gripper."""
        if side not in self._links:
            return GraspOutcome(False, no_such_side(side, self._links))
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
        return self._world.client.link_pose(self._robot, self._links[side])


def no_such_side(side: str, sides: Iterable[str] = ("left", "right")) -> str:
    """Say that a robot has no such gripper."""
    return f"gripper {side!r}: expected 'left' or 'right'; {nearest(side, sides)}"
