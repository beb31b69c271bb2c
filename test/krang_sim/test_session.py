"""A whole run in process: commands, watchdog, grasps, rates, determinism, and what must stay concealed."""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from bullet_sim.errors import SimError
from bullet_sim.scene import Scene
from krang_sim.errors import KrangError
from krang_sim.messages import to_messages
from krang_sim.observations import GraspState, JointStates, Observation, Odometry, Transforms
from krang_sim.robot import JOINTS
from krang_sim.session import KrangSession


def run(session: KrangSession, seconds: float, command: Callable[[], None] | None = None) -> list[Observation]:
    seen: list[Observation] = []
    for _ in range(round(seconds * 400)):
        if command:
            command()
        seen += session.step()
    return seen


def to_bytes(observations: list[Observation]) -> list[tuple[str, bytes]]:
    return [
        (topic, serialize_message(message))
        for observation in observations
        for topic, message in to_messages(observation)
    ]


def to_text(observations: list[Observation]) -> list[tuple[str, str]]:
    """Every digit of every message, after the wire; raw bytes have padding that the middleware leaves unset."""
    return [
        (topic, repr(deserialize_message(serialize_message(message), type(message))))
        for observation in observations
        for topic, message in to_messages(observation)
    ]


def last(observations: list[Observation], kind: type) -> Observation:
    return [observation for observation in observations if isinstance(observation, kind)][-1]


@pytest.mark.parametrize("pose", [[0.1, 0.0, 0.0], [0.7, 0.0, 0.0]], ids=["on its wheels", "on its arms"])
def test_a_body_in_the_robot_s_place_is_refused(make_scene, make_session, pose):
    desk = make_scene().bodies["desk"].model_dump() | {"pose": pose}
    with pytest.raises(SimError, match=r"bodies\.desk: expected a place clear of the robot"):
        make_session(make_scene(bodies={"desk": desk}))


def test_topics_come_at_their_rates(make_scene, make_session):
    session = make_session(make_scene(sensors={"tags": {"dropout": 0.0}}))
    count = Counter(topic for topic, _ in to_bytes(run(session, 2.0)))
    expected = {
        "/clock": 200,
        "/joint_states": 200,
        "/odom": 100,
        "/tf": 100,
        "/wrist_ft/left": 200,
        "/wrist_ft/right": 200,
        "/ar_tags/desk/pose": 29,
        "/ar_tags/left_gripper/pose": 29,
        "/ar_tags/right_gripper/pose": 29,
        "/markers": 10,
    }
    for topic, number in expected.items():
        assert abs(count.pop(topic) - number) <= 1, topic
    assert count == {"/tf_static": 1, "/robot_description": 1, "/scene": 1, "/grasps": 1}


@pytest.mark.parametrize("step", [1 / 240, 1 / 1000])
def test_rates_and_motion_do_not_depend_on_the_step(make_scene, step):
    with KrangSession(make_scene(bodies={}), seed=1, step=step) as session:
        seen: list[Observation] = []
        while session.time < 1.0:
            session.command_base(0.1, 0.0)
            seen += session.step()
        assert abs(len([one for one in seen if isinstance(one, JointStates)]) - 100) <= 1
        assert session.robot.base_pose().position[0] == pytest.approx(0.09, abs=0.005)


def test_base_stops_when_nobody_repeats_the_command(make_scene, make_session):
    session = make_session(make_scene(bodies={}))
    run(session, 1.0, lambda: session.command_base(0.1, 0.0))
    assert last(run(session, 0.08), Odometry).twist[0] == pytest.approx(0.1, rel=0.05)
    run(session, 0.5)
    assert abs(last(run(session, 0.1), Odometry).twist[0]) < 1e-3
    assert session.robot.base_pose().position[0] == pytest.approx(0.12, abs=0.02)


@pytest.mark.parametrize("base", [(9.0, 0.0), (-9.0, 0.0), (0.0, -9.0), (9.0, 9.0), (-9.0, 9.0)])
@pytest.mark.parametrize("says", ["nothing", "zeros"])
def test_the_robot_is_at_rest_within_the_third_part_of_a_second_whatever_was_asked_of_it(
    make_scene, make_session, base, says
):
    session = make_session(make_scene(bodies={}))

    def drive():
        session.command_base(*base)
        session.command_arm("left", [0.3, 0.0, 0.0, 0.3, 0.0, 0.0, -0.3])

    run(session, 1.5, drive)
    speed, turning = session.robot.base_twist()
    assert speed < 0.36 and turning < 0.53, "no more than it may"
    assert speed > 0.16 or turning > 0.45
    if says == "zeros":
        session.command_base(0.0, 0.0)
        session.command_arm("left", [0.0] * 7)
    run(session, 0.29 if says == "nothing" else 0.2)
    speeds = []
    while len(speeds) < 40:
        session.step()
        speeds.append((*session.robot.base_twist(), np.abs(session.robot.joint_state()[1][2:]).max()))
    assert (np.max(speeds, axis=0) < (0.01, 0.02, 0.03)).all()


def test_arms_and_body_stop_too(make_scene, make_session):
    session = make_session(make_scene(bodies={}))
    session.command_arm("left", [0.1] * 7)
    session.command_arm("right", [-0.1] * 7)
    session.command_body(-0.1, 0.1)
    moving = last(run(session, 0.09), JointStates)
    np.testing.assert_allclose(np.abs(moving.velocity[2:]), 0.1, rtol=0.05)
    still = last(run(session, 0.5), JointStates)
    np.testing.assert_allclose(still.velocity[2:], 0.0, atol=2e-3)


@pytest.mark.parametrize("bad", [[0.0] * 6, [0.0] * 8, [math.nan] + [0.0] * 6, [math.inf] * 7])
def test_a_bad_arm_command_is_refused_and_changes_nothing(make_scene, make_session, bad):
    session = make_session(make_scene(bodies={}))
    with pytest.raises(KrangError, match="left command: expected") as caught:
        session.command_arm("left", bad)
    assert "\n" not in str(caught.value)
    assert np.abs(last(run(session, 0.1), JointStates).velocity[2:]).max() < 0.02


def test_a_command_for_an_arm_that_is_not_there_is_refused(make_scene, make_session):
    with pytest.raises(KrangError, match="expected 'left' or 'right'"):
        make_session(make_scene(bodies={})).command_arm("middle", [0.0] * 7)


def test_joint_states_name_all_eighteen(make_scene, make_session):
    observation = last(run(make_session(make_scene()), 0.05), JointStates)
    assert observation.names == JOINTS
    assert len(set(observation.names)) == len(observation.position) == len(observation.velocity) == 18


def test_grasp_out_of_reach_tells_the_distance(make_scene, make_session):
    session = make_session(make_scene())
    outcome = session.grasp("left")
    assert not outcome.success
    assert outcome.distance == pytest.approx(0.195, abs=0.01)
    assert f"{outcome.distance:.3f} m" in outcome.message


@pytest.mark.parametrize(
    ("side", "name", "words"),
    [
        ("lefft", "", "expected 'left' or 'right'"),
        ("left", "dekk", "did you mean 'desk'"),
        ("", "", "known: left, right"),
    ],
)
def test_a_grasp_that_makes_no_sense_is_refused_in_a_sentence(make_scene, make_session, side, name, words):
    outcome = make_session(make_scene()).grasp(side, name)
    assert not outcome.success
    assert words in outcome.message


def test_grasp_push_release(near_scene, make_session):
    session = make_session(near_scene)
    run(session, 0.1)
    before = session.truth("desk")
    assert session.grasp("left", "desk").success
    assert session.grasp("right").success
    assert "already holds desk" in session.grasp("left").message
    seen = run(session, 2.0, lambda: session.command_base(0.1, 0.0))
    holds = last(seen, GraspState).holds
    assert [(hold.gripper, hold.object) for hold in holds] == [("left", "desk"), ("right", "desk")]
    assert all(hold.contact_point[0] == pytest.approx(-0.34, abs=0.03) for hold in holds)
    pushed = session.truth("desk").position[0] - before.position[0]
    assert pushed == pytest.approx(0.19, abs=0.03)
    assert session.release("left").success
    assert session.release("right").success
    assert not session.release("right").success
    assert last(run(session, 0.1), GraspState).holds == ()


def test_pushing_forward_presses_back_on_the_wrists(near_scene, make_session):
    """33 kg on casters want some newtons; the object wrench is the negative of what the sensors show."""
    session = make_session(near_scene)
    run(session, 0.5)
    session.grasp("left")
    session.grasp("right")
    rest = [session.robot.wrist_wrench(side)[0] for side in ("left", "right")]
    felt = []
    for _ in range(800):
        session.command_base(0.1, 0.0)
        session.step()
        if session.time > 1.5:
            for side, still in zip(("left", "right"), rest, strict=True):
                _, quaternion = session.robot.link_poses([f"{side}_ft"])
                force = session.robot.wrist_wrench(side)[0] - still
                felt.append(
                    np.array(session._client.api.multiplyTransforms([0] * 3, quaternion[0], force, [0, 0, 0, 1])[0])
                )
    forward = 2 * np.mean(felt, axis=0)[0]
    assert -25 < forward < -2


def test_a_lost_grip_is_told(near_scene, make_session):
    session = make_session(near_scene)
    run(session, 0.1)
    session.grasp("left")
    run(session, 0.1)
    session._grippers._grips["left"].lost = True
    assert last(run(session, 0.1), GraspState).holds == ()
    assert "holds nothing" in session.release("left").message


def test_frames_meet_the_test_vector_and_the_truth(make_scene, make_session):
    session = make_session(make_scene(robot={"pose": [0.5, -0.4, 2.1]}, bodies={}))
    seen = run(session, 0.5, lambda: session.command_base(0.1, 0.2))
    moving, fixed = last(seen, Transforms), next(one for one in seen if isinstance(one, Transforms) and one.static)
    at = dict(zip(moving.children, moving.positions, strict=True))
    np.testing.assert_allclose(at["left_ft"], [0.4488, 0.1251, 0.7648], atol=1e-3)
    np.testing.assert_allclose(at["right_ft"], [0.4488, -0.1231, 0.7648], atol=1e-3)
    np.testing.assert_allclose(at["torso_link"], [-0.0360, 0.0010, 0.7273], atol=1e-3)
    parents = dict(zip(fixed.children + moving.children, fixed.parents + moving.parents, strict=True))
    assert parents["odom"] == "world"
    assert parents["base"] == "odom"
    assert set(session.robot.links) - {"base"} == set(parents) - {"odom", "base"}
    np.testing.assert_allclose(fixed.positions[fixed.children.index("odom")], [0.5, -0.4, 0.0])
    assert (np.abs(np.linalg.norm(moving.quaternions, axis=1) - 1) < 1e-6).all()


def test_same_seed_same_messages(near_scene, make_session):
    def record(seed: int) -> list[tuple[str, str]]:
        session = make_session(near_scene, seed)
        session.grasp("left")
        return to_text(run(session, 0.6, lambda: session.command_base(0.1, 0.1)))

    first = record(7)
    assert first == record(7)
    assert first != record(8)


CONCEALED = {
    "locked_casters": {"desk": ["front_right"]},
    "fixed_wheels": {"desk": ["front_left"]},
    "mass": {"desk": 47.8125},
    "rolling_resistance": {"desk": 0.00414},
}


def test_concealed_part_is_in_no_message(make_scene, make_session):
    session = make_session(make_scene(concealed=CONCEALED))
    everything = b"\n".join(data for _, data in to_bytes(run(session, 1.0, lambda: session.command_base(0.05, 0.0))))
    assert struct.pack("<d", 33.0) in everything  # the nominal mass is: the search works
    assert b"desk" in everything
    for number in (47.8125, 0.00414):
        assert struct.pack("<d", number) not in everything
        assert struct.pack("<f", number) not in everything
    for word in (b"concealed", b"locked", b"front_right", b"front_left", b"rolling", b"fixed_wheels"):
        assert word not in everything


def test_at_time_zero_the_concealed_part_changes_no_message(make_scene, make_session):
    def start(scene: Scene) -> list[tuple[str, str]]:
        return to_text(make_session(scene).step())

    open_scene, secretive = start(make_scene()), start(make_scene(concealed=CONCEALED))
    stamped_zero = {"/robot_description", "/scene", "/tf_static", "/grasps"}
    assert {topic for topic, _ in open_scene} >= stamped_zero
    at_zero = [[pair for pair in pairs if pair[0] in stamped_zero] for pairs in (open_scene, secretive)]
    assert at_zero[0] == at_zero[1]


def test_sensor_noise_does_not_depend_on_what_is_concealed(make_scene, make_session):
    """A different number of draws for the world must not show in the sensors."""
    biases = []
    for scene in (make_scene(), make_scene(concealed=CONCEALED), make_scene(bodies={})):
        session = make_session(scene, 3)
        biases.append(session._sensing._wrists["left"].bias)
    np.testing.assert_array_equal(biases[0], biases[1])
    np.testing.assert_array_equal(biases[0], biases[2])


def test_truth_of_an_unknown_body_is_one_line(make_scene, make_session):
    with pytest.raises(SimError, match="did you mean 'desk'"):
        make_session(make_scene()).truth("disk")


def test_an_unknown_posture_leaves_no_client_behind(make_scene, make_session):
    with pytest.raises(KrangError, match="did you mean 'square_table_push'"):
        make_session(make_scene(robot={"posture": "square_tabel_push"}))


def test_a_posture_written_out_in_the_scene_is_taken(make_scene, make_session):
    posture = {"waist": 2.0, "torso": 0.1, "left": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]}
    session = make_session(make_scene(bodies={}, robot={"posture": posture}))
    angles, _ = session.robot.joint_state()
    np.testing.assert_allclose(angles[2:4], [2.0, 0.1])
    np.testing.assert_allclose(angles[4:11], posture["left"])
    np.testing.assert_allclose(angles[11:], np.negative(posture["left"]))
