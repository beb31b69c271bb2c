"""Messages to a recording: the contract's topics, foreign ones, and what is missing from either."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from pbrl_bag import BagError, Mapping, RecordingBuilder
from pbrl_bag.mapping import FramePose


def over_the_wire(message: Any) -> Any:
    """What a subscriber gets."""
    return deserialize_message(serialize_message(message), type(message))


def build(messages: list, mapping: Mapping | None = None, without: str = "", replace: dict | None = None):
    builder = RecordingBuilder(mapping)
    for topic, _, message, _ in messages:
        if topic != without:
            builder.add(topic, over_the_wire((replace or {}).get(topic, message)))
    return builder.build("push")


def test_the_contract_fills_every_part(kit: SimpleNamespace) -> None:
    recording = build(kit.pushing())
    assert set(recording.object_poses) == {"table"}
    assert set(recording.gripper_poses) == set(recording.wrenches) == {"left"}
    np.testing.assert_array_equal(recording.bodies["table"].footprint, kit.square)
    assert recording.bodies["table"].nominal_mass == 20.0
    assert recording.room.shape == (3, 2)
    (grasp,) = recording.grasps
    assert (grasp.gripper, grasp.object, grasp.start, grasp.end) == ("left", "table", 1.0, 3.0)
    np.testing.assert_array_equal(grasp.contact, [-0.5, 0.0])
    felt = recording.wrenches["left"]
    np.testing.assert_allclose(felt.force[:, 0], 10.0 + felt.time)
    assert (felt.exerted_on, felt.frame) == ("gripper", "sensor")
    assert recording.notes == ()


def test_topics_without_a_role_are_left_alone() -> None:
    builder = RecordingBuilder()
    assert not builder.wants("/rosout")
    builder.add("/rosout", String(data="hello"))


def test_a_grasp_still_held_at_the_end_lasts_to_the_end(kit: SimpleNamespace) -> None:
    messages = [one for one in kit.pushing() if not (one[0] == "/grasps" and one[3] == 3_000_000_000)]
    (grasp,) = build(messages).grasps
    assert (grasp.start, grasp.end) == (1.0, 3.98)


def test_closing_the_other_gripper_does_not_cut_the_first_grasp(kit: SimpleNamespace) -> None:
    messages = kit.pushing()
    messages += [("/wrist_ft/right", "", kit.wrench(t, frame="right_ft"), 0) for t in (0.0, 2.0, 3.9)]
    messages += [("/ar_tags/right_gripper/pose", "", kit.pose(t), 0) for t in (0.0, 2.0, 3.9)]
    changes = [one for one in messages if one[0] == "/grasps"]
    changes.insert(2, ("/grasps", "", kit.grasps(2.0, "left", "right"), 0))
    grasps = build([one for one in messages if one[0] != "/grasps"] + changes).grasps
    assert [(g.gripper, g.start, g.end) for g in grasps] == [("left", 1.0, 3.0), ("right", 2.0, 3.0)]


@pytest.mark.parametrize(
    "topic", ["/scene", "/grasps", "/wrist_ft/left", "/ar_tags/table/pose", "/ar_tags/left_gripper/pose"]
)
def test_a_missing_topic_is_named(kit: SimpleNamespace, topic: str) -> None:
    with pytest.raises(BagError) as caught:
        build(kit.pushing(), without=topic)
    assert f"expected topic {topic!r}" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "push:" in str(caught.value)


def test_nothing_at_all_is_an_error_too() -> None:
    with pytest.raises(BagError, match="expected topic"):
        RecordingBuilder().build("nothing")


@pytest.mark.parametrize(
    ("topic", "make", "words"),
    [
        ("/ar_tags/table/pose", lambda kit: kit.pose(1.0, frame="map"), ["header.frame_id", "'world'", "'map'"]),
        ("/wrist_ft/left", lambda kit: kit.wrench(1.0, frame="base"), ["header.frame_id", "'left_ft'", "'base'"]),
        ("/wrist_ft/left", lambda kit: kit.pose(1.0), ["expected geometry_msgs/WrenchStamped", "PoseStamped"]),
        ("/ar_tags/table/pose", lambda kit: kit.wrench(1.0), ["expected a stamped pose", "WrenchStamped"]),
        ("/grasps", lambda kit: kit.scene(), ["expected pbrl_msgs/Grasps", "Scene"]),
        ("/scene", lambda kit: kit.grasps(1.0), ["expected pbrl_msgs/Scene", "Grasps"]),
        ("/grasps", lambda kit: kit.grasps(1.0, "middle"), ["gripper", "'middle'"]),
        ("/grasps", lambda kit: kit.grasps(1.0, "left", "left"), ["'left'", "two objects"]),
    ],
)
def test_a_message_that_does_not_fit_its_role_is_refused(
    kit: SimpleNamespace, topic: str, make: Any, words: list[str]
) -> None:
    with pytest.raises(BagError) as caught:
        build(kit.pushing(), replace={topic: make(kit)})
    for word in [topic, *words]:
        assert word in str(caught.value)


def test_a_grasp_on_something_unknown_names_the_nearest_body(kit: SimpleNamespace) -> None:
    messages = [one for one in kit.pushing() if one[0] != "/grasps"]
    messages.append(("/grasps", "", kit.grasps(1.0, "left", name="tabel"), 0))
    with pytest.raises(BagError, match=r"'tabel'.*did you mean 'table'"):
        build(messages)


def test_changes_of_grasp_that_go_back_in_time_are_refused(kit: SimpleNamespace) -> None:
    messages = [*kit.pushing(), ("/grasps", "", kit.grasps(0.5), 0)]
    with pytest.raises(BagError, match=r"/grasps: t = 0\.500000 s: stamp: time goes backwards"):
        build(messages)


@pytest.mark.parametrize("corner", ["clockwise", "nan", "few"])
def test_a_footprint_that_makes_no_sense_is_refused(kit: SimpleNamespace, corner: str) -> None:
    scene = kit.scene()
    points = scene.bodies[0].footprint
    if corner == "clockwise":
        scene.bodies[0].footprint = points[::-1]
    elif corner == "nan":
        points[0].x = float("nan")
    else:
        scene.bodies[0].footprint = points[:2]
    with pytest.raises(BagError, match="/scene: body 'table': footprint"):
        build(kit.pushing(), replace={"/scene": scene})


def foreign(kit: SimpleNamespace, kind: str, t: float, x: float, yaw: float) -> Any:
    """One pose in a message of another type."""
    source = kit.pose(t, x, 0.2, yaw, frame="mocap")
    if kind == "Odometry":
        message: Any = Odometry(header=source.header)
        message.pose.pose = source.pose
    elif kind == "PoseWithCovarianceStamped":
        message = PoseWithCovarianceStamped(header=source.header)
        message.pose.pose = source.pose
    elif kind == "PoseStamped":
        message = source
    else:
        message = TransformStamped(header=source.header, child_frame_id="table")
        at = source.pose.position
        message.transform.translation.x, message.transform.translation.y, message.transform.translation.z = (
            at.x, at.y, at.z,
        )  # fmt: skip
        message.transform.rotation = source.pose.orientation
        if kind == "TFMessage":
            other = over_the_wire(message)
            other.child_frame_id, other.transform.translation.x = "chair", 9.0
            message = TFMessage(transforms=[other, message])
    return message


def mapping_for(kind: str, **more: Any) -> Mapping:
    return Mapping.model_validate(
        {
            "world": "mocap",
            "bodies": {"table": {"footprint": [[0, 0], [1, 0], [1, 1]], "height": 1.0}},
            "object_poses": {"table": {"topic": "/seen", "child_frame": "table" if "T" in kind[:2] else None, **more}},
            "wrenches": {"left": {"topic": "/ft", "exerted_on": "object", "axes": "mocap"}},
            "grasps": [{"gripper": "left", "object": "table"}],
        }
    )


def read_foreign(kit: SimpleNamespace, kind: str, **more: Any):
    builder = RecordingBuilder(mapping_for(kind, **more))
    for i in range(10):
        builder.add("/seen", over_the_wire(foreign(kit, kind, 0.1 * i, 0.01 * i, 0.02 * i)))
        builder.add("/ft", over_the_wire(kit.wrench(0.1 * i, frame="anything")))
    return builder.build("foreign")


@pytest.mark.parametrize("kind", ["PoseWithCovarianceStamped", "Odometry", "TransformStamped", "TFMessage"])
def test_one_pose_is_the_same_in_every_type(kit: SimpleNamespace, kind: str) -> None:
    expected, got = (read_foreign(kit, one).object_poses["table"] for one in ("PoseStamped", kind))
    np.testing.assert_array_equal(got.time, expected.time)
    np.testing.assert_array_equal(got.position, expected.position)
    np.testing.assert_array_equal(got.quaternion, expected.quaternion)


def test_a_topic_of_many_transforms_needs_a_child_frame(kit: SimpleNamespace) -> None:
    with pytest.raises(BagError, match=r"/seen: carries many transforms: expected child_frame"):
        read_foreign(kit, "TFMessage", child_frame=None)


def test_an_offset_moves_the_pose_along_the_bodys_own_axes(kit: SimpleNamespace) -> None:
    plain = read_foreign(kit, "PoseStamped").object_poses["table"]
    moved = read_foreign(kit, "PoseStamped", offset={"position": [0.3, 0.0, 0.0]}).object_poses["table"]
    yaw = 0.02 * np.arange(10)
    expected = plain.position + 0.3 * np.column_stack([np.cos(yaw), np.sin(yaw), np.zeros(10)])
    np.testing.assert_allclose(moved.position, expected)
    np.testing.assert_allclose(moved.quaternion, plain.quaternion)


@pytest.mark.parametrize("length", [0.0, 3.0])
@pytest.mark.parametrize("more", [{"offset": {"position": [0.3, 0.0, 0.0]}}, {"frame": "mocap"}])
def test_what_is_no_orientation_is_none_in_another_frame_either(
    kit: SimpleNamespace, more: dict[str, Any], length: float
) -> None:
    mapping = mapping_for("PoseStamped", **more)
    builder = RecordingBuilder(mapping.model_copy(update={"frames": {"mocap": FramePose(position=(1.0, 0.0, 0.0))}}))
    for i in range(3):
        message = kit.pose(0.1 * i, frame="mocap")
        if i == 1:
            message.pose.orientation.z, message.pose.orientation.w = 0.0, length
        builder.add("/seen", message)
        builder.add("/ft", kit.wrench(0.1 * i))
    with pytest.raises(BagError, match=rf"/seen: t = 0.100000 s: orientation: expected a unit .* length {length:.3g}"):
        builder.build("foreign")


def test_an_orientation_that_means_nothing_can_be_left_out(kit: SimpleNamespace) -> None:
    mapping = mapping_for("PoseStamped", ignore_orientation=True)
    builder = RecordingBuilder(mapping)
    for i in range(3):
        message = kit.pose(0.1 * i, frame="mocap")
        message.pose.orientation.z = message.pose.orientation.w = 0.0
        builder.add("/seen", message)
        builder.add("/ft", kit.wrench(0.1 * i))
    with pytest.raises(BagError, match="theta"):
        builder.build("foreign")


def test_a_mapping_can_say_the_wrench_of_the_contract_otherwise(kit: SimpleNamespace) -> None:
    mapping = Mapping.model_validate(
        {"contract": True, "wrenches": {"left": {"topic": "/wrist_ft/left", "sign": -1, "exerted_on": "object"}}}
    )
    usual, otherwise = build(kit.pushing()), build(kit.pushing(), mapping)
    np.testing.assert_array_equal(otherwise.wrenches["left"].force, -usual.wrenches["left"].force)
    assert otherwise.wrenches["left"].exerted_on == "object"
    np.testing.assert_array_equal(otherwise.object_poses["table"].position, usual.object_poses["table"].position)
