"""Messages that fuzzing found to end a node, a listener or the viewer: each is refused, or left out."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Point, Pose, PoseStamped, WrenchStamped
from nav_msgs.msg import MapMetaData, OccupancyGrid
from pbrl_msgs.msg import Mismatch, MismatchEffect, Mismatches, Scene
from rclpy.context import Context
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from pbrl_bag import BagError
from pbrl_bringup.fuzz.push_seed import models, push
from pbrl_bringup.graph import free_domain
from pbrl_bringup.view.live import LiveGraph
from pbrl_control.errors import ControlError
from pbrl_control.kinematics import ARM_JOINTS, BODY_JOINTS
from pbrl_control.ros.conversions import bodies_from_msg, movable_from_msg, posture_from_msg
from pbrl_control.ros.floor_conversions import room_from_msg
from pbrl_model.ros.heard import Heard, Message
from pbrl_namo.errors import NamoError
from pbrl_namo.ros.conversions import goal_from_pose
from pbrl_planner.cart.tracker import CartTracker
from pbrl_planner.errors import PlannerError
from pbrl_planner.ros.conversions import planar_pose
from pbrl_planner.ros.costmap_node import CostmapNode

HOSTILE = [math.nan, math.inf, 1e308, -1e200]


def of_topic(topic: str) -> Any:
    return next(message for name, _, message, _ in push() if name == topic)


@pytest.mark.parametrize("field", ["position", "orientation"])
@pytest.mark.parametrize("value", HOSTILE)
def test_a_pose_of_no_place_is_refused(value: float, field: str) -> None:
    """1e308 squared is an OverflowError in Python, not infinity."""
    pose = Pose()
    pose.orientation.w = 1.0
    getattr(pose, field).x = value
    with pytest.raises(PlannerError, match="pose: expected"):
        planar_pose(pose, "pose")
    if field == "orientation":
        goal = PoseStamped(pose=pose)
        goal.header.frame_id = "world"
        with pytest.raises(NamoError, match="quaternion"):
            goal_from_pose(goal)


@pytest.mark.parametrize("name", ["", "../table", "a/b", "1st", "x y", "<script>", "é", "x" * 300 + "/"])
def test_a_body_that_cannot_be_a_topic_is_refused(name: str) -> None:
    scene: Scene = of_topic("/scene")
    scene.bodies[0].name = name
    for convert in (bodies_from_msg, movable_from_msg):
        with pytest.raises(BagError, match="letters, digits and underscores"):
            convert(scene)


@pytest.mark.parametrize("value", HOSTILE)
def test_an_outline_and_a_room_of_no_numbers_are_refused(value: float) -> None:
    scene: Scene = of_topic("/scene")
    scene.bodies[0].footprint[1].x = value
    with pytest.raises(BagError, match="footprint"):
        bodies_from_msg(scene)
    scene.bodies[0].footprint = []
    with pytest.raises(BagError, match="at least 3 corners"):
        bodies_from_msg(scene)
    scene.room = [Point(x=math.nan)] * 3
    with pytest.raises(ControlError, match="room"):
        room_from_msg(scene)


def test_joint_states_without_positions_or_of_no_numbers_are_refused() -> None:
    names = [*BODY_JOINTS, *ARM_JOINTS["left"], *ARM_JOINTS["right"]]
    with pytest.raises(ControlError, match="a position a name"):
        posture_from_msg(JointState(name=names, position=[0.0]))
    with pytest.raises(ControlError, match="finite"):
        posture_from_msg(JointState(name=names, position=[0.0] * 15 + [math.nan]))


@pytest.mark.parametrize("topic", ["/grasps", "/wrist_ft/left", "/scene"])
def test_bytes_that_are_no_message_leave_a_listener_listening(topic: str) -> None:
    heard, message = Heard(10**6), of_topic(topic)
    heard.follow()
    data = serialize_message(message)[:8] + b"\xff" * 40
    heard.add(Message(topic, type(message), data))
    with pytest.raises(BagError, match=f"{topic}: expected a {type(message).__name__}"):
        Message(topic, type(message), data).decoded()
    heard.add(Message(topic, type(message), serialize_message(message)))
    assert heard.count == 2


def test_a_cart_that_cannot_be_is_not_taken_for_the_last_one() -> None:
    tracker = CartTracker()
    tracker.grasps({"left": "cart", "right": "cart"})
    with pytest.raises(PlannerError):
        tracker.furniture({"cart": np.array([[0.0, 0.0], [1e9, 0.0], [1e9, 1.0]])})
    assert tracker.cart is None


def test_the_viewer_leaves_out_a_finding_that_is_none() -> None:
    graph, told = LiveGraph("x"), Mismatches()
    for name, probability in (("crate", math.nan), ("table_a", 0.5)):
        told.mismatches.append(Mismatch(object=name, effects=[MismatchEffect(effect="x", probability=probability)]))
    graph.hear("/mismatches", told)
    data = graph.data()
    assert any("'crate' is no finding" in note for note in data["notes"])
    json.dumps(data, allow_nan=False)


def test_the_costmap_outlives_a_cart_that_is_told_to_be_nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """Corners so far away that the outline has no area any more."""
    with free_domain() as domain:
        context = Context()
        rclpy.init(context=context, domain_id=domain)
        node = CostmapNode(context=context)
        node._on_map(OccupancyGrid(info=MapMetaData(resolution=0.1, width=3, height=3), data=[0] * 9))
        monkeypatch.setattr(node.tracker, "own", lambda now: [np.array([[1e17, 0.0], [1e17 + 1, 0.0], [1e17, 1.0]])])
        node._tell_global()
        assert not node._clear(Trigger.Request(), Trigger.Response()).success
        node.destroy_node()
        rclpy.try_shutdown(context=context)


@pytest.mark.parametrize("quaternion", [(0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 1.0), (1e308, 1e308, 0.0, 1.0)])
def test_the_viewer_draws_what_a_graph_without_sense_says(quaternion: tuple[float, float, float, float]) -> None:
    graph = LiveGraph("x")
    felt: WrenchStamped = of_topic("/wrist_ft/left")
    pose: PoseStamped = of_topic("/ar_tags/left_gripper/pose")
    turn = pose.pose.orientation
    turn.x, turn.y, turn.z, turn.w = quaternion
    learned = models()
    learned.models[0].units = learned.models[0].units[:2]
    for topic, message in (("/wrist_ft/left", felt), ("/ar_tags/left_gripper/pose", pose), ("/object_models", learned)):
        graph.hear(topic, message)
    data = graph.data()
    json.dumps([data, graph.detail(0.0, 5.0, 100)], allow_nan=False)
    assert any("do not fit" in note for note in data["notes"])
