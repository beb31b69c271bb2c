"""Golem Krang in a Bullet client: wheels, sixteen joints under velocity control, two wrist sensors.

The drives are velocity servos with a position loop outside, as Schunk's are: a joint told to stand
still holds its place under gravity and under the load, up to its peak torque. Bullet's velocity motor
alone creeps by milliradians each second.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bullet_sim.client import BulletClient, Pose, cross, yaw_quaternion
from bullet_sim.description import installed_description
from bullet_sim.quiet import bullet
from krang_sim.errors import KrangError
from krang_sim.postures import Posture

Array = NDArray[np.float64]

NAME = "krang"
SIDES = ("left", "right")
WHEEL_JOINTS = ("lwheel", "rwheel")
ARM_JOINTS = {side: tuple(f"{side[0].upper()}J{k}" for k in range(1, 8)) for side in SIDES}
BODY_JOINTS = ("waist", "torso", *ARM_JOINTS["left"], *ARM_JOINTS["right"])
JOINTS = (*WHEEL_JOINTS, *BODY_JOINTS)
"""All 18 joints in the order of every array of joints here."""

WHEEL_RADIUS = 0.267
"""[m]"""
TRACK = 0.695
"""Distance [m] between the middles of the wheels."""
ENCODER_STEP = 2 * math.pi / (4000 * 15)
"""Angle [rad] of a wheel per count: 4000 counts on the motor side of 15:1 gears."""

BASE_ACCELERATION = (0.5, 1.0)
"""Most change of speed [m/s^2] and turning [rad/s^2]; an estimate."""
BRAKING = (1.0, 2.5, 4.0)
"""The same where a stop is commanded or commands have ceased: forwards, backwards, turning. In Bullet the slider lifts
off the floor from 1.1 m/s^2 on when it drives forwards: it then rocks for longer than it would have rolled on."""
BASE_SPEED = (0.35, 0.17, 0.5)
"""Most that the base obeys: backwards, forwards [m/s], turning [rad/s]. From each it is at rest 0.26 s after the
last command, the watchdog's 0.1 s and then `BRAKING`: 0.04 s are left for a command that comes late."""
JOINT_BRAKING = 2.0
"""By so much arms slow down faster than they speed up, where a stop is commanded or commands have ceased."""
JOINT_ACCELERATION = np.radians([100.0, 100.0] + 2 * [100.0, 100.0, 95.0, 95.0, 100.0, 100.0, 200.0])
"""(16,) [rad/s^2] of `BODY_JOINTS`, from the drives' data sheets."""

SLIDER_FRICTION = 0.15
TYRE_FRICTION = 0.8
PLATE_FRICTION = 0.8

POSITION_GAIN = 40.0
"""[1/s] of the drives' outer loop."""
LEASH = 0.02
"""[rad] The reference never runs further than this from a joint that cannot follow."""


@dataclass(frozen=True)
class Limits:
    """Limits of the 18 joints: position [rad] (infinite for wheels), speed [rad/s], torque [N m]."""

    lower: Array
    upper: Array
    velocity: Array
    effort: Array


def description_path() -> Path:
    """Find Krang's URDF in the installed workspace; raise SimError where it is not."""
    return installed_description("krang")


class Krang:
    """The robot as one Bullet body.

    Attributes:
        limits: of the 18 joints.
        links: Bullet's link number by link name; the root `base` is -1.
    """

    def __init__(self, client: BulletClient, start: Sequence[float], posture: Posture) -> None:
        """Put the robot on the floor.

        Args:
            client: where it lives.
            start: (3,) x, y [m] and heading [rad] of `base` in `world`.
            posture: initial joint angles.
        """
        x, y, theta = start
        pose = Pose(np.array([x, y, 0.0]), yaw_quaternion(theta))
        self._client = client
        self.number = client.load_urdf(NAME, str(description_path()), pose)
        index = client.joints(NAME)
        self._joints = [index[name] for name in JOINTS]
        self.links = {"base": -1}
        for joint in index.values():
            self.links[client.api.getJointInfo(self.number, joint)[12].decode()] = joint
        self.limits = self._read_limits()
        self._sensor_offset = {side: self._centre_of_mass(f"{side}_ft") for side in SIDES}
        self._set_friction()
        self._place(posture)
        self._reference = self.joint_state()[0]
        self._velocity = np.zeros(len(JOINTS))
        self._base_speed = np.zeros(2)
        self._base_command = np.zeros(2)
        self._joint_command = np.zeros(len(BODY_JOINTS))

    def _read_limits(self) -> Limits:
        rows = np.array([self._client.api.getJointInfo(self.number, joint)[8:12] for joint in self._joints])
        lower, upper, effort, velocity = rows.T
        endless = lower > upper
        return Limits(np.where(endless, -np.inf, lower), np.where(endless, np.inf, upper), velocity, effort)

    def _centre_of_mass(self, link: str) -> Array:
        return np.array(self._client.api.getDynamicsInfo(self.number, self.links[link])[3])

    def _set_friction(self) -> None:
        friction = {"slider": SLIDER_FRICTION, "left_wheel": TYRE_FRICTION, "right_wheel": TYRE_FRICTION}
        friction |= {f"{side}_ft": PLATE_FRICTION for side in SIDES}
        for link, value in friction.items():
            self._client.api.changeDynamics(self.number, self.links[link], lateralFriction=value)

    def _place(self, posture: Posture) -> None:
        angles = (0.0, 0.0, *posture.body_joints)
        outside = [
            f"{name} {angle:.3f} is not in {low:.3f} .. {high:.3f}"
            for name, angle, low, high in zip(JOINTS, angles, self.limits.lower, self.limits.upper, strict=True)
            if not low <= angle <= high
        ]
        if outside:
            raise KrangError(f"posture: expected angles within the joints' limits, got {outside[0]} rad")
        for joint, angle in zip(self._joints, angles, strict=True):
            self._client.api.resetJointState(self.number, joint, angle)
        for side in SIDES:
            self._client.api.enableJointForceTorqueSensor(self.number, self.links[f"{side}_ft"], True)

    def command_base(self, v: float, w: float) -> None:
        """Ask for a speed forward [m/s] and a rate of turning left [rad/s], within `BASE_SPEED`; zeros: stop."""
        backwards, forwards, turning = BASE_SPEED
        self._base_command[:] = min(max(v, -backwards), forwards), min(max(w, -turning), turning)

    def command_joints(self, first: str, velocity: Sequence[float] | Array) -> None:
        """Ask for velocities [rad/s] of consecutive joints, `first` being the name of the first of them."""
        at = BODY_JOINTS.index(first)
        self._joint_command[at : at + len(velocity)] = velocity

    def drive(self) -> None:
        """Set every motor for the next physics step: ramps, limits, position loop."""
        step = self._client.step_time
        position, _ = self.joint_state()
        self._ramp(step)
        reference = self._reference + self._velocity * step
        np.clip(reference, position - LEASH, position + LEASH, out=reference)
        np.clip(reference, self.limits.lower, self.limits.upper, out=reference)
        self._reference = reference
        target = self._velocity + POSITION_GAIN * (reference - position)
        np.clip(target, -self.limits.velocity, self.limits.velocity, out=target)
        self._client.api.setJointMotorControlArray(
            self.number,
            self._joints,
            bullet.VELOCITY_CONTROL,
            targetVelocities=target.tolist(),
            forces=self.limits.effort.tolist(),
        )

    def _ramp(self, step: float) -> None:
        limit = self.limits.velocity[2:]
        wanted = np.clip(self._joint_command, -limit, limit)
        base = self._base_change() * step
        joints = JOINT_ACCELERATION * step * np.where(wanted == 0.0, JOINT_BRAKING, 1.0)
        if self._base_command.any() or wanted.any():
            self._base_speed += np.clip(self._base_command - self._base_speed, -base, base)
            self._velocity[2:] += np.clip(wanted - self._velocity[2:], -joints, joints)
        else:  # all stop at once, on the way that hands are on: what is held is not bent by who would stop sooner
            slowest = max(np.abs(self._base_speed / base).max(), np.abs(self._velocity[2:] / joints).max())
            left = max(1.0 - 1.0 / slowest, 0.0) if slowest > 0.0 else 0.0
            self._base_speed *= left
            self._velocity[2:] *= left
        v, w = self._base_speed
        self._velocity[0] = (v - w * TRACK / 2) / WHEEL_RADIUS
        self._velocity[1] = (v + w * TRACK / 2) / WHEEL_RADIUS
        at_stop = self._at_stop(wanted)
        self._velocity[2:][at_stop] = 0.0

    def _base_change(self) -> Array:
        """Return most change of speed and turning (2,): a command of zeros, or none, is a stop."""
        if self._base_command.any():
            return np.array(BASE_ACCELERATION)
        forwards, backwards, turning = BRAKING
        return np.array([forwards if self._base_speed[0] > 0.0 else backwards, turning])

    def _at_stop(self, wanted: Array) -> NDArray[np.bool_]:
        reference = self._reference[2:]
        low, high = self.limits.lower[2:], self.limits.upper[2:]
        return ((reference <= low) & (wanted <= 0)) | ((reference >= high) & (wanted >= 0))

    def joint_state(self) -> tuple[Array, Array]:
        """Read angles (18,) [rad] and velocities (18,) [rad/s] in the order of `JOINTS`."""
        states = self._client.api.getJointStates(self.number, self._joints)
        return np.array([state[0] for state in states]), np.array([state[1] for state in states])

    def wrist_wrench(self, side: str) -> tuple[Array, Array]:
        """Read what gripper weight and world exert on a wrist sensor.

        Bullet reports what the forearm exerts on the gripper, about the gripper's centre of mass, in axes
        parallel to the sensor's. The sensor feels the opposite, and about its own origin.

        Args:
            side: "left" or "right".

        Returns:
            Force (3,) [N] and torque (3,) [N m] at the origin and in the axes of `<side>_ft`.
        """
        reaction = np.array(self._client.api.getJointState(self.number, self.links[f"{side}_ft"])[2])
        force = -reaction[:3]
        return force, -reaction[3:] + cross(self._sensor_offset[side], force)

    def link_poses(self, names: Sequence[str]) -> tuple[Array, Array]:
        """Read where links are.

        Args:
            names: of links other than `base`.

        Returns:
            Positions (n, 3) [m] and quaternions (n, 4) x y z w of the links' frames in `world`.
        """
        numbers = [self.links[name] for name in names]
        states = self._client.api.getLinkStates(self.number, numbers, computeForwardKinematics=1)
        return np.array([state[4] for state in states]), np.array([state[5] for state in states])

    def base_pose(self) -> Pose:
        """Read the true pose of `base` in `world`: for scoring and for relative poses, never for a topic."""
        return self._client.centre_pose(NAME)

    def base_twist(self) -> tuple[float, float]:
        """Read the true speed over the floor [m/s] and rate of turning [rad/s], without signs: for scoring only."""
        (x, y, _), (_, _, spin) = self._client.api.getBaseVelocity(self.number)
        return math.hypot(x, y), abs(spin)


class WheelOdometry:
    """Dead reckoning from wheel encoders, from (0, 0, 0) where the run began.

    Attributes:
        pose: (3,) x, y [m] and heading [rad] in `odom`.
        twist: (2,) forward speed [m/s] and turning [rad/s] over the last update.
    """

    def __init__(self) -> None:
        self.pose = np.zeros(3)
        self.twist = np.zeros(2)
        self._counts = np.zeros(2)
        self._time = 0.0

    def update(self, time: float, wheels: Array) -> None:
        """Take in wheel angles (2,) [rad], left and right, read at `time` [s]."""
        counts = np.round(wheels / ENCODER_STEP)
        left, right = (counts - self._counts) * ENCODER_STEP * WHEEL_RADIUS
        distance, turn = (left + right) / 2, (right - left) / TRACK
        heading = self.pose[2] + turn / 2
        self.pose += distance * math.cos(heading), distance * math.sin(heading), turn
        if time > self._time:
            self.twist = np.array([distance, turn]) / (time - self._time)
        self._counts, self._time = counts, time
