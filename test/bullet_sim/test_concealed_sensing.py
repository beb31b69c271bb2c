"""Sensor-side faults and soft grasps: each against what it is told to be, with the same draws of noise."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bullet_sim.bristle import Bristle
from bullet_sim.clamp import GripperSpec
from bullet_sim.client import STEP, Pose, yaw_quaternion
from bullet_sim.concealed.sensing import tag_camera, wrist_sensor
from bullet_sim.concealed.sensor_faults import PoseBiasSettings, WrenchBiasSettings, WrenchFrameSettings
from bullet_sim.errors import SimError
from bullet_sim.hand_push import push_by_hand
from bullet_sim.hand_recording import HandPath, HandPush, HandRecording

PLAIN = {"kind": "plain_table", "size": [0.8, 1.4], "nominal_mass": 30.0, "pose": [0, 0, 0]}
PATH = HandPath(np.array([0.0, 0.7, 1.4, 2.0]), np.array([[0, 0, 0], [0.15, 0, 0.2], [-0.1, 0.1, 0], [0, 0, 0]]))
PLAIN_WRIST = {"force_noise": [0, 0, 0], "torque_noise": [0, 0, 0], "force_resolution": 0, "torque_resolution": 0}


def recorded(lab: Any, concealed: dict[str, Any]) -> HandRecording:
    scene = lab.scene({"table_a": PLAIN}, concealed=concealed)
    return push_by_hand(scene, [HandPush("table_a", (-0.4, 0.3), PATH)], seed=5)


def wrenches(lab: Any, concealed: dict[str, Any], wrench: Any, seconds: float = 2.0) -> tuple[Any, Any]:
    """Stamps (n,) and readings (n, 6) of a noiseless sensor that feels one wrench."""
    scene = lab.scene({"table_a": PLAIN}, concealed=concealed, sensors={"wrist_ft": PLAIN_WRIST})
    sensor = wrist_sensor(scene, "left", np.random.default_rng(0), STEP)
    readings = [sensor.measure(k / 400, np.array(wrench[:3]), np.array(wrench[3:])) for k in range(int(400 * seconds))]
    shown = [reading for reading in readings if reading is not None]
    table = np.array([np.concatenate([r.force, r.torque]) for r in shown])
    return np.array([r.stamp for r in shown]), table - sensor.bias


def test_a_late_sensor_shifts_the_stream_exactly_and_nothing_else(lab: Any) -> None:
    clean, late = recorded(lab, {}), recorded(lab, {"time_offset": {"left": {"delay": 0.06}}})
    count = len(late.wrench.time)
    np.testing.assert_allclose(late.wrench.time, clean.wrench.time[:count] + 0.06, atol=1e-9)
    np.testing.assert_array_equal(late.wrench.force, clean.wrench.force[:count])
    assert len(clean.wrench.time) - count == 6, "what is late at the end is not heard any more"
    for name, tag in clean.tags.items():
        np.testing.assert_array_equal(late.tags[name].position, tag.position)
        np.testing.assert_array_equal(late.tags[name].time, tag.time)


def test_a_late_tag_shifts_its_own_stream_alone(lab: Any) -> None:
    clean, late = recorded(lab, {}), recorded(lab, {"time_offset": {"table_a": {"delay": 0.12}}})
    tag, count = late.tags["table_a"], len(late.tags["table_a"].time)
    np.testing.assert_allclose(tag.time, clean.tags["table_a"].time[:count] + 0.12, atol=1e-9)
    np.testing.assert_array_equal(tag.position, clean.tags["table_a"].position[:count])
    np.testing.assert_allclose(tag.arrival - tag.time, 0.075, atol=1 / 400 + 1e-9)
    np.testing.assert_array_equal(late.tags["left_gripper"].position, clean.tags["left_gripper"].position)
    np.testing.assert_array_equal(late.wrench.force, clean.wrench.force)


def test_a_sensor_faster_than_the_physics_is_refused_in_a_line(lab: Any) -> None:
    fast = lab.scene({"table_a": PLAIN}, sensors={"wrist_ft": {"rate": 1000}})
    with pytest.raises(SimError, match=r"sensors\.wrist_ft\.rate: expected at most 400 Hz, .*, got 1000 Hz"):
        push_by_hand(fast, [HandPush("table_a", (-0.4, 0.3), PATH)], seed=5)
    for step in (STEP, 1 / 300, 1 / 200):
        wrist_sensor(lab.scene(sensors={"wrist_ft": {"rate": 1 / step}}), "left", np.random.default_rng(0), step)


def test_an_offset_rises_and_a_drift_goes_on(lab: Any) -> None:
    told = {"force": [2.0, 0, 0], "torque": [0, 0.1, 0], "start": 0.5, "rise": 0.5, "force_drift": [0, 0, 0.4]}
    stamps, shown = wrenches(lab, {"wrench_bias": {"left": told}}, [5, 6, 7, 0.1, 0.2, 0.3])
    extra = shown - [5, 6, 7, 0.1, 0.2, 0.3]
    np.testing.assert_allclose(extra[stamps < 0.5], 0.0, atol=1e-12)
    end = stamps >= 1.0
    np.testing.assert_allclose(extra[end, 0], 2.0, atol=1e-12)
    np.testing.assert_allclose(extra[end, 4], 0.1, atol=1e-12)
    np.testing.assert_allclose(extra[end, 2], 0.4 * (stamps[end] - 0.5), atol=1e-12)
    assert WrenchBiasSettings(force=(1.0, 0, 0)).at(0.0)[0] == 1.0


def test_a_turned_and_scaled_sensor_shows_the_same_wrench_in_its_own_axes(lab: Any) -> None:
    turn = {"scale": 1.2, "torque_scale": 1.0, "turn": [0.0, 0.0, math.pi / 2]}
    _, shown = wrenches(lab, {"wrench_frame": {"left": turn}}, [5, 6, 7, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(shown[0], [1.2 * 6, 1.2 * -5, 1.2 * 7, 0.2, -0.1, 0.3], atol=1e-9)
    frame = WrenchFrameSettings(turn=(0.3, -0.2, 0.5)).matrix
    np.testing.assert_allclose(frame @ frame.T, np.eye(6), atol=1e-12)
    assert np.linalg.det(frame[:3, :3]) == pytest.approx(1.0)
    axis = np.array([0.3, -0.2, 0.5])
    np.testing.assert_allclose(frame[:3, :3] @ axis, axis, atol=1e-12)
    np.testing.assert_array_equal(WrenchFrameSettings().matrix, np.eye(6))


def test_the_other_sensor_has_no_fault(lab: Any) -> None:
    scene = lab.scene({"table_a": PLAIN}, concealed={"wrench_frame": {"left": {"scale": 1.5}}})
    sensor = wrist_sensor(scene, "right", np.random.default_rng(0), STEP)
    reading = sensor.measure(0.0, np.array([100.0, 0, 0]), np.zeros(3))
    assert reading is not None
    assert reading.force[0] == pytest.approx(100.0, abs=2.0)


def test_a_tag_glued_askew_is_seen_where_it_is(lab: Any) -> None:
    bias = {"offset": [0.05, -0.02], "turn": 0.1}
    quiet = {
        "tags": {"sigma_xy": 0, "sigma_z": 0, "sigma_yaw": 0, "sigma_tilt": 0, "dropout": 0, "bias": 0, "latency": 0}
    }
    scene = lab.scene({"table_a": PLAIN}, concealed={"pose_bias": {"table_a": bias}}, sensors=quiet)
    camera = tag_camera(scene, np.random.default_rng(0))
    pose = Pose(np.array([1.0, 2.0, 0.7]), yaw_quaternion(math.pi / 2))
    camera.capture(0.0, {"table_a": pose, "left_gripper": pose})
    seen, gripper = camera.deliver(0.0)
    np.testing.assert_allclose(seen.position, [1.02, 2.05, 0.7], atol=1e-12)
    assert Pose(seen.position, seen.quaternion).yaw == pytest.approx(math.pi / 2 + 0.1)
    np.testing.assert_array_equal(gripper.position, pose.position)
    assert PoseBiasSettings(offset=(0.1, 0.0)).seen(pose).position[1] == pytest.approx(2.1)


def test_faults_are_told_to_whoever_scores(lab: Any) -> None:
    bias = {"left": {"force": [3.0, 4.0, 0.0], "start": 2.0}}
    activity = recorded(lab, {"wrench_bias": bias}).activities["wrench_bias.left"]
    assert activity.effect == "wrench_bias"
    np.testing.assert_allclose(activity.intervals()[0, 0], 2.0, atol=0.02)
    assert activity.strength.max() == pytest.approx(5.0)


def test_soft_rubber_gives_way_by_the_force_over_its_stiffness() -> None:
    for stiffness in (2.0e4, 1.5e3):
        bristle = Bristle(GripperSpec(stiffness=stiffness), 0.06, (0.1, 0.2), 0.0)
        assert bristle.load(0.102, 0.2, (0.0, 0.0), 0.0, 0.0)[0] == pytest.approx(stiffness * 0.002)


def test_within_its_play_a_grasp_holds_nothing_and_beyond_it_k_times_the_rest() -> None:
    bristle = Bristle(GripperSpec(stiffness=1e4, play=0.004), 0.06, (0.0, 0.0), 0.0)
    assert bristle.load(0.003, -0.002, (1.0, 1.0), 0.05, 1.0) == (0.0, 0.0, 0.0)
    fx, fy, torque = bristle.load(0.0, 0.009, (0.0, 0.0), 0.0, 0.0)
    assert (fx, torque) == (0.0, 0.0)
    assert fy == pytest.approx(1e4 * 0.005)
    assert bristle.load(0.0, 0.0, (0.0, 0.0), 0.2, 0.0)[2] > 0


def test_a_loose_grasp_moves_against_its_object(lab: Any) -> None:
    tight, loose = (
        recorded(lab, {}),
        recorded(lab, {"grasp_compliance": {"table_a": {"stiffness": 600.0, "play": 0.01}}}),
    )

    def play(recording: HandRecording) -> float:
        """Largest way of the hand in the body's frame while it holds [m]."""
        pose, held = recording.bodies["table_a"].pose, np.abs(recording.pushed[:, :2]).max(1) > 0
        gap = recording.pushed[held, 3:] - pose[held, :2]
        cos, sin = np.cos(pose[held, 2]), np.sin(pose[held, 2])
        local = np.stack([cos * gap[:, 0] + sin * gap[:, 1], cos * gap[:, 1] - sin * gap[:, 0]], -1)
        return float(np.ptp(local, axis=0).max())

    assert play(tight) < 0.004
    assert play(loose) > 0.012
