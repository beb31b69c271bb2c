"""Proposals for foreign bags: right roles with reasons, a mapping that reads, and honest gaps."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import Quaternion
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from pbrl_bag import BagError, BagWriter, load_mapping, read_recording
from pbrl_bag.joint_efforts.arm import Arm
from pbrl_bag.proposing import mapping_text, propose
from pbrl_bag.proposing.holding import held
from pbrl_bag.proposing.words import side_of

sys.path.insert(0, str(Path(__file__).resolve().parent))

from foreign_push import CLOSED, CONTACT, LABS, OPENED, Lab, recorded

URDF = Path(__file__).resolve().parents[3] / "urdf" / "krang" / "krang.urdf"
ARM = tuple(f"LJ{k}" for k in range(1, 8))

WANTED = {
    "other topics": ("right", "table_7"),
    "transforms": ("left", "desk"),
    "odometry": ("left", "cart"),
    "other frames": ("left", "crate"),
    "array": ("left", "1"),
    "two clocks": ("left", "bench"),
    "one hand": ("left", "sofa"),
}


def bag_of(folder: Path, messages: list) -> Path:
    with BagWriter(folder, live=False) as writer:
        for topic, kind, message, when in messages:
            writer.write(topic, kind, message, when)
    return folder


@pytest.mark.parametrize("lab", LABS)
def test_roles_are_found_whatever_the_laboratory_calls_them(lab: str, tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", recorded(LABS[lab]))
    proposal = propose(bag)
    side, body = WANTED[lab]
    mapping = proposal.mapping
    assert mapping is not None
    assert set(mapping.wrenches) == {side}, proposal.streams
    assert set(mapping.gripper_poses) == {side}
    assert len(mapping.object_poses) == 1
    name = next(iter(mapping.object_poses))
    assert body in name
    assert all(each.why for each in proposal.streams)
    idle = {each.stream for each in proposal.streams if not each.role} - {"/tracker/bodies (0)"}
    assert idle == {"/chair/pose", "/tf (base_link)"}
    (grasp,) = mapping.grasps
    assert (grasp.gripper, grasp.object) == (side, name)
    np.testing.assert_allclose(grasp.contact, CONTACT, atol=0.005)
    assert grasp.start == pytest.approx(CLOSED, abs=0.2)
    assert grasp.end == pytest.approx(OPENED, abs=0.2)
    path = tmp_path / "mapping.yaml"
    path.write_text(mapping_text(proposal, str(bag), {name: (1.2, 0.8)}))
    assert "outline" not in path.read_text(), "what is told is not to do any more"
    recording = read_recording(bag, path)
    assert [each.object for each in recording.grasps] == [name]
    seen, hand = recording.object_poses[name], recording.gripper_poses[side]
    rows = [np.column_stack([each.time, each.position, each.quaternion]) for each in (seen, hand)]
    together = held(*rows)
    assert together is not None
    np.testing.assert_allclose(together.contact, CONTACT, atol=0.005)


def test_what_no_bag_tells_is_left_to_do_and_not_made_up(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", recorded(LABS["one hand"]))
    proposal = propose(bag)
    assert any("outline of 'sofa'" in each for each in proposal.left)
    text = mapping_text(proposal, "bag", {})
    path = tmp_path / "mapping.yaml"
    path.write_text(text)
    with pytest.raises(BagError, match="body 'sofa' has no geometry"):
        load_mapping(path)
    assert yaml.safe_load(text)["bodies"] is None
    assert "# To do: the outline of 'sofa'" in text


def test_a_pose_out_of_an_array_has_to_be_named(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", recorded(LABS["array"]))
    text = mapping_text(propose(bag), "bag", {"body_1": (1.2, 0.8)})
    assert "index: 1" in text
    path = tmp_path / "mapping.yaml"
    path.write_text(text.replace(", index: 1", ""))
    with pytest.raises(BagError, match="/tracker/bodies: carries many poses: expected index"):
        read_recording(bag, path)
    path.write_text(text.replace("index: 1", "index: 7"))
    with pytest.raises(BagError, match="is never observed"):
        read_recording(bag, path)


def test_a_bag_of_the_contract_needs_no_mapping(push_bag: Path) -> None:
    proposal = propose(push_bag)
    assert proposal.mapping is None
    assert {each.role for each in proposal.streams} == {
        "object_poses.table",
        "gripper_poses.left",
        "wrenches.left",
        "grasps",
        "scene",
    }


def test_without_a_force_or_a_motion_it_is_said(tmp_path: Path) -> None:
    lab = LABS["one hand"]
    silent = bag_of(tmp_path / "silent", [each for each in recorded(lab) if each[0] != lab.wrench])
    assert any("no WrenchStamped" in each for each in propose(silent).left)
    still = bag_of(tmp_path / "still", [each for each in recorded(lab) if each[0] != lab.table])
    assert any("no pose of a thing that moved" in each for each in propose(still).left)
    handless = bag_of(tmp_path / "handless", [each for each in recorded(lab) if each[0] != lab.hand])
    assert any("no pose of the left sensor" in each for each in propose(handless).left)


def by_joints(messages: list, lab: Lab) -> list:
    """Return the push with the efforts of an arm and its description in place of the wrench."""
    angles = np.array([1.9, 0.2, 0.4, -0.7, 0.3, 1.2, -0.4, 0.9, 0.2])[None]
    arm = Arm(URDF.read_text(), ARM, "left_ft", (0.0, 0.0, -9.81), "test")
    gravity, jacobian = arm.torques(angles)[0], arm.jacobians(angles)[0]
    out = [("/robot_description", "std_msgs/msg/String", String(data=URDF.read_text()), 0)]
    for topic, kind, message, when in messages:
        if topic != lab.wrench:
            out.append((topic, kind, message, when))
            continue
        force, torque = message.wrench.force, message.wrench.torque
        felt = np.array([force.x, force.y, force.z, torque.x, torque.y, torque.z])
        state = JointState(header=message.header, name=["wheel", *arm.chain], position=[0.0, *angles[0]])
        state.effort = [0.0, 0.0, 0.0, *(gravity - jacobian.T @ felt + 0.01)]
        out.append(("/joint_states", "sensor_msgs/msg/JointState", state, when))
    return sorted(out, key=lambda message: message[3])


def test_for_want_of_a_wrench_the_joints_of_the_arm_are_proposed(tmp_path: Path) -> None:
    lab = LABS["transforms"]
    bag = bag_of(tmp_path / "bag", by_joints(recorded(lab), lab))
    proposal = propose(bag)
    assert proposal.mapping is not None
    source = proposal.mapping.joint_efforts["left"]
    assert (source.topic, source.joints, source.tip) == ("/joint_states", ARM, "left_ft")
    assert source.description == "/robot_description"
    (why,) = [each.why for each in proposal.streams if each.role == "joint_efforts.left"]
    assert why == "there is no wrench; 7 joints with efforts carry 'left_ft' in /robot_description"
    assert any("`tip` is taken to be 'left_ft'" in each for each in proposal.left)
    assert not any("no WrenchStamped" in each for each in proposal.left)
    (grasp,) = proposal.mapping.grasps
    assert grasp.start == pytest.approx(CLOSED, abs=0.2), "felt by the joints"
    path = tmp_path / "mapping.yaml"
    path.write_text(mapping_text(proposal, str(bag), {"desk": (1.2, 0.8)}))
    assert "\nwrenches:" not in path.read_text()
    with pytest.raises(BagError, match="with an empty hand"):
        read_recording(bag, path)
    path.write_text(path.read_text().replace("tip: left_ft,", "tip: left_ft, noise: 0.1,"))
    found = read_recording(bag, path).wrenches["left"]
    held = (found.time > CLOSED + 0.1) & (found.time < OPENED - 0.1)
    np.testing.assert_allclose(found.force[held, 0], 15.0 + np.sin(found.time[held]), atol=0.05)


def test_efforts_give_way_to_a_wrench_and_lack_a_description(tmp_path: Path) -> None:
    lab = LABS["transforms"]
    joints = by_joints(recorded(lab), lab)
    both = propose(bag_of(tmp_path / "both", [*joints, *(each for each in recorded(lab) if each[0] == lab.wrench)]))
    assert both.mapping is not None
    assert not both.mapping.joint_efforts
    assert [each.why for each in both.streams if each.stream == "/joint_states"] == [
        "joint efforts, but there is a wrench, which is the better one"
    ]
    alone = propose(bag_of(tmp_path / "alone", [each for each in joints if each[0] != "/robot_description"]))
    assert alone.mapping is not None
    assert str(alone.mapping.joint_efforts["left"].urdf) == "robot.urdf"
    assert any("give the robot's `urdf`, the joints of the arm alone" in each for each in alone.left)
    assert len(alone.mapping.grasps) == 1


def test_frames_that_nothing_links_are_said(tmp_path: Path) -> None:
    messages = [each for each in recorded(LABS["other frames"]) if each[0] != "/tf_static"]
    left = propose(bag_of(tmp_path / "bag", messages)).left
    assert any("where 'robot' is in 'ceiling' is not in the bag" in each for each in left)


@pytest.mark.parametrize("lab", ["other topics", "other frames"])
def test_a_tracker_that_lost_the_thing_does_not_hide_who_held_it(lab: str, tmp_path: Path) -> None:
    """It sends an orientation of no length then: of that nothing can be turned into another frame."""
    messages = recorded(LABS[lab])
    for topic, _, message, when in messages:
        if topic in (LABS[lab].table, LABS[lab].hand) and 3.0 < when * 1e-9 < 3.3:
            message.pose.orientation.z = message.pose.orientation.w = 0.0
    mapping = propose(bag_of(tmp_path / "bag", messages)).mapping
    assert mapping is not None and len(mapping.grasps) == 1
    np.testing.assert_allclose(mapping.grasps[0].contact, CONTACT, atol=0.005)


def test_a_fixed_frame_without_an_orientation_links_nothing(tmp_path: Path) -> None:
    messages = recorded(LABS["other frames"])
    for topic, _, message, _ in messages:
        if topic == "/tf_static":
            for transform in message.transforms:
                transform.transform.rotation = Quaternion(x=0.0, y=0.0, z=0.0, w=0.0)
    left = propose(bag_of(tmp_path / "bag", messages)).left
    assert any("where 'robot' is in 'ceiling' is not in the bag" in each for each in left)


def test_a_csv_file_is_refused_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="mapped by hand"):
        propose(tmp_path / "door.csv")


@pytest.mark.parametrize(
    ("name", "side"),
    [
        ("/left/ft", "left"),
        ("l_gripper", "left"),
        ("/arm_right", "right"),
        ("/r/wrench", "right"),
        ("/table", ""),
        ("lr", ""),
    ],
)
def test_sides_are_words_of_their_own(name: str, side: str) -> None:
    assert side_of(name) == side


def test_a_hand_that_stays_behind_holds_nothing() -> None:
    time = np.arange(0.0, 5.0, 0.05)
    table = np.column_stack([time, 0.1 * time, *np.zeros((5, len(time))), np.ones(len(time))])
    hand = table.copy()
    hand[:, 1] = -0.5
    assert held(table, hand) is None
    hand[:, 1] = table[:, 1] - 0.5
    together = held(table, hand)
    assert together is not None
    assert together.share == 1.0
    assert math.isclose(together.contact[0], -0.5, abs_tol=1e-9)
