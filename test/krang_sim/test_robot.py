"""The robot's drives, wrist sensors and odometry against statics and kinematics."""

from __future__ import annotations

import numpy as np
import pytest

from bullet_sim.client import Pose
from bullet_sim.quiet import bullet
from krang_sim.errors import KrangError
from krang_sim.postures import POSTURES, Posture, posture
from krang_sim.robot import BODY_JOINTS, JOINTS, LEASH, SIDES, Krang, WheelOdometry

GRIPPER_WEIGHT = 1.769 * 9.81
APPROACH = {"left": np.array([0, 1.0, 0]), "right": np.array([0, -1.0, 0])}


def sensor_axes(robot: Krang, side: str) -> Pose:
    positions, quaternions = robot.link_poses([f"{side}_ft"])
    return Pose(positions[0], quaternions[0])


@pytest.mark.parametrize("name", POSTURES)
def test_unloaded_wrist_feels_the_grippers_weight(stages, name):
    stage = stages(name)
    stage.run(0.5)
    for side in SIDES:
        force, torque = stage.robot.wrist_wrench(side)
        weight = sensor_axes(stage.robot, side).matrix.T @ [0, 0, -GRIPPER_WEIGHT]
        np.testing.assert_allclose(force, weight, atol=0.01)
        np.testing.assert_allclose(torque, np.cross(0.091 * APPROACH[side], weight), atol=0.002)
    stage.client.close()


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("pull", [(-30, 0, 0), (0, 12, 0), (10, -5, 8)])
def test_wrist_recovers_a_force_at_the_tip(stage, side, pull):
    stage.run(0.3)
    rest = stage.robot.wrist_wrench(side)
    link = stage.robot.links[f"{side}_ft"]
    for _ in range(200):
        frame = sensor_axes(stage.robot, side)
        tip = frame.point(0.217 * APPROACH[side])
        stage.client.apply_force("krang", link, np.array(pull, dtype=float), tip)
        stage.run(stage.client.step_time)
    force, torque = (now - before for now, before in zip(stage.robot.wrist_wrench(side), rest, strict=True))
    applied = frame.matrix.T @ pull
    size = np.linalg.norm(applied)
    assert np.linalg.norm(force - applied) < 0.02 * size
    assert np.linalg.norm(torque - np.cross(0.217 * APPROACH[side], applied)) < 0.02 * 0.217 * size


def test_wrist_feels_a_wall(stage):
    stage.run(0.3)
    rest = {side: stage.robot.wrist_wrench(side)[0] for side in SIDES}
    shape = stage.client.api.createCollisionShape(bullet.GEOM_BOX, halfExtents=[0.05, 1, 0.2])
    wall = stage.client.add("wall", stage.client.api.createMultiBody(0, shape, -1, [0.73, 0, 0.77]))
    felt, pressed = [], []
    for step in range(600):
        stage.robot.command_base(0.05, 0.0)
        stage.run(stage.client.step_time)
        if step >= 400:
            axes = {side: sensor_axes(stage.robot, side).matrix for side in SIDES}
            felt.append(sum((axes[s] @ (stage.robot.wrist_wrench(s)[0] - rest[s]))[0] for s in SIDES))
            pressed.append(sum(point[9] for point in stage.client.api.getContactPoints(stage.robot.number, wall)))
    assert np.mean(pressed) > 20
    assert np.mean(felt) == pytest.approx(-np.mean(pressed), rel=0.05)


def test_joints_hold_their_place(stage):
    stage.run(2.0)
    angles, _ = stage.robot.joint_state()
    np.testing.assert_allclose(angles[2:], POSTURES["square_table_push"].body_joints, atol=5e-4)


@pytest.mark.parametrize("speed", [0.05, 0.3])
def test_joints_track_a_velocity(stage, speed):
    stage.robot.command_joints("LJ1", [speed] * 7)
    stage.run(0.5)
    before = stage.robot.joint_state()[0]
    stage.run(1.0)
    after, velocity = stage.robot.joint_state()
    left = [JOINTS.index(f"LJ{k}") for k in range(1, 8)]
    np.testing.assert_allclose(after[left] - before[left], speed, rtol=0.01)
    np.testing.assert_allclose(velocity[left], speed, rtol=0.02)
    others = [JOINTS.index(name) for name in BODY_JOINTS if not name.startswith("L")]
    np.testing.assert_allclose(after[others], before[others], atol=2e-3)


def test_joints_obey_their_speed_limits(stage):
    stage.robot.command_joints("waist", [-9.0] * 16)
    stage.run(1.0)
    _, velocity = stage.robot.joint_state()
    assert (np.abs(velocity[2:]) <= stage.robot.limits.velocity[2:] * 1.02).all()
    assert (np.abs(velocity[2:]) >= stage.robot.limits.velocity[2:] * 0.9).sum() >= 10


def test_a_joint_at_its_limit_stops_and_comes_back(stage):
    bend = JOINTS.index("LJ6")
    stage.robot.command_joints("LJ6", [0.4])
    stage.run(3.0)
    angles, velocity = stage.robot.joint_state()
    assert angles[bend] == pytest.approx(stage.robot.limits.upper[bend], abs=2e-3)
    assert abs(velocity[bend]) < 1e-3
    stage.robot.command_joints("LJ6", [-0.4])
    stage.run(1.0)
    assert stage.robot.joint_state()[0][bend] < angles[bend] - 0.3


def test_a_blocked_joint_does_not_wind_up(stage):
    """Held fast for three seconds, the joint moves on from where it is, without a jump."""
    wrist, number = JOINTS.index("LJ7"), stage.client.joint("krang", "LJ7")
    stage.robot.command_joints("LJ7", [0.5])
    for _ in range(1200):
        stage.client.api.applyExternalTorque(
            stage.robot.number, number, (-30 * APPROACH["left"]).tolist(), bullet.LINK_FRAME
        )
        stage.run(stage.client.step_time)
    stage.robot.command_joints("LJ7", [0.0])
    stage.run(0.3)
    held = stage.robot.joint_state()[0][wrist]
    stage.run(0.5)
    assert abs(stage.robot.joint_state()[0][wrist] - held) < LEASH


def test_straight_metre(stage):
    odometry = WheelOdometry()
    stage.robot.command_base(0.16, 0.0)
    stage.run(6.25)
    stage.robot.command_base(0.0, 0.0)
    stage.run(1.0)
    base = stage.robot.base_pose()
    assert base.position[0] == pytest.approx(1.0, rel=0.02)
    assert abs(base.position[1]) < 0.02
    assert abs(base.yaw) < 0.02
    odometry.update(stage.client.time, stage.robot.joint_state()[0][:2])
    np.testing.assert_allclose(odometry.pose, [base.position[0], base.position[1], base.yaw], atol=0.02)


@pytest.mark.parametrize("turn", [0.3, -0.3])
def test_quarter_turn(stage, turn):
    stage.robot.command_base(0.0, turn)
    stage.run(np.pi / 2 / abs(turn) + 0.5 * abs(turn) * (1 / 1.0 - 1 / 3.0))  # it speeds up slower than it stops
    stage.robot.command_base(0.0, 0.0)
    stage.run(1.0)
    base = stage.robot.base_pose()
    assert base.yaw == pytest.approx(np.sign(turn) * np.pi / 2, rel=0.04)
    assert np.hypot(*base.position[:2]) < 0.05


def test_a_hard_stop_leaves_the_slider_on_the_floor(stage):
    stage.robot.command_base(0.5, 0.0)
    stage.run(2.0)
    stage.robot.command_base(0.0, 0.0)
    lowest = []
    for _ in range(40):
        stage.run(0.05)
        lowest.append(stage.robot.link_poses(["slider"])[0][0][2])
    assert max(lowest) < 0.005


def test_a_stop_of_everything_keeps_hands_on_their_way(stage):
    """All joints and the base have the same share of their speeds left at any moment, and it ends with the slowest."""
    speeds = np.array([0.3, -0.1, 0.2, 0.4, -0.3, 0.2, 0.8])
    left = [JOINTS.index(f"LJ{k}") for k in range(1, 8)]
    stage.robot.command_joints("LJ1", speeds)
    stage.robot.command_base(-0.2, 0.0)
    stage.run(0.8)
    base = stage.robot.base_twist()[0]
    stage.robot.command_joints("LJ1", np.zeros(7))
    stage.robot.command_base(0.0, 0.0)
    shares = []
    for _ in range(10):
        stage.run(0.01)
        shares.append([*(stage.robot.joint_state()[1][left] / speeds), stage.robot.base_twist()[0] / base])
    assert shares[0][0] > 0.9, "no jump"
    assert np.ptp(shares, axis=1).max() < 0.08, "together"
    assert 0.05 < shares[-1][3] < 0.3, "as fast as the fourth can: 0.4 rad/s at 190 degrees/s^2 take 0.12 s"
    stage.run(0.06)
    assert np.abs(stage.robot.joint_state()[1][left]).max() < 0.01


def test_unknown_posture_names_the_nearest():
    with pytest.raises(KrangError, match="did you mean 'square_table_push'"):
        posture("square_table")


def test_posture_beyond_a_limit_is_refused(stage):
    bent = Posture(3.5, 0.0, (0.0,) * 7, (0.0,) * 7)
    with pytest.raises(KrangError, match=r"waist 3\.500 is not in 0\.000 \.\. 2\.880"):
        stage.robot._place(bent)


def test_odometry_of_a_circle_closes():
    odometry = WheelOdometry()
    for step in range(1, 401):
        turned = 2 * np.pi * step / 400  # about the left wheel
        odometry.update(step * 0.01, np.array([0.0, turned * 0.695 / 0.267]))
    np.testing.assert_allclose(odometry.pose, [0, 0, 2 * np.pi], atol=1e-3)
    np.testing.assert_allclose(odometry.twist, [2 * np.pi / 4 * 0.695 / 2, 2 * np.pi / 4], rtol=1e-2)
