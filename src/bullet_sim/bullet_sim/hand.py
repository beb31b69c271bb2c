"""A hand that holds a body's edge and is driven along a path: a robot's arm without the robot.

The hand moves in the plane at the height of the edge. A servo with limited force drives it after the path that is
asked for, rubber plates (`bristle.py`) hold the edge, a force-torque sensor sits between arm and gripper. Everything is
plain floats: one step costs a tenth of what Bullet's own takes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bullet_sim.bristle import Bristle, wrap
from bullet_sim.clamp import GripperSpec, held_interval
from bullet_sim.client import GRAVITY, BulletClient, Pose, yaw_quaternion
from bullet_sim.errors import SimError
from bullet_sim.furniture import Furniture
from bullet_sim.motion import BodyMotion

Array = NDArray[np.float64]

LAST_HOLD = 0.005
"""Depth [m] of edge between the plates below which a slipping grasp is lost."""


@dataclass(frozen=True)
class HandSpec:
    """An arm's end with a gripper; arm and plates are about Krang's, what hangs on the sensor is lighter.

    A sensor feels the inertia of what hangs on it too, and taking out its weight does not take out that: it looks like
    mass of the body at the grasp. Krang's gripper (1.769 kg, 0.006 kg m^2) makes a table of 33 kg seem 5 % heavier and
    its centre of mass 2 cm nearer to a hand at its edge; the default is a light tool, for bodies that are to be what
    they seem.

    Attributes:
        gripper: the plates.
        depth: of edge that they take [m].
        mass: that the arm shows at the plates [kg].
        inertia: that it shows about the vertical [kg m^2].
        stiffness: of the position servo [N/m].
        damping: of the servo, as a ratio to the critical damping of 40 kg.
        force_limit: most the servo pushes [N].
        turn_stiffness: of the servo that turns it [N m/rad].
        turn_damping: [N m s/rad].
        torque_limit: most it turns with [N m].
        gripper_mass: what hangs on the sensor [kg].
        gripper_centre: from the sensor's origin to that mass, along the approach [m].
        gripper_inertia: of it about its centre, about the vertical [kg m^2].
        lag: way [m] by which the servo may lie behind before its reference waits for it.
    """

    gripper: GripperSpec = field(default_factory=GripperSpec)
    depth: float = 0.06
    mass: float = 5.0
    inertia: float = 0.05
    stiffness: float = 4000.0
    damping: float = 0.7
    force_limit: float = 150.0
    turn_stiffness: float = 80.0
    turn_damping: float = 3.0
    torque_limit: float = 15.0
    gripper_mass: float = 0.3
    gripper_centre: float = 0.091
    gripper_inertia: float = 0.001
    lag: float = 0.03

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name != "gripper" and not (math.isfinite(value) and value > 0):
                raise SimError(f"hand: {name}: expected a positive number, got {value}")
        if self.depth > self.gripper.plate_end - self.gripper.plate_start:
            raise SimError(f"hand: depth: expected at most the plates' length, got {self.depth} m")

    @property
    def reach(self) -> float:
        """From the sensor's origin to the middle of the clamped patch [m]."""
        return self.gripper.plate_end - self.depth / 2


class Hand:
    """The hand, at the middle of the patch that it clamps; call `step` before each step of the world.

    Attributes:
        x: of that middle in `world` [m].
        y: as `x`.
        yaw: direction of the approach, seen from above [rad].
        height: over the floor [m].
        held: name of the body that is held; None: the plates are open.
        force: (2,) [N] on the body in the last step, `world` axes.
        torque: on the body about that middle in the last step [N m].
    """

    def __init__(self, client: BulletClient, spec: HandSpec, place: tuple[float, float, float], height: float) -> None:
        """Put the hand at (x, y, yaw) with open plates."""
        self.x, self.y, self.yaw = place
        self.height = height
        self.held: str | None = None
        self.force, self.torque = (0.0, 0.0), 0.0
        self._spec, self._client, self._step = spec, client, client.step_time
        self._speed = [0.0, 0.0, 0.0]
        self._reference = [self.x, self.y, self.yaw]
        self._acceleration = (0.0, 0.0, 0.0)
        self._servo_damping = 2 * spec.damping * math.sqrt(spec.stiffness * 40.0)
        self._bristle: Bristle | None = None
        self._motion: BodyMotion | None = None
        self._outline: Array = np.zeros((0, 2))

    def put(self, x: float, y: float, yaw: float, height: float) -> None:
        """Carry the open hand to a place; what the sensor feels of that is left out."""
        self.x, self.y, self.yaw, self.height = x, y, yaw, height
        self._reference, self._speed, self._acceleration = [x, y, yaw], [0.0, 0.0, 0.0], (0.0, 0.0, 0.0)

    def hold(self, body: Furniture, gripper: GripperSpec) -> tuple[float, float]:
        """Close the plates on the edge that is between them.

        Args:
            body: what is held.
            gripper: the plates as they really are.

        Returns:
            Middle of the clamped patch (2,) [m] in the body's frame.

        Raises:
            SimError: there is no edge of the body between the plates.
        """
        motion = body.motion()
        contact = self._in_body(motion)
        slab = body.slab_at(np.array([*contact, 0.0]))
        half, turn = self._spec.depth / 2, self.yaw - motion.yaw
        along = np.array([math.cos(turn), math.sin(turn)])
        low, high = held_interval(slab.outline, np.array(contact) - half * along, np.array(contact) + half * along)
        if high - low < 0.3:
            raise SimError(
                f"hand: expected the edge of {body.name!r} between the plates, got nothing at "
                f"({contact[0]:.3f}, {contact[1]:.3f}) m of its frame; take a contact on its outline"
            )
        self._motion, self.held, self._outline = motion, body.name, slab.outline
        self._bristle = Bristle(gripper, self._spec.depth, contact, turn)
        # Whoever takes a thing that moves goes along with it.
        self._speed = [*motion.speed_at((self.x, self.y)), motion.spin]
        return contact

    def release(self) -> None:
        """Open the plates."""
        self._motion = self._bristle = self.held = None
        self.force, self.torque = (0.0, 0.0), 0.0

    def is_out(self) -> bool:
        """Tell whether the edge has slipped out from between the plates."""
        bristle, motion = self._bristle, self._motion
        if bristle is None or motion is None or not bristle.slipping:
            return False
        contact, turn, half = self._in_body(motion), self.yaw - motion.yaw, self._spec.depth / 2
        along = np.array([math.cos(turn), math.sin(turn)])
        low, high = held_interval(self._outline, np.array(contact) - half * along, np.array(contact) + half * along)
        return (high - low) * self._spec.depth < LAST_HOLD

    @property
    def slipped(self) -> float:
        """Way [m] the plates have slid over the edge in this grasp."""
        return self._bristle.slipped if self._bristle is not None else 0.0

    def _in_body(self, motion: BodyMotion) -> tuple[float, float]:
        """Give where the hand is in the body's frame (2,) [m]."""
        dx, dy = self.x - motion.x, self.y - motion.y
        cos, sin = math.cos(motion.yaw), math.sin(motion.yaw)
        return cos * dx + sin * dy, cos * dy - sin * dx

    def step(self, vx: float, vy: float, spin: float) -> None:
        """Push the body for the next physics step, and move on.

        Args:
            vx: speed that is asked for [m/s], `world` axes.
            vy: as `vx`.
            spin: turning that is asked for [rad/s].
        """
        self._squeeze()
        spec, step, reference, speed = self._spec, self._step, self._reference, self._speed
        force_x = spec.stiffness * (reference[0] - self.x) + self._servo_damping * (vx - speed[0])
        force_y = spec.stiffness * (reference[1] - self.y) + self._servo_damping * (vy - speed[1])
        torque = spec.turn_stiffness * wrap(reference[2] - self.yaw) + spec.turn_damping * (spin - speed[2])
        back = max(1.0, math.hypot(force_x, force_y) / spec.force_limit)
        torque = max(-spec.torque_limit, min(spec.torque_limit, torque))
        ax = (force_x / back - self.force[0]) / spec.mass
        ay = (force_y / back - self.force[1]) / spec.mass
        turning = (torque - self.torque) / spec.inertia
        self._acceleration = ax, ay, turning
        speed[0] += ax * step
        speed[1] += ay * step
        speed[2] += turning * step
        self.x, self.y = self.x + speed[0] * step, self.y + speed[1] * step
        self.yaw += speed[2] * step
        self._move_reference(vx * step, vy * step, spin * step)

    def _move_reference(self, dx: float, dy: float, turn: float) -> None:
        """Let the servo's reference go on, unless the hand cannot follow."""
        x, y, yaw = self._reference
        x, y, yaw = x + dx, y + dy, yaw + turn
        behind = math.hypot(x - self.x, y - self.y)
        if behind > self._spec.lag:
            share = self._spec.lag / behind
            x, y = self.x + share * (x - self.x), self.y + share * (y - self.y)
        most = self._spec.torque_limit / self._spec.turn_stiffness
        self._reference = [x, y, self.yaw + max(-most, min(most, wrap(yaw - self.yaw)))]

    def _squeeze(self) -> None:
        """Let the rubber push on the body."""
        motion, bristle = self._motion, self._bristle
        if motion is None or bristle is None:
            return
        motion.look()
        x, y = self._in_body(motion)
        cos, sin = math.cos(motion.yaw), math.sin(motion.yaw)
        body_vx, body_vy = motion.speed_at((self.x, self.y))
        dvx, dvy = self._speed[0] - body_vx, self._speed[1] - body_vy
        speed = (cos * dvx + sin * dvy, cos * dvy - sin * dvx)
        fx, fy, torque = bristle.load(x, y, speed, self.yaw - motion.yaw, self._speed[2] - motion.spin)
        self.force, self.torque = (cos * fx - sin * fy, sin * fx + cos * fy), torque
        motion.push((*self.force, 0.0), (self.x, self.y, self.height))
        motion.turn(torque)

    def sensor_pose(self) -> Pose:
        """Give the pose of the force-torque sensor's frame: +y along the approach, z up."""
        reach = self._spec.reach
        place = [self.x - reach * math.cos(self.yaw), self.y - reach * math.sin(self.yaw), self.height]
        return Pose(np.array(place), yaw_quaternion(self.yaw - math.pi / 2))

    def wrist_wrench(self, gravity: tuple[float, float, float] = (0.0, 0.0, -GRAVITY)) -> tuple[Array, Array]:
        """Give what gripper and world exert on the sensor in this step.

        Args:
            gravity: acceleration of fall (3,) [m/s^2], `world` axes.

        Returns:
            Force (3,) [N] and torque (3,) [N m] at the sensor's origin, in its axes.
        """
        spec = self._spec
        ax, ay, turning = self._acceleration
        cos, sin, spin = math.cos(self.yaw), math.sin(self.yaw), self._speed[2]
        # From the clamped patch back to the gripper's centre of mass, along the approach.
        back = spec.reach - spec.gripper_centre
        ax += back * (turning * sin + spin * spin * cos)
        ay += back * (-turning * cos + spin * spin * sin)
        m = spec.gripper_mass
        weight_x, weight_y = m * (gravity[0] - ax), m * (gravity[1] - ay)
        along, across = cos * weight_x + sin * weight_y, cos * weight_y - sin * weight_x
        push, sideways = -(cos * self.force[0] + sin * self.force[1]), -(cos * self.force[1] - sin * self.force[0])
        # Sensor axes: y along the approach, x to its right, z up.
        down = m * gravity[2]
        force = np.array([-(across + sideways), along + push, down])
        about = -self.torque - spec.gripper_inertia * turning
        about += spec.gripper_centre * across + spec.reach * sideways
        return force, np.array([spec.gripper_centre * down, 0.0, about])
