"""The arm in Bullet: four joints that follow angles, a ball at the end."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bullet_sim.client import BulletClient, Pose, yaw_quaternion
from bullet_sim.description import installed_description
from bullet_sim.quiet import bullet
from tabletop_sim.errors import TabletopError

Array = NDArray[np.float64]

NAME = "ball_arm"
JOINTS = ("arm_yaw", "arm_shoulder", "arm_elbow", "arm_wrist")
STOWED = (-1.5707963267948966, 1.4020, -2.4997, 1.0978)
"""Angles [rad] at the start: the ball beside the column, off the table and over it, the rod upright."""
GAIN = 60.0
"""[1/s] of the position loop around the joints' velocity servos."""
BALL_FRICTION = 1.0


def description_path() -> Path:
    """Find the arm's URDF in the installed workspace; raise SimError where it is not."""
    return installed_description("ball_arm")


class Arm:
    """The arm as one Bullet body, its column fixed to the table's side.

    Attributes:
        links: Bullet's link number by link name; the root is -1.
    """

    def __init__(self, client: BulletClient, base: Sequence[float]) -> None:
        """Put it up.

        Args:
            client: where.
            base: (3,) x, y [m] and heading [rad] of its column.
        """
        x, y, theta = base
        # The root link's centre of mass is over its frame; Bullet places the former.
        pose = Pose(np.array([x, y, 0.0]), yaw_quaternion(theta))
        self._client = client
        self.number = client.load_urdf(NAME, str(description_path()), pose, useFixedBase=True)
        index = client.joints(NAME)
        self._joints = [index[name] for name in JOINTS]
        self.links = {"arm_base": -1}
        for joint in index.values():
            self.links[client.api.getJointInfo(self.number, joint)[12].decode()] = joint
        rows = np.array([client.api.getJointInfo(self.number, joint)[8:12] for joint in self._joints])
        self.lower, self.upper, self._effort, self._velocity = rows.T
        for joint, angle in zip(self._joints, STOWED, strict=True):
            client.api.resetJointState(self.number, joint, angle)
        client.api.changeDynamics(self.number, self.links["ball"], lateralFriction=BALL_FRICTION, restitution=0)
        self._target = np.array(STOWED)

    def command(self, angles: Sequence[float]) -> None:
        """Ask for angles (4,) [rad]; they hold until others are asked for.

        Raises:
            TabletopError: not four finite angles within the joints' limits.
        """
        wanted = np.array(angles, dtype=float)
        if wanted.shape != (len(JOINTS),) or not np.isfinite(wanted).all():
            raise TabletopError(f"arm command: expected {len(JOINTS)} finite angles, got {list(angles)}")
        beyond = [
            f"{name} {angle:.3f} is not in {low:.3f} .. {high:.3f} rad"
            for name, angle, low, high in zip(JOINTS, wanted, self.lower, self.upper, strict=True)
            if not low <= angle <= high
        ]
        if beyond:
            raise TabletopError(f"arm command: expected angles within the joints' limits, got {beyond[0]}")
        self._target = wanted

    def drive(self) -> None:
        """Set the motors for the next physics step."""
        angles, _ = self.joint_state()
        speed = np.clip(GAIN * (self._target - angles), -self._velocity, self._velocity)
        self._client.api.setJointMotorControlArray(
            self.number,
            self._joints,
            bullet.VELOCITY_CONTROL,
            targetVelocities=speed.tolist(),
            forces=self._effort.tolist(),
        )

    def joint_state(self) -> tuple[Array, Array]:
        """Read angles (4,) [rad] and velocities (4,) [rad/s]."""
        states = self._client.api.getJointStates(self.number, self._joints)
        return np.array([state[0] for state in states]), np.array([state[1] for state in states])

    def link_poses(self) -> tuple[tuple[str, ...], Array, Array]:
        """Read names, positions (n, 3) [m] and quaternions (n, 4) of all links but the root, in `world`."""
        names = tuple(name for name in self.links if name != "arm_base")
        states = self._client.api.getLinkStates(
            self.number, [self.links[name] for name in names], computeForwardKinematics=1
        )
        return names, np.array([state[4] for state in states]), np.array([state[5] for state in states])
