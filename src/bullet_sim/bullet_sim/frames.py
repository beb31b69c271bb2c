"""Where the robot's links are in its base: forward kinematics as Bullet has it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bullet_sim.client import BulletClient, Pose
from bullet_sim.quiet import bullet

Array = NDArray[np.float64]


class Linked(Protocol):
    """A robot as its frames are read: Bullet's number, its links by name, where they and its base are."""

    number: int
    links: dict[str, int]

    def link_poses(self, names: Sequence[str]) -> tuple[Array, Array]:
        """Give positions (n, 3) [m] and quaternions (n, 4) of links in `world`."""

    def base_pose(self) -> Pose:
        """Give the pose of the frame `base`."""


class RobotFrames:
    """The frames of a robot's links.

    Attributes:
        moving: names of the links behind joints that move; their frames are given in `base`.
        fixed: names of (parent, child) of the joints that do not.
    """

    def __init__(self, client: BulletClient, robot: Linked) -> None:
        """Sort the robot's links below `base` by whether their joint moves."""
        self._robot = robot
        names = {number: name for name, number in robot.links.items()}
        moving, fixed = [], []
        for number in sorted(set(names) - {robot.links["base"]}):
            info = client.api.getJointInfo(robot.number, number)
            if info[2] == bullet.JOINT_FIXED:
                fixed.append((names[info[16]], names[number]))
            else:
                moving.append(names[number])
        self.moving, self.fixed = tuple(moving), tuple(fixed)

    def in_base(self) -> tuple[Array, Array]:
        """Give positions (n, 3) [m] and quaternions (n, 4) of the frames `moving`, in `base`, as they are now."""
        return relative_poses(self._robot.base_pose(), *self._robot.link_poses(self.moving))

    def in_parents(self) -> tuple[Array, Array]:
        """Give positions (n, 3) [m] and quaternions (n, 4) of the `fixed` children in their parents."""
        placed = [relative_poses(self._pose(parent), *self._robot.link_poses([child])) for parent, child in self.fixed]
        return np.vstack([position for position, _ in placed]), np.vstack([quaternion for _, quaternion in placed])

    def _pose(self, link: str) -> Pose:
        if link == "base":
            return self._robot.base_pose()
        positions, quaternions = self._robot.link_poses([link])
        return Pose(positions[0], quaternions[0])


def relative_poses(frame: Pose, positions: Array, quaternions: Array) -> tuple[Array, Array]:
    """Express poses in a frame.

    Args:
        frame: in `world`.
        positions: (n, 3) [m] in `world`.
        quaternions: (n, 4) x y z w in `world`.

    Returns:
        Positions (n, 3) and quaternions (n, 4) in `frame`.
    """
    x, y, z, w = frame.quaternion
    # Left multiplication by the conjugate of the frame's quaternion.
    back = np.array([[w, z, -y, -x], [-z, w, x, -y], [y, -x, w, -z], [x, y, z, w]])
    return (positions - frame.position) @ frame.matrix, quaternions @ back.T
