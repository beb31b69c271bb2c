"""A closed gripper: two compliant rubber plates that hold a table's edge, and slip when they are asked too much.

Rubber is an elastic bristle in three translations and one turn about the plates' normal. In the plane of the plates
it slips beyond a limit surface, see `bristle.py`. Across the plates the rubber is squeezed and does not slip. When too
little of the edge is left between the plates, or it has left the opening, the grasp is lost.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bullet_sim.bristle import Bristle
from bullet_sim.clamp import Clamp, GripperSpec, held_interval
from bullet_sim.client import BulletClient, Pose, Twist, cross
from bullet_sim.errors import SimError
from bullet_sim.furniture import Furniture
from bullet_sim.quiet import bullet

Array = NDArray[np.float64]

LAST_HOLD = 0.005
"""Depth [m] of edge between the plates below which a slipping grasp is lost."""


@dataclass(frozen=True)
class GripLoad:
    """What a grip does to its object, as applied for one step.

    Attributes:
        force: (3,) [N] on the object, `world` axes.
        torque: (3,) [N m] on the object at `point`, `world` axes.
        point: (3,) [m] middle of the clamped patch in `world`.
        slipping: whether the plates slip.
    """

    force: Array
    torque: Array
    point: Array
    slipping: bool


class Grip:
    """A gripper closed on an edge; call `apply` before each step of the world.

    Attributes:
        clamp: the edge as it was when the plates closed.
        load: what was applied last.
        lost: whether the edge has left the plates; nothing is applied from then on.
    """

    def __init__(
        self, client: BulletClient, gripper: tuple[str, int], spec: GripperSpec, body: Furniture, clamp: Clamp
    ) -> None:
        """Close the plates.

        Args:
            client: the world.
            gripper: name of the robot and number of the link that carries the plates.
            spec: the plates.
            body: what is held.
            clamp: where, from `find_clamp` with the same poses.

        Raises:
            SimError: the clamp is of another body, or the body has no edge.
        """
        if not body.slabs or clamp.body != body.name:
            raise SimError(f"grip: expected a clamp on an edge of {body.name!r}, got one on {clamp.body!r}")
        self.clamp, self.lost = clamp, False
        self._client, self._gripper, self._spec, self._body = client, gripper, spec, body
        self._slab = body.slab_at(clamp.contact)
        self._hand = spec.along(clamp.reach)  # where the bristle ends, in the gripper's frame
        self._root = clamp.contact.copy()  # where it begins, in the body's tag frame
        turn = self._relative_turn(self._gripper_state()[0], body.pose())
        self._bristle = Bristle(spec, clamp.depth, (float(self._root[0]), float(self._root[1])), turn)
        self.load = GripLoad(np.zeros(3), np.zeros(3), body.pose().point(self._root), False)

    @property
    def slipped(self) -> float:
        """Way [m] the plates have slid over the edge so far."""
        return self._bristle.slipped

    def _gripper_state(self) -> tuple[Pose, Twist]:
        return self._client.link_twist(*self._gripper)

    @staticmethod
    def _relative_turn(gripper: Pose, body: Pose) -> float:
        """Give the gripper's turn [rad] about the body's vertical, from any fixed start."""
        axis = body.matrix.T @ gripper.matrix[:, 1]
        return math.atan2(axis[1], axis[0])

    def apply(self) -> GripLoad:
        """Push gripper and object apart or together for the next step, and let the plates slip if they must.

        Returns:
            What acts on the object; zeros once the grasp is lost.
        """
        hand_pose, hand_twist = self._gripper_state()
        pose, twist = self._body.state()
        point = hand_pose.point(self._hand)
        stretch = pose.inverse_point(point) - self._root
        self.lost = self.lost or self._is_out(hand_pose, pose, stretch)
        if self.lost:
            self.load = GripLoad(np.zeros(3), np.zeros(3), point, False)
            return self.load
        turn_back = pose.matrix.T
        hand_speed = hand_twist.linear + cross(hand_twist.angular, point - hand_pose.position)
        body_speed = twist.linear + cross(twist.angular, point - pose.position)
        speed = turn_back @ (hand_speed - body_speed)
        twist_rate = float((turn_back @ (hand_twist.angular - twist.angular))[2])
        force, torque = self._rubber(stretch, speed, self._relative_turn(hand_pose, pose), twist_rate)
        self.load = GripLoad(pose.matrix @ force, pose.matrix @ [0.0, 0.0, torque], point, self._bristle.slipping)
        self._push()
        return self.load

    def _rubber(self, stretch: Array, speed: Array, turn: float, spin: float) -> tuple[Array, float]:
        """Give force (3,) and torque on the object in its own axes; across the plates the rubber is squeezed."""
        bristle, spec = self._bristle, self._spec
        x, y = stretch[0] + self._root[0], stretch[1] + self._root[1]
        force_x, force_y, torque = bristle.load(x, y, (speed[0], speed[1]), turn, spin)
        self._root[:2] = bristle.root
        across = spec.stiffness * stretch[2] + bristle.damping * speed[2]
        return np.array([force_x, force_y, max(-2 * spec.force, min(2 * spec.force, across))]), torque

    def _push(self) -> None:
        """Hand the load to Bullet: on the object, and its opposite on the gripper."""
        api, load, (robot, link) = self._client.api, self.load, self._gripper
        body, number = self._client.body(self._body.name), self._client.body(robot)
        self._body.apply_force(load.force, load.point)
        api.applyExternalTorque(body, -1, load.torque.tolist(), bullet.WORLD_FRAME)
        self._client.apply_force(robot, link, -load.force, load.point)
        api.applyExternalTorque(number, link, (-load.torque).tolist(), bullet.WORLD_FRAME)

    def _is_out(self, hand: Pose, body: Pose, stretch: Array) -> bool:
        """Tell whether the edge has left the plates: across them, or, where it slips, along them."""
        spec = self._spec
        if abs(stretch[2]) > spec.opening / 2:
            return True
        if not self.load.slipping:
            return False
        start, end = (body.inverse_point(hand.point(spec.along(at))) for at in (spec.plate_start, spec.plate_end))
        low, high = held_interval(self._slab.outline, start, end)
        return (high - low) * (spec.plate_end - spec.plate_start) < LAST_HOLD
