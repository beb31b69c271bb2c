"""A whole run in process: commands, watchdog, grasps, cart, rates, determinism, what stays concealed."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from bullet_sim.bristle import wrap
from bullet_sim.client import Pose
from bullet_sim.errors import SimError
from bullet_sim.observations import GraspState, JointStates, KnownScene, Transforms
from pr2_cart_sim.description import BODY_JOINTS
from pr2_cart_sim.errors import Pr2Error
from pr2_cart_sim.messages import MESSAGE_TYPES, to_messages
from pr2_cart_sim.observations import BaseOdometry, CartReading, Localisation
from pr2_cart_sim.sensing import in_base
from pr2_cart_sim.session import STEP, Pr2Session

SPEED = 0.3


def last(observations, kind, **fields):
    wanted = [one for one in observations if isinstance(one, kind)]
    return [one for one in wanted if all(getattr(one, key) == value for key, value in fields.items())][-1]


def to_text(observations):
    """Every digit of every message, after the wire."""
    return [
        (topic, repr(deserialize_message(serialize_message(message), type(message))))
        for observation in observations
        for topic, message in to_messages(observation)
    ]


@pytest.fixture(scope="module")
def pushed(make_scene, run):
    """A session after two seconds of pushing the cart, and what it gave; to be looked at, not to be stepped."""
    with Pr2Session(make_scene(), seed=1) as session:
        yield session, run(session, 2.0, lambda: session.command_base(SPEED, 0.0, 0.0))


def test_cart_goes_where_the_robot_pushes_it(pushed):
    session, seen = pushed
    pose, _ = session.robot_truth()
    way = SPEED * (2.0 - SPEED / 2 / 2)
    assert pose[0] == pytest.approx(way, abs=5e-3)
    np.testing.assert_allclose(session.truth("cart").planar, [1.134 + way, 0.0, 0.0], atol=0.01)
    assert [hold.gripper for hold in last(seen, GraspState).holds] == ["left", "right"]
    assert session.contacts == []


def test_topics_come_at_their_rates_and_all_are_known(pushed):
    _, seen = pushed
    count = Counter(topic for one in seen for topic, _ in to_messages(one))
    expected = {
        "/clock": 200,
        "/joint_states": 200,
        "/odom": 100,
        "/amcl_pose": 20,
        "/scan": 40,
        "/tilt_scan": 40,
        "/wrist_ft/left": 200,
        "/wrist_ft/right": 200,
        "/cart_pose/hands": 100,
    }
    for topic, number in expected.items():
        assert abs(count[topic] - number) <= 2, topic
    assert set(count) <= set(MESSAGE_TYPES)
    assert count["/scene"] == count["/robot_description"] == count["/tf_static"] == 1
    for one in seen[:60]:
        for topic, message in to_messages(one):
            assert isinstance(message, MESSAGE_TYPES[topic])


def test_both_estimates_of_the_cart_are_near_the_truth(pushed):
    session, seen = pushed
    true = in_base(session.robot.base_pose(), session.office.world.pose("cart"))
    for source, place, turn in (("hands", 0.006, 0.012), ("checkerboard", 0.05, 0.08)):
        reading = last(seen, CartReading, source=source)
        assert np.hypot(*(reading.pose - true)[:2]) < place, source
        assert abs(wrap(reading.pose[2] - true[2])) < turn, source


def test_odometry_and_localisation_are_near_the_truth(pushed):
    session, seen = pushed
    pose, _ = session.robot_truth()
    assert np.abs(last(seen, BaseOdometry).pose - pose).max() < 0.05
    assert last(seen, BaseOdometry).twist[0] == pytest.approx(SPEED, rel=0.25)
    assert np.abs(last(seen, Localisation).pose - pose).max() < 0.15


def test_map_and_odometry_meet_at_the_moment_that_the_localiser_tells_of(make_scene, make_session, run):
    session = make_session(make_scene(bodies={}, sensors={"localisation": {"latency": 0.3}}))
    seen = run(session, 2.0, lambda: session.command_base(0.4, 0.0, 0.6))
    reckoned = {round(one.time, 6): one.pose for one in seen if isinstance(one, BaseOdometry)}
    told = {one.time: one.pose for one in seen if isinstance(one, Localisation)}
    met = [one for one in seen if isinstance(one, Transforms) and one.children == ("odom",) and one.time in told]
    assert len(met) == len(told) > 10
    for frame in met:
        odom = Pose(frame.positions[0], frame.quaternions[0])
        x, y, theta = reckoned[round(frame.time, 6)]
        np.testing.assert_allclose(odom.point([x, y, 0.0])[:2], told[frame.time][:2], atol=1e-9)
        assert wrap(odom.yaw + theta - told[frame.time][2]) == pytest.approx(0.0, abs=1e-9)


def test_a_smaller_step_is_the_same_run(make_scene, make_session, run):
    ends = []
    for step in (STEP, STEP / 2):
        session = make_session(make_scene(), step=step)
        run(session, 0.5, lambda session=session: session.command_base(0.3, 0.05, 0.3))
        ends.append(np.concatenate([session.robot_truth()[0], session.truth("cart").planar]))
    np.testing.assert_allclose(*ends, atol=1.5e-3)


@pytest.mark.parametrize("command", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.7, 0.7, 2.0)])
def test_at_rest_a_third_of_a_second_after_commands_cease(make_scene, make_session, run, command):
    session = make_session(make_scene(bodies={}))
    run(session, 1.5, lambda: session.command_base(*command))
    run(session, 0.3)
    assert np.abs(session.robot_truth()[1]).max() < 5e-3


def test_arms_torso_and_head_stop_too(make_scene, make_session, run):
    session = make_session(make_scene(bodies={}))

    def command():
        session.command_arm("left", [0.2] * 7)
        session.command_arm("right", [-0.1] * 7)
        session.command_torso(0.01)
        session.command_head(0.3, -0.3)

    moving = last(run(session, 0.3, command), JointStates).velocity
    np.testing.assert_allclose(moving[4:11], 0.2, rtol=0.05)
    np.testing.assert_allclose(moving[:3], [0.01, 0.3, -0.3], rtol=0.05)
    still = last(run(session, 0.3), JointStates).velocity
    assert np.abs(np.delete(still, BODY_JOINTS.index("laser_tilt_mount_joint"))).max() < 5e-3


def test_a_bad_command_is_refused_and_changes_nothing(make_scene, make_session):
    session = make_session(make_scene(bodies={}))
    for bad in ([0.0] * 6, [math.nan] + [0.0] * 6):
        with pytest.raises(Pr2Error, match="left command: expected"):
            session.command_arm("left", bad)
    with pytest.raises(Pr2Error, match="base command: expected finite"):
        session.command_base(math.inf, 0.0, 0.0)
    with pytest.raises(Pr2Error, match="expected 'left' or 'right'"):
        session.command_arm("middle", [0.0] * 7)


def test_release_and_grasp_again(make_scene, make_session, run):
    session = make_session(make_scene())
    run(session, 0.05)
    assert session.release("left").success
    assert [hold.gripper for hold in last(run(session, 0.05), GraspState).holds] == ["right"]
    assert not session.release("left").success
    assert session.grasp("left", "cart").success
    assert [hold.gripper for hold in last(run(session, 0.05), GraspState).holds] == ["left", "right"]


def test_a_grip_that_is_asked_too_much_breaks_and_tells(make_scene, make_session, run):
    """The cart is stuck, and the robot turns about its right hand: the left one is pulled off the handle."""
    session = make_session(make_scene())
    run(session, 0.1)
    session.office.world.find("cart").park()
    seen = run(session, 0.8, lambda: session.command_base(-0.1, -0.26, 0.4))
    assert [hold.gripper for hold in last(seen, GraspState).holds] == ["right"]
    assert math.isnan(last(run(session, 0.1), CartReading, source="hands").misfit)


def test_reaction_of_a_stuck_cart_is_felt_at_the_wrists(make_scene, make_session, run):
    session = make_session(make_scene(sensors={"wrist_ft": {"force_bias": 0.0}}))
    run(session, 0.2)
    before = {side: session.robot.wrist_wrench(side)[0] for side in ("left", "right")}
    session.office.world.find("cart").park()
    run(session, 0.15, lambda: session.command_base(0.05, 0.0, 0.0))
    for side, rest in before.items():
        felt = session.robot.link_pose(f"{side}_ft").matrix @ (session.robot.wrist_wrench(side)[0] - rest)
        assert felt[0] < -5.0, side  # the cart pushes back


def test_same_seed_same_bytes(make_scene, make_session, run):
    scene = make_scene(people={"ann": {"route": [[3.0, -2.0], [3.0, 2.0]]}}, manners={"step_in_rate": 30.0})
    runs = []
    for _ in range(2):
        session = make_session(scene, seed=7)
        runs.append(to_text(run(session, 0.5, lambda session=session: session.command_base(0.2, 0.1, 0.1))))
    assert runs[0] == runs[1]


def test_clutter_and_people_are_in_no_message_about_the_scene(make_scene, make_session, run):
    desk = {"kind": "fixture", "polygon": [[0, 0], [1, 0], [1, 0.7], [0, 0.7]], "height": 0.75, "pose": [3, 1, 0]}
    scene = make_scene(clutter={"desk": desk}, people={"ann": {"route": [[4.0, -2.0]]}})
    seen = run(make_session(scene), 0.02)
    assert [body.name for body in last(seen, KnownScene).bodies] == ["cart"]
    assert not any("desk" in text or "ann" in text for _, text in to_text(seen))


def test_nothing_between_the_fingers_is_an_error(make_scene, make_session):
    far = make_scene().bodies["cart"].model_dump() | {"pose": [2.0, 0.0, 0.0]}
    with pytest.raises(SimError, match=r"robot\.holds: expected cart between the fingers"):
        make_session(make_scene(bodies={"cart": far}))


def test_a_wrist_that_is_faster_than_the_physics_is_refused(make_scene, make_session):
    with pytest.raises(SimError, match=r"sensors\.wrist_ft\.rate: expected at most 200 Hz"):
        make_session(make_scene(sensors={"wrist_ft": {"rate": 250}}))


def test_a_body_in_the_robots_place_is_refused(make_scene, make_session):
    near = make_scene().bodies["cart"].model_dump() | {"pose": [0.5, 0.0, 0.0]}
    with pytest.raises(SimError, match=r"robot\.pose: expected a place clear of cart"):
        make_session(make_scene(bodies={"cart": near}))
