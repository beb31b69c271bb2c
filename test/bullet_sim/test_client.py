from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest

from bullet_sim.client import GRAVITY, BulletClient, Pose, cross, yaw_quaternion
from bullet_sim.errors import SimError
from bullet_sim.quiet import bullet


def test_import_and_a_world_print_nothing() -> None:
    code = "from bullet_sim.client import BulletClient; BulletClient().close()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert (done.stdout, done.stderr) == (b"", b"")


@pytest.mark.parametrize("step", [0.0, -0.01, 0.5, math.nan, math.inf])
def test_refuses_a_step_that_no_physics_stands(step: float) -> None:
    with pytest.raises(SimError, match="physics step: expected"):
        BulletClient(step=step)


def ball(client: BulletClient, name: str = "ball") -> int:
    shape = client.api.createCollisionShape(bullet.GEOM_SPHERE, radius=0.1)
    return client.add(name, client.api.createMultiBody(1.0, shape, basePosition=[0, 0, 10]))


def test_a_flying_body_keeps_its_speed_and_spin_and_falls_freely() -> None:
    with BulletClient() as client:
        body = ball(client)
        client.api.resetBaseVelocity(body, [3, 0, 0], [0, 0, 5])
        for _ in range(400):
            client.step()
        twist = client.centre_twist("ball")
        np.testing.assert_allclose(twist.linear, [3, 0, -GRAVITY], atol=1e-9)
        np.testing.assert_allclose(twist.angular, [0, 0, 5], atol=1e-9)
        assert client.time == pytest.approx(1.0)


def test_names_are_unique_and_a_misspelt_one_is_met_with_the_nearest() -> None:
    with BulletClient() as client:
        ball(client, "globe")
        with pytest.raises(SimError, match="'glob' is not in the scene; did you mean 'globe'"):
            client.body("glob")
        with pytest.raises(SimError, match="expected a new name"):
            ball(client, "globe")
        with pytest.raises(SimError, match="no joint 'knee'; there are none"):
            client.joint("globe", "knee")
        with pytest.raises(SimError, match=r"nothing.urdf: expected a URDF"):
            client.load_urdf("robot", "nothing.urdf", Pose(np.zeros(3), yaw_quaternion(0.0)))


def test_a_window_without_a_display_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    with pytest.raises(SimError, match="DISPLAY is not set"):
        BulletClient(gui=True)


@pytest.mark.parametrize(("eye", "width"), [((0, 0, 0), 64), ((math.nan, 0, 1), 64), ((1, 0, 0), 0)])
def test_a_picture_of_nothing_is_refused(eye: tuple[float, float, float], width: int) -> None:
    with BulletClient() as client, pytest.raises(SimError, match="picture: expected"):
        client.photograph(eye, (0, 0, 0), width=width, height=48)


def test_closing_twice_is_harmless() -> None:
    client = BulletClient()
    client.close()
    client.close()


def test_pose_takes_points_there_and_back() -> None:
    rng = np.random.default_rng(4)
    for _ in range(50):
        quaternion = rng.normal(size=4)
        pose = Pose(rng.normal(size=3), quaternion / np.linalg.norm(quaternion))
        point = rng.normal(size=3)
        np.testing.assert_allclose(pose.matrix @ pose.matrix.T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(pose.inverse_point(pose.point(point)), point, atol=1e-12)
        reference = np.reshape(bullet.getMatrixFromQuaternion(pose.quaternion.tolist()), (3, 3))
        np.testing.assert_allclose(pose.matrix, reference, atol=1e-12)
        np.testing.assert_allclose(cross(point, pose.position), np.cross(point, pose.position))
    assert Pose(np.zeros(3), yaw_quaternion(2.5)).yaw == pytest.approx(2.5)


def test_link_twist_is_the_derivative_of_link_pose() -> None:
    with BulletClient() as client:
        shape = client.api.createCollisionShape(bullet.GEOM_SPHERE, radius=0.05)
        body = client.api.createMultiBody(
            1.0,
            shape,
            basePosition=[0, 0, 3],
            linkMasses=[0.5],
            linkCollisionShapeIndices=[shape],
            linkVisualShapeIndices=[-1],
            linkPositions=[[0.3, 0, 0]],
            linkOrientations=[[0, 0, 0, 1]],
            linkInertialFramePositions=[[0, 0.2, 0]],
            linkInertialFrameOrientations=[[0, 0, 0, 1]],
            linkParentIndices=[0],
            linkJointTypes=[bullet.JOINT_REVOLUTE],
            linkJointAxis=[[0, 0, 1]],
        )
        client.add("arm", body)
        client.api.resetBaseVelocity(body, [0.5, 0.2, 0], [0, 0, 1.0])
        client.api.setJointMotorControl2(body, 0, bullet.VELOCITY_CONTROL, force=0)
        client.api.resetJointState(body, 0, 0.4, 2.0)
        client.step()
        first, twist = client.link_twist("arm", 0)
        client.step()
        second = client.link_pose("arm", 0)
        speed = (second.position - first.position) / client.step_time
        np.testing.assert_allclose(speed, twist.linear, atol=0.05)
        assert (second.yaw - first.yaw) / client.step_time == pytest.approx(twist.angular[2], rel=0.02)


def test_photograph_shows_what_is_there() -> None:
    with BulletClient() as client:
        shape = client.api.createVisualShape(bullet.GEOM_SPHERE, radius=0.3, rgbaColor=[1, 0, 0, 1])
        client.add("ball", client.api.createMultiBody(0, -1, shape, basePosition=[0, 0, 0]))
        picture = client.photograph((2, 0, 0), (0, 0, 0), width=64, height=48)
        assert picture.shape == (48, 64, 3)
        assert picture.dtype == np.uint8
        red, green, _ = picture[24, 32].astype(int)
        assert red > green + 100
        assert picture[2, 2].astype(int).min() > 200, "no ball in the corner"
        above = client.photograph((0, 0, 2), (0, 0, 0), width=64, height=48)
        assert int(above[24, 32, 0]) > int(above[24, 32, 1]) + 100, "looking straight down works too"
