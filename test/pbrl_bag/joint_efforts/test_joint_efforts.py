"""A wrench out of joint efforts: what went in comes back, as far off as it says, and what is not told is said."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
import yaml
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from pbrl_bag import BagError, Mapping, Recording, RecordingBuilder, load_mapping, read_recording
from pbrl_bag.joint_efforts import arm as arm_module
from pbrl_bag.joint_efforts.arm import Arm
from pbrl_bag.joint_efforts.solving import PLAUSIBLE, tip_wrenches, untold

URDF = Path(__file__).resolve().parents[3] / "urdf" / "krang" / "krang.urdf"
BALL_ARM = URDF.parents[1] / "ball_arm" / "ball_arm.urdf"
JOINTS = tuple(f"LJ{k}" for k in range(1, 8))
BENT = np.array([0.4, -0.7, 0.3, 1.2, -0.4, 0.9, 0.2])
CARRIED = {"waist": 1.9, "torso": 0.2}
RATE, SECONDS, CLOSED, OPENED = 50, 12.0, 5.0, 11.0
DOWN = (0.0, 0.0, -9.81)


def angles_at(time: np.ndarray) -> np.ndarray:
    """Return (n, 7) an arm that stands, reaches and pushes slowly."""
    return BENT + 0.25 * np.sin(np.outer(time, 0.1 * np.arange(1, 8)))


def wrench_at(time: np.ndarray) -> np.ndarray:
    """Return (n, 6) what the world exerts on the tip while it pushes."""
    held = (time >= CLOSED) & (time <= OPENED)
    wave = np.array([20.0, -35.0, 8.0, 1.5, -2.0, 3.0]) * (
        1.0 + 0.5 * np.sin(np.outer(time, [0.7, 0.9, 1.1, 1.3, 0.6, 1.0]))
    )
    return held[:, None] * wave


def efforts(angles: np.ndarray, wrenches: np.ndarray) -> np.ndarray:
    """Return (n, 7) what the motors have to do, by the textbook and by no code of ours."""
    model = pin.buildModelFromXML(URDF.read_text())
    data, q = model.createData(), pin.neutral(model)
    for name, value in CARRIED.items():
        q[model.joints[model.getJointId(name)].idx_q] = value
    places = [model.joints[model.getJointId(name)] for name in JOINTS]
    rows = []
    for angle, wrench in zip(angles, wrenches, strict=True):
        q[[each.idx_q for each in places]] = angle
        jacobian = pin.computeFrameJacobian(model, data, q, model.getFrameId("left_ft"), pin.ReferenceFrame.LOCAL)
        needed = pin.computeGeneralizedGravity(model, data, q) - jacobian.T @ wrench
        rows.append(needed[[each.idx_v for each in places]])
    return np.array(rows)


def states(kit: SimpleNamespace, time: np.ndarray, effort: np.ndarray) -> list[JointState]:
    """Return what a driver publishes: other joints and another order than the arm's."""
    names = ["left_wheel", *reversed(JOINTS), *CARRIED]
    out = []
    for t, row, angle in zip(time, effort, angles_at(time), strict=True):
        message = JointState(name=names, position=[9.0 * t, *angle[::-1], *CARRIED.values()])
        message.header.stamp = kit.stamp(t)
        message.effort = [0.0, *row[::-1], 50.0, 50.0]
        out.append(message)
    return out


def mapping(**changes: object) -> Mapping:
    source = {"topic": "/joint_states", "joints": JOINTS, "tip": "left_ft", "urdf": str(URDF)} | changes
    return Mapping.model_validate({"contract": True, "joint_efforts": {"left": source}})


def recording(kit: SimpleNamespace, rules: Mapping, joint_states: list[JointState], text: str = "") -> Recording:
    builder = RecordingBuilder(rules)
    builder.add("/scene", kit.scene())
    for t, sides in ((0.0, ()), (CLOSED, ("left",)), (OPENED, ())):
        builder.add("/grasps", kit.grasps(t, *sides))
    for t in np.arange(0.0, SECONDS, 0.1):
        builder.add("/ar_tags/table/pose", kit.pose(t, 0.01 * t))
        builder.add("/ar_tags/left_gripper/pose", kit.pose(t, 0.01 * t))
    if text:
        builder.add("/robot_description", String(data=text))
    for message in joint_states:
        builder.add("/joint_states", message)
    return builder.build("push")


TIME = np.arange(round(SECONDS * RATE)) / RATE


def test_a_known_wrench_comes_back_out_of_the_efforts_it_makes(kit: SimpleNamespace) -> None:
    wanted = wrench_at(TIME)
    found = recording(kit, mapping(), states(kit, TIME, efforts(angles_at(TIME), wanted))).wrenches["left"]
    assert (found.exerted_on, found.frame) == ("gripper", "sensor")
    np.testing.assert_allclose(found.time, TIME, atol=1e-9)
    np.testing.assert_allclose(found.force, wanted[:, :3], atol=0.05)  # pulled towards zero by a thousandth
    np.testing.assert_allclose(found.torque, wanted[:, 3:], atol=0.02)


@pytest.mark.parametrize("told", [None, 0.4])
def test_noise_is_as_large_as_it_is_said_to_be(told: float | None, kit: SimpleNamespace) -> None:
    rng = np.random.default_rng(3)
    steps = np.repeat(rng.normal(0.0, 0.4, (round(2 * SECONDS), len(JOINTS))), RATE // 2, axis=0)
    effort = efforts(angles_at(TIME), wrench_at(TIME)) + steps  # friction, which stays for half a second
    seen = recording(kit, mapping(noise=told) if told else mapping(), states(kit, TIME, effort))
    found, held = seen.wrenches["left"], (TIME > CLOSED) & (TIME < OPENED)
    assert found.covariance is not None
    off = np.column_stack([found.force, found.torque])[held] - wrench_at(TIME)[held]
    ratio = off.std(axis=0) / np.sqrt(0.5 * np.diag(found.covariance))  # half: of one reading
    assert np.all((ratio > 0.5) & (ratio < 1.7)), ratio
    (said,) = [note for note in seen.notes if "poorer" in note]
    assert ("as told" in said) == (told is not None)
    with pytest.raises(ValueError, match="read-only"):
        found.covariance[0, 0] = 0.0


def test_the_bag_may_bring_the_description_and_a_driver_may_have_taken_gravity_out(kit: SimpleNamespace) -> None:
    wanted = wrench_at(TIME)
    arm = Arm(URDF.read_text(), JOINTS, "left_ft", DOWN, "test")
    carried = np.tile(list(CARRIED.values()), (len(TIME), 1))
    jacobians = arm.jacobians(np.column_stack([carried, angles_at(TIME)]))
    external = np.einsum("nik,ni->nk", jacobians, wanted)
    rules = mapping(urdf=None, description="/robot_description", efforts="external")
    found = recording(kit, rules, states(kit, TIME, external), URDF.read_text()).wrenches["left"]
    np.testing.assert_allclose(found.force, wanted[:, :3], atol=0.05)
    with pytest.raises(BagError, match="expected topic '/robot_description', got no message of it"):
        recording(kit, rules, states(kit, TIME, external))


def test_motion_of_its_own_is_taken_out_where_that_is_asked_for(kit: SimpleNamespace) -> None:
    arm = Arm(URDF.read_text(), JOINTS, "left_ft", DOWN, "test")
    time, rate = TIME, 3.0
    swing = 0.05 * np.sin(rate * time)[:, None] * np.ones(7)
    still = np.zeros((len(time), 2))
    angles = np.column_stack([np.tile(list(CARRIED.values()), (len(time), 1)), BENT + swing])
    speeds = np.column_stack([still, 0.05 * rate * np.cos(rate * time)[:, None] * np.ones(7)])
    needed = arm.torques(angles, speeds, np.column_stack([still, -(rate**2) * swing]))
    messages = states(kit, time, needed)
    for message, row in zip(messages, angles, strict=True):
        message.position = [0.0, *row[2:][::-1], *row[:2]]
    off = [
        np.abs(recording(kit, mapping(inertia=inertia), messages).wrenches["left"].force[20:-20]).max()
        for inertia in (False, True)
    ]
    assert off[0] > 1.0
    assert off[1] < 0.1 * off[0]


def test_a_torso_that_is_measured_carries_the_other_arm_too(kit: SimpleNamespace) -> None:
    names = ("waist", "torso", *JOINTS, *(f"RJ{k}" for k in range(1, 8)))
    model = pin.buildModelFromXML(URDF.read_text())
    data, q = model.createData(), pin.neutral(model)
    swinging = np.column_stack([np.tile([*CARRIED.values(), *BENT], (len(TIME), 1)), angles_at(0.5 * TIME)])
    effort, wanted = [], wrench_at(TIME)
    for angles, wrench in zip(swinging, wanted, strict=True):
        q[[model.joints[model.getJointId(name)].idx_q for name in names]] = angles
        jacobian = pin.computeFrameJacobian(model, data, q, model.getFrameId("left_ft"), pin.ReferenceFrame.LOCAL)
        needed = pin.computeGeneralizedGravity(model, data, q) - jacobian.T @ wrench
        effort.append(needed[[model.joints[model.getJointId(name)].idx_v for name in names]])
    messages = []
    for t, angles, row in zip(TIME, swinging, effort, strict=True):
        messages.append(JointState(name=names, position=angles.tolist(), effort=row.tolist()))
        messages[-1].header.stamp = kit.stamp(t)
    found = recording(kit, mapping(joints=("waist", "torso", *JOINTS)), messages).wrenches["left"]
    np.testing.assert_allclose(found.force, wanted[:, :3], atol=0.1)


def test_a_stretched_arm_says_along_what_it_feels_nothing() -> None:
    arm = Arm(URDF.read_text(), JOINTS, "left_ft", DOWN, "test")
    straight = np.zeros((1, len(arm.chain)))
    noise = np.full(len(JOINTS), 0.5)
    jacobian = arm.jacobians(straight)
    values, vectors = np.linalg.eigh(jacobian[0] @ jacobian[0].T)
    assert values[0] < 1e-9, "an arm that is stretched is singular"
    felt = 10.0 * vectors[:, 0]
    wrench, covariance = tip_wrenches(jacobian, np.einsum("nik,i->nk", jacobian, felt), noise)
    assert np.linalg.norm(wrench) < 1e-6 * np.linalg.norm(felt), "what no joint feels is not made up"
    deviation = float(np.sqrt(vectors[:, 0] @ covariance[0] @ vectors[:, 0]))
    assert deviation > 0.5 * PLAUSIBLE.min()
    told = untold(covariance)
    assert told and told[0][0] == 1.0
    bent = arm.jacobians(np.concatenate([list(CARRIED.values()), BENT])[None])
    assert untold(tip_wrenches(bent, np.zeros((1, 7)), noise)[1]) == []


def test_what_the_joints_do_not_tell_while_something_is_held_is_a_note(kit: SimpleNamespace) -> None:
    messages = states(kit, TIME, np.zeros((len(TIME), 7)))
    for each in messages:
        each.position = [0.0] * 10
    notes = recording(kit, mapping(noise=0.5), messages).notes
    assert any("for 100 % of the time in which it matters the joints tell nothing of a force along" in n for n in notes)


def test_four_joints_cannot_tell_a_torque_but_a_force_at_a_point() -> None:
    joints = ("arm_yaw", "arm_shoulder", "arm_elbow", "arm_wrist")
    arm = Arm(BALL_ARM.read_text(), joints, "ball", DOWN, "test")
    jacobian = arm.jacobians(np.array([[0.3, 0.6, -1.2, 0.6]]))
    force = np.array([1.0, -2.0, 0.5])
    torque = np.einsum("nik,i->nk", jacobian[:, :3], force)
    noise = np.full(4, 0.01)
    assert len(untold(tip_wrenches(jacobian, torque, noise)[1])) >= 2
    wrench, covariance = tip_wrenches(jacobian, torque, noise, point=True)
    np.testing.assert_allclose(wrench[0, :3], force, atol=1e-3)
    assert np.isnan(wrench[0, 3:]).all()
    assert untold(covariance) == []


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"tip": "left_hand"}, "tip: expected a link of it, got 'left_hand'; did you mean"),
        ({"joints": ("LJ1", "left_wheel")}, "expected joints that carry 'left_ft', got 'left_wheel'; known: LJ1"),
        ({"urdf": "/nowhere.urdf"}, "/nowhere.urdf: expected the URDF that a mapping names"),
        ({"joints": ("LJ1", "LJ9")}, "expected joint 'LJ9' beside the arm's others, got none; did you mean"),
        ({"joints": ("A", "B")}, "expected joints A, B, got none of them; it has LJ1, LJ2"),
    ],
)
def test_what_does_not_go_together_is_named(changes: dict, message: str, kit: SimpleNamespace) -> None:
    with pytest.raises(BagError, match=message):
        recording(kit, mapping(**changes), states(kit, TIME[:5], np.zeros((5, 7))))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"effort": []}, "effort: expected 10 numbers, one for each joint, got 0"),
        ({"effort": [float("nan")] * 10}, "effort of LJ1: expected a finite number, got nan"),
        ({"name": [f"{k}" for k in range(10)]}, "expected joints LJ1, LJ2, .* got none of them"),
        ({"position": []}, "expected the position of joint 'waist', which carries the hand, got none"),
    ],
)
def test_a_driver_that_does_not_tell_is_named(wrong: dict, message: str, kit: SimpleNamespace) -> None:
    messages = states(kit, TIME, np.zeros((len(TIME), 7)))
    for each in messages:
        for field, value in wrong.items():
            setattr(each, field, value)
    with pytest.raises(BagError, match=message):
        recording(kit, mapping(), messages)
    with pytest.raises(BagError, match="expected sensor_msgs/JointState, got String"):
        recording(kit, mapping(), [String(data="no joints")])


def test_without_an_empty_hand_the_noise_has_to_be_told(kit: SimpleNamespace) -> None:
    late = TIME[(TIME > CLOSED - 1.0) & (TIME < OPENED)]
    messages = states(kit, late, efforts(angles_at(late), wrench_at(late)))
    with pytest.raises(BagError, match=r"expected 3 s with an empty hand, .* got 1 s; record longer, or say `noise`"):
        recording(kit, mapping(), messages)
    assert recording(kit, mapping(noise=[0.1] * 7), messages).wrenches["left"].covariance is not None


def test_without_pinocchio_it_is_said_what_to_install(kit: SimpleNamespace, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ImportError(f"No module named {name!r}")

    arm_module._pinocchio.cache_clear()
    monkeypatch.setattr(arm_module.importlib, "import_module", missing)
    with pytest.raises(BagError, match=r"expected Pinocchio, .* `pip install pin`"):
        recording(kit, mapping(), states(kit, TIME[:5], np.zeros((5, 7))))


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ({"urdf": "a.urdf", "description": "/robot_description"}, "expected either `urdf`"),
        ({}, "expected either `urdf`"),
        ({"urdf": "a.urdf", "joints": ["LJ1", "LJ1"]}, "joints: expected each once"),
        ({"urdf": "a.urdf", "noise": [0.1, 0.2, 0.3]}, "noise: expected one number, or 2 as joints, got 3"),
        ({"urdf": "a.urdf", "tipp": "x"}, "unknown key 'joint_efforts.left.tipp': did you mean 'tip'"),
    ],
)
def test_a_mapping_that_contradicts_itself_is_refused(source: dict, message: str, tmp_path: Path) -> None:
    path = tmp_path / "mapping.yaml"
    base = {"topic": "/joint_states", "joints": ["LJ1", "LJ2"], "tip": "left_ft"}
    path.write_text(yaml.safe_dump({"joint_efforts": {"left": base | source}}))
    with pytest.raises(BagError, match=message):
        load_mapping(path)


def test_a_sensor_goes_before_efforts_and_the_file_lies_beside_the_mapping(tmp_path: Path) -> None:
    path = tmp_path / "mapping.yaml"
    efforts_of = {"topic": "/joint_states", "joints": ["LJ1"], "tip": "left_ft", "urdf": "robot.urdf"}
    path.write_text(yaml.safe_dump({"joint_efforts": {"left": efforts_of}}))
    assert load_mapping(path).joint_efforts["left"].urdf == tmp_path / "robot.urdf"
    table = tmp_path / "push.csv"
    table.write_text("t,x\n0,1\n1,2\n")
    path.write_text(yaml.safe_dump({"time": {"column": "t"}, "joint_efforts": {"left": efforts_of}}))
    with pytest.raises(BagError, match="joint_efforts: expected a bag, got a CSV file"):
        read_recording(table, path)
    both = {"left": {"topic": "/ft", "exerted_on": "gripper"}}
    path.write_text(yaml.safe_dump({"joint_efforts": {"left": efforts_of}, "wrenches": both}))
    with pytest.raises(BagError, match="left: expected `wrenches` or `joint_efforts`, got both"):
        load_mapping(path)
