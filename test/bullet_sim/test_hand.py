"""A hand on an edge: Newton's laws between hand, body and sensor, and what a recording of it holds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from bullet_sim.client import GRAVITY
from bullet_sim.errors import SimError
from bullet_sim.hand import HandSpec
from bullet_sim.hand_push import STANDING, edge_grasp, push_by_hand
from bullet_sim.hand_recording import Activity, HandPath, HandPush, HandRecording

PLAIN = {"kind": "plain_table", "size": [0.8, 1.4], "nominal_mass": 30.0, "pose": [0.3, -0.2, 0.4]}
QUIET = {
    "tags": {"sigma_xy": 0, "sigma_z": 0, "sigma_yaw": 0, "sigma_tilt": 0, "dropout": 0, "bias": 0},
    "wrist_ft": {
        "force_noise": [0, 0, 0],
        "torque_noise": [0, 0, 0],
        "force_bias": 0,
        "torque_bias": 0,
        "force_resolution": 0,
        "torque_resolution": 0,
    },
}
CONTACT = (-0.4, 0.3)
SWAY = HandPath(
    np.array([0.0, 1.0, 2.0, 3.0, 4.0]),
    np.array([[0, 0, 0], [0.12, 0.03, 0.1], [-0.05, 0.02, -0.2], [0.1, -0.08, 0.1], [0, 0, 0]]),
)


@pytest.fixture
def push(lab: Any) -> Callable[..., HandRecording]:
    def run(
        path: HandPath = SWAY, *, seed: int = 3, concealed: Any = None, sensors: Any = QUIET, **options: Any
    ) -> HandRecording:
        scene = lab.scene({"table_a": PLAIN}, concealed=concealed or {}, sensors=sensors or {})
        return push_by_hand(scene, [HandPush("table_a", CONTACT, path)], seed=seed, **options)

    return run


def test_what_the_hand_gives_the_body_gets(push: Callable[..., HandRecording], monkeypatch: Any) -> None:
    monkeypatch.setattr("bullet_sim.hand_push.TRUTH_RATE", 400.0)
    recording = push()
    track, pushed, dt = recording.bodies["table_a"], recording.pushed, 1 / 400
    np.testing.assert_allclose(30 * track.twist[-1, :2], pushed[:, :2].sum(0) * dt, atol=0.02)
    arm = pushed[:, 3:] - track.pose[:, :2]
    moment = pushed[:, 2] + arm[:, 0] * pushed[:, 1] - arm[:, 1] * pushed[:, 0]
    inertia = 30 * (0.8**2 + 1.4**2) / 12
    np.testing.assert_allclose(inertia * track.twist[:, 2], np.cumsum(moment) * dt, atol=0.03)
    assert np.abs(30 * track.twist[:, :2]).max() > 3.0


def test_before_the_grasp_the_sensor_shows_weight_and_bias(push: Callable[..., HandRecording]) -> None:
    wrench = push().wrench
    before = wrench.time < STANDING
    spec = HandSpec()
    weight = spec.gripper_mass * GRAVITY
    np.testing.assert_allclose(wrench.force[before], np.tile([0, 0, -weight], (before.sum(), 1)), atol=1e-9)
    torque = [-spec.gripper_centre * weight, 0, 0]
    np.testing.assert_allclose(wrench.torque[before], np.tile(torque, (before.sum(), 1)), atol=1e-9)
    noisy = push(sensors=None).wrench
    bias = noisy.force[before].mean(0) - [0, 0, -weight]
    assert 0.01 < np.abs(bias).max() < 1.5 + 0.1
    assert noisy.force[before].std() > 0.03


def test_the_sensor_turned_back_gives_what_acts_on_the_body(push: Callable[..., HandRecording]) -> None:
    recording = push()
    wrench, gripper = recording.wrench, recording.tags["left_gripper"]
    held = (wrench.time > STANDING + 0.05) & (wrench.time < STANDING + SWAY.duration)
    turn = 2 * np.unwrap(np.arctan2(gripper.quaternion[:, 2], gripper.quaternion[:, 3]))
    yaw = np.interp(wrench.time, gripper.time, turn)[held]
    across, along = wrench.force[held, 0], wrench.force[held, 1]
    world = np.stack([np.cos(yaw) * across - np.sin(yaw) * along, np.sin(yaw) * across + np.cos(yaw) * along], -1)
    true = np.stack([np.interp(wrench.time, recording.bodies["table_a"].time, f) for f in recording.pushed[:, :2].T])
    # What is left: the tool's own inertia, and a wrench averaged over 10 ms beside one of a moment.
    gap = -world - true.T[held]
    assert np.sqrt((gap**2).mean()) < 0.35
    assert np.abs(true).max() > 3.0


def test_the_hand_goes_where_it_is_told_and_the_edge_with_it(push: Callable[..., HandRecording]) -> None:
    straight = HandPath(np.array([0.0, 1.0, 3.0, 4.0]), np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0, 0], [0, 0, 0]]))
    recording = push(straight)
    moved = recording.pushed[-1, 3:] - recording.pushed[0, 3:]
    np.testing.assert_allclose(moved, [0.3, 0.0], atol=0.02)
    gripper = recording.tags["left_gripper"].position
    np.testing.assert_allclose((gripper[-1] - gripper[0])[:2], moved, atol=0.03)
    along = HandPath(straight.time, straight.twist, "hand")
    forward = push(along).pushed
    heading = 0.4  # the edge's normal
    np.testing.assert_allclose(
        forward[-1, 3:] - forward[0, 3:], 0.3 * np.array([np.cos(heading), np.sin(heading)]), atol=0.03
    )


def test_the_servo_has_a_limited_force(push: Callable[..., HandRecording]) -> None:
    pin = {"hidden_hinge": {"table_a": {"point": [0.0, 0.0], "stiffness": 1e5}}}
    fast = HandPath(np.array([0.0, 0.5, 3.0]), np.array([[0, 0, 0], [0.2, 0, 0], [0.2, 0, 0]]), "hand")
    recording = push(fast, concealed=pin, hand=HandSpec(force_limit=40.0))
    assert 30.0 < np.hypot(*recording.pushed[-60, :2]) < 42.0


def test_an_edge_that_slips_out_ends_the_recording_with_a_sentence(push: Callable[..., HandRecording]) -> None:
    pull = HandPath(np.array([0.0, 0.5, 4.0]), np.array([[0, 0, 0], [-0.2, 0, 0], [-0.2, 0, 0]]), "hand")
    pin = {"hidden_hinge": {"table_a": {"point": [0.0, 0.3], "stiffness": 1e5}}}
    recording = push(pull, concealed=pin, hand=HandSpec(force_limit=600.0, lag=0.15))
    assert recording.status.startswith("the hand lost table_a at t = ")
    assert recording.grasps[-1].body is None
    assert recording.slipped > 0.02


def test_same_seed_same_bytes_and_another_seed_another_recording(push: Callable[..., HandRecording]) -> None:
    def shown(seed: int) -> bytes:
        recording = push(sensors=None, seed=seed)
        return recording.wrench.force.tobytes() + recording.tags["table_a"].position.tobytes()

    assert shown(1) == shown(1)
    assert shown(1) != shown(2)


def test_two_grasps_are_told_as_two(lab: Any) -> None:
    scene = lab.scene({"table_a": PLAIN}, sensors=QUIET)
    short = HandPath(np.array([0.0, 0.5, 1.0]), np.array([[0, 0, 0], [0.1, 0, 0], [0, 0, 0]]), "hand")
    pushes = [HandPush("table_a", CONTACT, short), HandPush("table_a", (0.1, -0.7), short)]
    recording = push_by_hand(scene, pushes, seed=1, side="right")
    assert recording.status == "done"
    assert [grasp.body for grasp in recording.grasps] == [None, "table_a", None, "table_a", None]
    assert np.hypot(*(recording.grasps[3].contact[:2] - [0.1, -0.67])) < 0.02
    assert recording.grasps[3].time - recording.grasps[2].time > STANDING
    assert set(recording.tags) == {"table_a", "right_gripper"}
    way = np.diff(recording.tags["right_gripper"].position[:, :2], axis=0)
    assert np.hypot(*way.T).max() < 0.25, "the hand is carried, it does not jump"


def test_carried_half_a_turn_the_hand_turns_one_way(lab: Any) -> None:
    scene = lab.scene({"table_a": PLAIN}, sensors=QUIET)
    short = HandPath(np.array([0.0, 0.5, 1.0]), np.array([[0, 0, 0], [0.1, 0, 0.05], [0, 0, 0]]), "hand")
    edges = [(-0.4, 0.0), (0.4, 0.0), (-0.4, 0.0), (0.4, 0.0)]
    recording = push_by_hand(scene, [HandPush("table_a", edge, short) for edge in edges], seed=1)
    quaternion = recording.tags["left_gripper"].quaternion
    turned = np.abs((quaternion[1:] * quaternion[:-1]).sum(axis=1))
    assert recording.status == "done"
    assert 2.0 * np.arccos(np.minimum(turned, 1.0)).max() < 0.5, "from one picture to the next"


def test_a_table_on_a_slope_waits_for_the_hand_and_a_lower_one_is_taken_lower(lab: Any) -> None:
    low = PLAIN | {"pose": [2.5, 0, 0], "height": 0.5}
    scene = lab.scene({"table_a": PLAIN, "table_b": low}, concealed={"floor_slope": {"angle": 0.02}}, sensors=QUIET)
    short = HandPath(np.array([0.0, 0.5, 1.0]), np.array([[0, 0, 0], [0.1, 0, 0], [0, 0, 0]]), "hand")
    recording = push_by_hand(scene, [HandPush("table_a", CONTACT, short), HandPush("table_b", CONTACT, short)], seed=1)
    track = recording.bodies["table_a"]
    waiting = track.time < STANDING
    assert np.abs(track.pose[waiting] - track.pose[0]).max() < 1e-4
    heights = recording.tags["left_gripper"].position[:, 2]
    assert heights[0] == pytest.approx(0.7775 - 0.0125, abs=1e-3)
    assert heights[-1] == pytest.approx(0.5 - 0.0125, abs=1e-3)


def test_tags_show_the_truth_and_come_a_latency_later(push: Callable[..., HandRecording]) -> None:
    recording = push()
    tag, track = recording.tags["table_a"], recording.bodies["table_a"]
    for axis in (0, 1):
        there = np.interp(tag.time, track.time, track.pose[:, axis])
        np.testing.assert_allclose(tag.position[:, axis], there, atol=1e-3)
    np.testing.assert_allclose(tag.arrival - tag.time, 0.075, atol=1 / 400)


def test_the_hand_takes_the_nearest_edge_square_on(lab: Any) -> None:
    world = lab.world(lab.scene({"table_a": PLAIN}))
    body = world.find("table_a")
    assert edge_grasp(body, (-0.41, 0.3), 0.06) == pytest.approx((-0.37, 0.3, 0.0))
    assert edge_grasp(body, (0.1, 0.69), 0.06) == pytest.approx((0.1, 0.67, -np.pi / 2))


def test_activity_is_told_in_intervals() -> None:
    acting = np.array([False, True, True, False, True])
    activity = Activity("tether", "table_a", "N", np.arange(5.0), acting, acting * 2.0)
    np.testing.assert_array_equal(activity.intervals(), [[1, 2], [4, 4]])
    assert activity.share(1.0, 4.0) == 0.75
    assert np.isnan(activity.share(7.0, 8.0))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"body": "tabel_a"}, "no body 'tabel_a' in scene scene; did you mean 'table_a'"),
        ({"contact": (0.0, 0.0)}, r"expected a contact within 5 cm of the outline of 'table_a', got \[0\.0, 0\.0\]"),
        ({"contact": (float("nan"), 0.0)}, "expected a contact within 5 cm"),
        ({"side": "middle"}, "expected a gripper 'left' or 'right', got 'middle'"),
        ({"pushes": []}, "expected at least one push, got none"),
        ({"path": HandPath(np.array([0.0, 700.0]), np.zeros((2, 3)))}, "expected at most 600 s of pushes, got 700 s"),
    ],
)
def test_a_push_that_does_not_fit_is_a_one_line_error(lab: Any, change: dict[str, Any], message: str) -> None:
    scene = lab.scene({"table_a": PLAIN})
    told = {"body": "table_a", "contact": CONTACT, "path": SWAY} | change
    pushes = told.pop("pushes", [HandPush(told["body"], told["contact"], told["path"])])
    with pytest.raises(SimError, match=message) as caught:
        push_by_hand(scene, pushes, seed=0, side=told.get("side", "left"))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("time", "twist", "axes", "message"),
    [
        ([0.0], [[0, 0, 0]], "world", "at least two knots"),
        ([0.0, 1.0], [[0, 0], [0, 0]], "world", "three velocities each"),
        ([0.0, 0.0], [[0, 0, 0], [0, 0, 0]], "world", "times that rise from zero"),
        ([0.5, 1.0], [[0, 0, 0], [0, 0, 0]], "world", "times that rise from zero"),
        ([0.0, 1.0], [[0, 0, 0], [np.nan, 0, 0]], "world", "finite times and velocities"),
        ([0.0, 1.0], [[0, 0, 0], [0, 0, 0]], "body", "expected 'world' or 'hand', got 'body'"),
    ],
)
def test_a_path_that_is_none_is_a_one_line_error(time: Any, twist: Any, axes: Any, message: str) -> None:
    with pytest.raises(SimError, match=message):
        HandPath(np.array(time), np.array(twist), axes)


def test_a_hand_that_cannot_be_is_a_one_line_error() -> None:
    with pytest.raises(SimError, match="hand: mass: expected a positive number, got -1"):
        HandSpec(mass=-1.0)
    with pytest.raises(SimError, match=r"depth: expected at most the plates' length, got 0\.2 m"):
        HandSpec(depth=0.2)
