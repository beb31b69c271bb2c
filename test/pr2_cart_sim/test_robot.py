"""The robot's base, drives and wrist sensors against statics and kinematics."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pr2_cart_sim.description import ARM_JOINTS, BODY_JOINTS, SIDES
from pr2_cart_sim.errors import Pr2Error
from pr2_cart_sim.postures import POSTURES, Posture, posture
from pr2_cart_sim.robot import BASE_ACCELERATION, BASE_SPEED, LEASH

GRIPPER_WEIGHT = 1.013 * 9.81


def test_unloaded_wrist_feels_the_grippers_weight(stage):
    stage.run(0.3)
    for side in SIDES:
        force, torque = stage.robot.wrist_wrench(side)
        weight = stage.robot.link_pose(f"{side}_ft").matrix.T @ [0, 0, -GRIPPER_WEIGHT]
        np.testing.assert_allclose(force, weight, atol=0.03)  # the frames on the palm weigh 2 g
        np.testing.assert_allclose(torque, np.cross([0, 0.0912, 0], weight), atol=0.005)


@pytest.mark.parametrize("side", SIDES)
def test_wrist_recovers_a_force_at_the_fingers(stage, side):
    stage.run(0.2)
    rest, pull = stage.robot.wrist_wrench(side), np.array([-20.0, 6.0, 4.0])
    for _ in range(120):
        frame = stage.robot.link_pose(f"{side}_ft")
        stage.client.apply_force("pr2", stage.robot.links[f"{side}_ft"], pull, frame.point([0, 0.18, 0]))
        stage.run(stage.client.step_time)
    force, torque = (now - before for now, before in zip(stage.robot.wrist_wrench(side), rest, strict=True))
    applied = frame.matrix.T @ pull
    assert np.linalg.norm(force - applied) < 0.03 * np.linalg.norm(applied)
    np.testing.assert_allclose(torque, np.cross([0, 0.18, 0], applied), atol=0.15)


def test_joints_hold_their_place_against_the_arms_weight(stage):
    start = stage.robot.joint_state()[0]
    stage.run(1.0)
    np.testing.assert_allclose(stage.robot.joint_state()[0], start, atol=1e-5)


def test_joints_track_a_velocity_and_the_others_stay(stage):
    stage.robot.command_joints("l_shoulder_pan_joint", [0.2] * 7)
    stage.run(0.3)
    before = stage.robot.joint_state()[0]
    stage.run(0.5)
    after, velocity = stage.robot.joint_state()
    left = [BODY_JOINTS.index(name) for name in ARM_JOINTS["left"]]
    np.testing.assert_allclose(after[left] - before[left], 0.1, rtol=0.01)
    np.testing.assert_allclose(velocity[left], 0.2, rtol=0.02)
    others = [BODY_JOINTS.index(name) for name in BODY_JOINTS if name not in ARM_JOINTS["left"]]
    np.testing.assert_allclose(after[others], before[others], atol=1e-4)


def test_a_joint_at_its_limit_stops_and_comes_back(stage):
    wrist, upper = BODY_JOINTS.index("l_wrist_flex_joint"), 0.0
    stage.robot.command_joints("l_wrist_flex_joint", [3.0])
    stage.run(1.0)
    angle, speed = (values[wrist] for values in stage.robot.joint_state())
    assert angle == pytest.approx(upper, abs=2e-3)
    assert abs(speed) < 1e-3
    stage.robot.command_joints("l_wrist_flex_joint", [-1.0])
    stage.run(0.5)
    assert stage.robot.joint_state()[0][wrist] < -0.3


def test_a_blocked_joint_does_not_wind_up(stage):
    pan = BODY_JOINTS.index("l_shoulder_pan_joint")
    stage.robot.command_joints("l_shoulder_pan_joint", [0.5])
    for _ in range(200):
        tool = stage.robot.link_pose("left_ft")
        stage.client.apply_force(
            "pr2", stage.robot.links["left_ft"], np.array([0.0, 0, 0]) - 200 * tool.matrix[:, 2], tool.position
        )
        stage.run(stage.client.step_time)
    stage.robot.command_joints("l_shoulder_pan_joint", [0.0])
    stage.run(0.3)
    held = stage.robot.joint_state()[0][pan]
    stage.run(0.3)
    assert abs(stage.robot.joint_state()[0][pan] - held) < LEASH


@pytest.mark.parametrize(("vx", "vy"), [(0.3, 0.0), (0.0, -0.2), (0.2, 0.2)])
def test_base_goes_any_way_in_its_own_axes(stage, vx, vy):
    start, _ = stage.robot.base_state()
    stage.robot.command_base(vx, vy, 0.0)
    stage.run(1.0)
    pose, _ = stage.robot.base_state()
    cos, sin = math.cos(0.5), math.sin(0.5)
    speed = math.hypot(vx, vy)
    share = 1.0 - speed / BASE_ACCELERATION[0] / 2  # of the way that the ramp leaves
    way = share * np.array([cos * vx - sin * vy, sin * vx + cos * vy])
    np.testing.assert_allclose(pose - start, [*way, 0.0], atol=2e-3)


def test_base_turns_on_the_spot(stage):
    start, _ = stage.robot.base_state()
    stage.robot.command_base(0.0, 0.0, 0.8)
    stage.run(1.0)
    pose, rates = stage.robot.base_state()
    assert pose[2] - start[2] == pytest.approx(0.8 - 0.8 * 0.4 / 2, abs=5e-3)
    np.testing.assert_allclose(pose[:2], start[:2], atol=1e-3)
    assert rates[2] == pytest.approx(0.8, rel=0.01)


def test_base_keeps_its_speed_limit_in_every_direction(stage):
    stage.robot.command_base(5.0, 5.0, 9.0)
    stage.run(1.5)
    _, rates = stage.robot.base_state()
    assert math.hypot(*rates[:2]) == pytest.approx(BASE_SPEED[0], rel=0.02)
    assert rates[2] == pytest.approx(BASE_SPEED[1], rel=0.02)


def test_a_pull_at_the_hand_comes_back_to_the_base(stage):
    """Beyond what held wheels bear it moves, below it does not."""
    stage.run(0.1)
    for force, moves in ((40.0, False), (4000.0, True)):
        before = stage.robot.base_state()[0]
        for _ in range(40):
            place = stage.client.link_pose("pr2", stage.robot.links["torso_lift_link"]).position
            stage.client.apply_force("pr2", stage.robot.links["torso_lift_link"], np.array([force, 0, 0]), place)
            stage.run(stage.client.step_time)
        assert (abs(stage.robot.base_state()[0][0] - before[0]) > 0.01) == moves


def test_unknown_posture_names_the_nearest():
    with pytest.raises(Pr2Error, match="did you mean 'edge_grasp'"):
        posture("edge_gras")


def test_posture_beyond_a_limit_is_refused(stage):
    bent = Posture(0.5, POSTURES["tucked"].left, POSTURES["tucked"].right)
    with pytest.raises(Pr2Error, match=r"torso_lift_joint 0\.500 is not in 0\.000 \.\. 0\.330"):
        stage.robot._place((0, 0, 0), bent)
