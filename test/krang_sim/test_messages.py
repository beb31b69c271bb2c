"""Observations through real serialization: every field arrives, on its topic, in its frame."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from krang_sim.messages import message_types, stamp, to_messages
from krang_sim.observations import (
    ClockTick,
    GraspState,
    Hold,
    JointStates,
    KnownBody,
    KnownScene,
    Odometry,
    Outlines,
    RobotDescription,
    TagReading,
    Transforms,
    WristReading,
)

SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
DESK = KnownBody("desk", SQUARE, 0.75, 33.0, True, np.array([1.0, 2.0, 0.5]), SQUARE * 0.9)
PILLAR = KnownBody("pillar", SQUARE[:3], 2.0, math.nan, False, np.zeros(3), np.empty((0, 2)))
TURN = np.array([0.0, 0.0, math.sin(0.2), math.cos(0.2)])
OBSERVATIONS = [
    ClockTick(1.25),
    JointStates(1.25, ("a", "b"), np.array([0.1, 0.2]), np.array([0.3, 0.4])),
    Odometry(1.25, np.array([1.0, 2.0, 0.4]), np.array([0.1, -0.2])),
    Transforms(1.25, ("odom",), ("base",), np.array([[1.0, 2, 3]]), TURN[None]),
    Transforms(0.0, ("base",), ("slider",), np.array([[-0.46, 0, 0]]), np.array([[0.0, 0, 0, 1]]), static=True),
    RobotDescription(0.0, "<robot name='krang'/>"),
    KnownScene(0.0, (DESK, PILLAR), SQUARE * 5),
    GraspState(1.25, (Hold("left", "desk", np.array([0.1, 0.2, 0.0])),)),
    WristReading(1.25, "right", np.array([1.0, 2, 3]), np.array([4.0, 5, 6])),
    TagReading(1.25, "desk", np.array([1.0, 2, 3]), TURN),
    Outlines(1.25, {"desk": DESK}, {"desk": np.array([1.0, 2, 0.75, *TURN])}),
]


def through_the_wire(observation):
    ((topic, message),) = to_messages(observation)
    return topic, deserialize_message(serialize_message(message), type(message))


@pytest.mark.parametrize("observation", OBSERVATIONS, ids=lambda each: type(each).__name__)
def test_round_trip_keeps_everything(observation):
    ((_, message),) = to_messages(observation)
    assert repr(through_the_wire(observation)[1]) == repr(message)  # as text, because NaN is not equal to itself


@pytest.mark.parametrize("observation", OBSERVATIONS, ids=lambda each: type(each).__name__)
def test_topic_carries_the_type_the_node_announces(observation):
    topic, message = through_the_wire(observation)
    assert message_types(("desk",))[topic] is type(message)


def test_every_announced_topic_is_served_by_an_observation():
    served = {to_messages(observation)[0][0] for observation in OBSERVATIONS}
    rest = set(message_types(("desk",))) - served
    assert rest == {"/wrist_ft/left", "/ar_tags/left_gripper/pose", "/ar_tags/right_gripper/pose"}


def test_wrench_is_in_the_sensors_frame():
    topic, message = through_the_wire(OBSERVATIONS[8])
    assert topic == "/wrist_ft/right"
    assert message.header.frame_id == "right_ft"
    force, torque = message.wrench.force, message.wrench.torque
    assert (force.x, force.y, force.z, torque.x, torque.y, torque.z) == (1, 2, 3, 4, 5, 6)


def test_odometry_is_of_base_in_odom():
    _, message = through_the_wire(OBSERVATIONS[2])
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base")
    turn = message.pose.pose.orientation
    assert 2 * math.atan2(turn.z, turn.w) == pytest.approx(0.4)
    assert (message.twist.twist.linear.x, message.twist.twist.angular.z) == (0.1, -0.2)
    assert np.linalg.eigvalsh(np.array(message.pose.covariance).reshape(6, 6)).min() > 0


def test_scene_tells_geometry_and_nan_for_no_mass():
    _, message = through_the_wire(OBSERVATIONS[6])
    desk, pillar = message.bodies
    assert (desk.name, desk.height, desk.nominal_mass, desk.movable) == ("desk", 0.75, 33.0, True)
    assert [(point.x, point.y) for point in desk.footprint] == [tuple(corner) for corner in SQUARE]
    assert len(desk.casters) == 4
    assert (desk.pose.x, desk.pose.y, desk.pose.theta) == (1.0, 2.0, 0.5)
    assert math.isnan(pillar.nominal_mass)
    assert not pillar.movable
    assert len(message.room) == 4


def test_outline_is_drawn_where_the_tag_was_and_closes():
    _, message = through_the_wire(OBSERVATIONS[10])
    (marker,) = message.markers
    assert (marker.pose.position.x, marker.pose.position.z) == (1.0, 0.75)
    assert marker.points[0] == marker.points[-1]
    assert marker.header.frame_id == "world"


@pytest.mark.parametrize(
    ("time", "expected"),
    [(0.0, (0, 0)), (1.25, (1, 250_000_000)), (0.9999999999, (1, 0)), (1e5 + 0.01, (100000, 10**7))],
)
def test_stamp_rounds_to_the_nanosecond(time, expected):
    made = stamp(time)
    assert (made.sec, made.nanosec) == expected


def test_something_else_is_refused():
    with pytest.raises(TypeError, match="expected an observation"):
        to_messages("hello")  # type: ignore[arg-type]
