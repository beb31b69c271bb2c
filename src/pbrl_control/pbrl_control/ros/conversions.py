"""Messages to library types and back; paired plain functions, no node needed."""

from __future__ import annotations

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped, WrenchStamped
from pbrl_msgs.msg import Grasps, Scene
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from pbrl_bag.geometry import bodies_of_scene
from pbrl_control.kinematics import Posture
from pbrl_control.percept import BodyShape, Grip, Tag
from pbrl_control.planar import Array
from pbrl_control.types import PlanarTwist


def seconds(stamp: Time) -> float:
    """Return a stamp in seconds."""
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def posture_from_msg(message: JointState) -> Posture:
    """Return the posture in a joint-state message; raise ControlError where a joint is missing."""
    return Posture.from_joint_states(message.name, message.position)


def wrench_from_msg(message: WrenchStamped) -> Array:
    """Return force then torque (6,) [N, N m]."""
    force, torque = message.wrench.force, message.wrench.torque
    return np.array([force.x, force.y, force.z, torque.x, torque.y, torque.z])


def tag_from_msg(message: PoseStamped) -> Tag:
    """Return a tag as it was seen at the message's stamp."""
    p, q = message.pose.position, message.pose.orientation
    return Tag(seconds(message.header.stamp), np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w]))


def grips_from_msg(message: Grasps) -> dict[str, Grip]:
    """Return what each closed gripper holds."""
    return {
        grasp.gripper: Grip(grasp.object, np.array([grasp.contact_point.x, grasp.contact_point.y]))
        for grasp in message.grasps
    }


def expected_to_msg(target: str, wrench: Array, stamp: Time) -> WrenchStamped:
    """Return the wrench (3,) that a grip is expected to apply to an object, fx, fy [N], tau [N m], object axes."""
    message = WrenchStamped()
    message.header.stamp, message.header.frame_id = stamp, target
    message.wrench.force.x, message.wrench.force.y = float(wrench[0]), float(wrench[1])
    message.wrench.torque.z = float(wrench[2])
    return message


def expected_from_msg(message: WrenchStamped) -> Array:
    """Return the wrench (3,) that a grip is expected to apply, see `expected_to_msg`."""
    force = message.wrench.force
    return np.array([force.x, force.y, message.wrench.torque.z])


def bodies_from_msg(message: Scene) -> dict[str, BodyShape]:
    """Return the known geometry by name.

    Raises:
        BagError: a name that cannot be part of a topic, an outline that is none, or a number that is not finite.
    """
    known = bodies_of_scene("/scene", message)
    return {name: BodyShape(body.footprint, body.height) for name, body in known.items()}


def movable_from_msg(message: Scene) -> list[str]:
    """Return the names of what can be moved; raise BagError as `bodies_from_msg` does."""
    return [name for name, body in bodies_of_scene("/scene", message).items() if body.movable]


def twist_from_msg(message: TwistStamped) -> tuple[str, PlanarTwist]:
    """Return what a twist command is for, and the twist."""
    linear, angular = message.twist.linear, message.twist.angular
    return message.header.frame_id, PlanarTwist(linear.x, linear.y, angular.z, linear.z)


def twist_to_msg(target: str, twist: PlanarTwist, stamp: Time) -> TwistStamped:
    """Return the message that commands a twist of `target`."""
    message = TwistStamped()
    message.header.stamp, message.header.frame_id = stamp, target
    linear = message.twist.linear
    linear.x, linear.y, linear.z = float(twist.vx), float(twist.vy), float(twist.vz)
    message.twist.angular.z = float(twist.omega)
    return message


def base_to_msg(v: float, w: float) -> Twist:
    """Return a base velocity command."""
    message = Twist()
    message.linear.x, message.angular.z = float(v), float(w)
    return message


def arm_to_msg(velocity: Array) -> Float64MultiArray:
    """Return joint velocities [rad/s] as ros2_control's forward controllers take them."""
    return Float64MultiArray(data=[float(value) for value in velocity])
