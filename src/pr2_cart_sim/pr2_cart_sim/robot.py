"""The PR2 in a Bullet client: a base that goes any way, torso, head, tilting laser, two arms, two wrist sensors.

The base is three joints over the floor (x, y, turn) whose motors are velocity servos of limited force: what the cart
does to the hands comes back to the base through the arms, and a push beyond the motors' force moves it. It cannot tip.
The eight wheels themselves are not simulated.

The arms are velocity servos with a position loop outside, as Krang's are, so that a joint told to stand still holds its
place. Their weight is carried by springs in the robot and by a torque of its own here, so that the motors' whole torque
is there for the load.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bullet_sim.client import BulletClient, Pose, cross, yaw_quaternion
from bullet_sim.quiet import bullet
from pr2_cart_sim.description import ARM_JOINTS, BASE_JOINTS, BODY_JOINTS, NAME, SIDES, load_on_planar_base, read_limits
from pr2_cart_sim.errors import Pr2Error
from pr2_cart_sim.postures import Posture

Array = NDArray[np.float64]

BASE_SPEED = (1.0, 2.0)
"""Greatest speed [m/s] in any direction, and of turning [rad/s]."""
BASE_ACCELERATION = (2.0, 2.0)
"""Greatest change of speed [m/s^2] and of turning [rad/s^2] on command."""
BRAKING = (5.2, 10.5)
"""The same when commands have ceased, an estimate for wheels that are held: from full speed to rest in 0.2 s."""
DRIVE = (560.0, 560.0, 110.0)
"""Greatest force [N] and torque [N m] of the base's drives: three quarters of what the wheels' motors give."""
HOLD = (1600.0, 1600.0, 400.0)
"""The same of wheels that are held: the tyres' friction, 0.6 of the weight."""

ARM_ACCELERATION = 8.0
"""[rad/s^2] An estimate."""
BODY_ACCELERATION = np.array([0.1, 8.0, 8.0, 40.0, *(14 * [ARM_ACCELERATION])])
"""(18,) [m/s^2], [rad/s^2] of `BODY_JOINTS`."""

FINGER_FRICTION = 0.8
POSITION_GAIN = 40.0
"""[1/s] of the drives' outer loop."""
LEASH = 0.02
"""[rad] The reference never runs further than this from a joint that cannot follow."""
WEIGHED_EVERY = 4
"""Physics steps between two looks at what the arms weigh: they hardly move in 10 ms."""


class PR2:
    """The robot as one Bullet body.

    Attributes:
        number: Bullet's.
        limits: of the 18 joints of the body.
        links: Bullet's link number by link name, from `base` on.
    """

    def __init__(self, client: BulletClient, start: Sequence[float], posture: Posture) -> None:
        """Put the robot on the floor.

        Args:
            client: where it lives.
            start: (3,) x, y [m] and heading [rad] of `base` in `world`.
            posture: initial joint angles.

        Raises:
            Pr2Error: angles beyond a joint's limits.
        """
        self._client, self._api = client, client.api
        self.number = load_on_planar_base(client)
        index = client.joints(NAME)
        self._base = [index[name] for name in BASE_JOINTS]
        self._joints = [index[name] for name in BODY_JOINTS]
        self._arms = [index[name] for side in SIDES for name in ARM_JOINTS[side]]
        self.links = self._named_links(index)
        self.limits = read_limits()
        self._sensor_offset = {
            side: np.array(self._api.getDynamicsInfo(self.number, self.links[f"{side}_ft"])[3]) for side in SIDES
        }
        self._movable = sorted([*self._base, *self._joints])
        self._own = [self._movable.index(joint) for joint in self._arms]
        self._place(start, posture)
        self._reference, _ = self.joint_state()
        self._velocity = np.zeros(len(BODY_JOINTS))
        self._command = np.zeros(len(BODY_JOINTS))
        self._base_speed, self._base_command, self._braking = np.zeros(3), np.zeros(3), True
        self._weighed = 0
        self._weight: list[float] = []

    def _named_links(self, index: dict[str, int]) -> dict[str, int]:
        names = {joint: self._api.getJointInfo(self.number, joint)[12].decode() for joint in index.values()}
        return {name: joint for joint, name in names.items() if name not in ("slide_x", "slide_y")}

    def _place(self, start: Sequence[float], posture: Posture) -> None:
        angles = (posture.torso, *posture.head, 0.0, *posture.left, *posture.right)
        outside = [
            f"{name} {angle:.3f} is not in {low:.3f} .. {high:.3f}"
            for name, angle, low, high in zip(BODY_JOINTS, angles, self.limits.lower, self.limits.upper, strict=True)
            if not low <= angle <= high
        ]
        if outside:
            raise Pr2Error(f"posture: expected angles within the joints' limits, got {outside[0]}")
        for joint, angle in zip([*self._base, *self._joints], [*start, *angles], strict=True):
            self._api.resetJointState(self.number, joint, angle)
        for side in SIDES:
            self._api.changeDynamics(self.number, self.links[f"{side}_ft"], lateralFriction=FINGER_FRICTION)
            self._api.enableJointForceTorqueSensor(self.number, self.links[f"{side}_ft"], True)

    def command_base(self, vx: float, vy: float, w: float, *, brake: bool = False) -> None:
        """Ask for a velocity forward and to the left [m/s] and a rate of turning left [rad/s], in `base`.

        Args:
            vx: forward; speeds beyond `BASE_SPEED` are cut, their direction is kept.
            vy: to the left.
            w: turning.
            brake: whether the wheels are held, because nobody commands them.
        """
        speed = math.hypot(vx, vy)
        share = min(1.0, BASE_SPEED[0] / speed) if speed > 0 else 1.0
        turn = max(-BASE_SPEED[1], min(BASE_SPEED[1], w))
        self._base_command[:] = share * vx, share * vy, turn
        self._braking = brake

    def command_joints(self, first: str, velocity: Sequence[float] | Array) -> None:
        """Ask for velocities [rad/s], [m/s] of consecutive joints, `first` being the name of the first of them."""
        at = BODY_JOINTS.index(first)
        self._command[at : at + len(velocity)] = velocity

    def drive(self) -> None:
        """Set every motor for the next physics step: ramps, limits, position loop, the arms' weight."""
        step = self._client.step_time
        self._drive_base(step)
        position, _ = self.joint_state()
        limits = self.limits
        wanted = np.clip(self._command, -limits.velocity, limits.velocity)
        change = BODY_ACCELERATION * step
        self._velocity += np.clip(wanted - self._velocity, -change, change)
        stopped = ((self._reference <= limits.lower) & (wanted <= 0)) | (
            (self._reference >= limits.upper) & (wanted >= 0)
        )
        self._velocity[stopped] = 0.0
        reference = self._reference + self._velocity * step
        np.clip(reference, position - LEASH, position + LEASH, out=reference)
        np.clip(reference, limits.lower, limits.upper, out=reference)
        self._reference = reference
        target = np.clip(self._velocity + POSITION_GAIN * (reference - position), -limits.velocity, limits.velocity)
        self._api.setJointMotorControlArray(
            self.number,
            self._joints,
            bullet.VELOCITY_CONTROL,
            targetVelocities=target.tolist(),
            forces=limits.effort.tolist(),
        )
        self._carry_arms()

    def _drive_base(self, step: float) -> None:
        """Ramp the base's velocity, and give it to the joints over the floor."""
        most, most_turn = BRAKING if self._braking else BASE_ACCELERATION
        change = self._base_command - self._base_speed
        size = math.hypot(change[0], change[1])
        change[:2] *= min(1.0, most * step / size) if size > 0 else 1.0
        change[2] = max(-most_turn * step, min(most_turn * step, change[2]))
        self._base_speed += change
        vx, vy, w = self._base_speed
        heading = self._api.getJointState(self.number, self._base[2])[0] + w * step / 2
        cos, sin = math.cos(heading), math.sin(heading)
        self._api.setJointMotorControlArray(
            self.number,
            self._base,
            bullet.VELOCITY_CONTROL,
            targetVelocities=[cos * vx - sin * vy, sin * vx + cos * vy, w],
            forces=HOLD if self._braking else DRIVE,
        )

    def _carry_arms(self) -> None:
        """Take the arms' weight off their motors, as the springs do."""
        if self._weighed == 0:
            angles = [state[0] for state in self._api.getJointStates(self.number, self._movable)]
            still = [0.0] * len(angles)
            torques = self._api.calculateInverseDynamics(self.number, angles, still, still)
            self._weight = [torques[at] for at in self._own]
        self._weighed = (self._weighed + 1) % WEIGHED_EVERY
        self._api.setJointMotorControlArray(self.number, self._arms, bullet.TORQUE_CONTROL, forces=self._weight)

    def joint_state(self) -> tuple[Array, Array]:
        """Read positions (18,) [m], [rad] and velocities (18,) in the order of `BODY_JOINTS`."""
        states = self._api.getJointStates(self.number, self._joints)
        return np.array([state[0] for state in states]), np.array([state[1] for state in states])

    def base_state(self) -> tuple[Array, Array]:
        """Read the base's true pose (3,) x, y, heading in `world` and its rates (3,): for odometry and scoring."""
        states = self._api.getJointStates(self.number, self._base)
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
        reaction = np.array(self._api.getJointState(self.number, self.links[f"{side}_ft"])[2])
        force = -reaction[:3]
        return force, -reaction[3:] + cross(self._sensor_offset[side], force)

    def link_poses(self, names: Sequence[str]) -> tuple[Array, Array]:
        """Read where links are.

        Args:
            names: of links.

        Returns:
            Positions (n, 3) [m] and quaternions (n, 4) x y z w of the links' frames in `world`.
        """
        numbers = [self.links[name] for name in names]
        states = self._api.getLinkStates(self.number, numbers, computeForwardKinematics=1)
        return np.array([state[4] for state in states]), np.array([state[5] for state in states])

    def link_pose(self, name: str) -> Pose:
        """Read where one link's frame is in `world`."""
        return self._client.link_pose(NAME, self.links[name])

    def base_pose(self) -> Pose:
        """Read the true pose of `base` in `world`: for scoring and for relative poses, never for a topic."""
        x, y, heading = self.base_state()[0]
        return Pose(np.array([x, y, 0.0]), yaw_quaternion(float(heading)))
