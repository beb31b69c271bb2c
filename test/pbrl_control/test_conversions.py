"""Messages to library types: every message goes through its wire form first."""

from __future__ import annotations

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PoseStamped, WrenchStamped
from pbrl_msgs.msg import Body, Grasp, Grasps, Scene
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from pbrl_control.errors import ControlError
from pbrl_control.kinematics import ARM_JOINTS, BODY_JOINTS
from pbrl_control.ros import conversions
from pbrl_control.types import PlanarTwist


def wired(message):
    return deserialize_message(serialize_message(message), type(message))


def test_twist_there_and_back() -> None:
    twist = PlanarTwist(0.1, -0.2, 0.3, 0.04)
    message = wired(conversions.twist_to_msg("table_a", twist, Time(sec=3, nanosec=500_000_000)))
    assert conversions.twist_from_msg(message) == ("table_a", twist)
    assert conversions.seconds(message.header.stamp) == 3.5


def test_an_expected_wrench_there_and_back() -> None:
    message = wired(conversions.expected_to_msg("table_a", np.array([3.0, -1.5, 0.25]), Time(sec=2)))
    np.testing.assert_array_equal(conversions.expected_from_msg(message), [3.0, -1.5, 0.25])
    assert message.header.frame_id == "table_a"


def test_commands_reach_the_wire() -> None:
    base = wired(conversions.base_to_msg(np.float64(0.2), np.float64(-0.1)))
    assert (base.linear.x, base.angular.z) == (0.2, -0.1)
    assert list(wired(conversions.arm_to_msg(np.arange(7) / 8)).data) == list(np.arange(7) / 8)


def test_joint_states_in_any_order() -> None:
    names = [*ARM_JOINTS["right"], "lwheel", *ARM_JOINTS["left"], "rwheel", *BODY_JOINTS]
    message = wired(JointState(name=names, position=[float(i) for i in range(18)]))
    posture = conversions.posture_from_msg(message)
    assert posture.right[0] == 0.0
    assert posture.left[0] == 8.0
    assert (posture.waist, posture.torso) == (16.0, 17.0)
    with pytest.raises(ControlError, match="waist"):
        conversions.posture_from_msg(JointState(name=["LJ1"], position=[0.0]))


def test_a_wrench_is_force_then_torque() -> None:
    message = WrenchStamped()
    message.wrench.force.x, message.wrench.force.z, message.wrench.torque.y = 1.0, 3.0, 5.0
    np.testing.assert_array_equal(conversions.wrench_from_msg(wired(message)), [1, 0, 3, 0, 5, 0])


def test_a_tag_keeps_its_capture_time() -> None:
    message = PoseStamped()
    message.header.stamp = Time(sec=1, nanosec=250_000_000)
    message.pose.position.y, message.pose.orientation.w = 2.0, 1.0
    tag = conversions.tag_from_msg(wired(message))
    assert tag.time == 1.25
    np.testing.assert_array_equal(tag.position, [0, 2, 0])
    assert tag.finite()


def test_grasps_and_scene() -> None:
    grasp = Grasp(gripper="left", object="table_a", contact_point=Point(x=-0.36, y=0.4, z=-0.01))
    grips = conversions.grips_from_msg(wired(Grasps(grasps=[grasp])))
    np.testing.assert_array_equal(grips["left"].contact, [-0.36, 0.4])
    corners = [Point(x=0.0), Point(x=1.0), Point(x=1.0, y=1.0)]
    bodies = conversions.bodies_from_msg(wired(Scene(bodies=[Body(name="table_a", footprint=corners, height=0.7)])))
    assert bodies["table_a"].footprint.shape == (3, 2)
    assert bodies["table_a"].height == 0.7
