"""The arm with the ball: closed form against Pinocchio, strokes against the arm's own limits."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from pbrl_control.ball_arm import JOINTS, BallArm, Place, Strokes, StrokeSettings
from pbrl_control.errors import ControlError
from pbrl_control.planar import rotation, wrap

URDF = (Path(__file__).resolve().parents[3] / "urdf" / "ball_arm" / "ball_arm.urdf").read_text(encoding="utf-8")
BASE = np.array([0.1, -0.45, math.pi / 2])


@pytest.fixture(scope="module")
def arm() -> BallArm:
    return BallArm(URDF, BASE)


def places(rng: np.random.Generator, arm: BallArm, count: int) -> list[Place]:
    found = []
    for _ in range(count):
        height = rng.uniform(0.0, 0.15)
        near, far = arm.reach(height)
        found.append(Place(rng.uniform(-1.5, 4.5), rng.uniform(near + 0.005, far - 0.005), height))
    return found


def test_joints_bring_the_ball_there_by_pinocchios_reckoning(arm: BallArm) -> None:
    model = pin.buildModelFromXML(URDF)
    data = model.createData()
    for place in places(np.random.default_rng(1), arm, 200):
        joints = arm.joints(place)
        assert ((joints >= arm.lower) & (joints <= arm.upper)).all()
        pin.framesForwardKinematics(model, data, joints)
        ball = data.oMf[model.getFrameId("ball")]
        np.testing.assert_allclose(ball.rotation[:, 2], [0.0, 0.0, 1.0], atol=1e-12)
        there = rotation(BASE[2]) @ ball.translation[:2] + BASE[:2]
        np.testing.assert_allclose(np.append(there, ball.translation[2]), arm.point(place), atol=1e-12)
        again = arm.ball(joints)
        assert (wrap(again.yaw - place.yaw), again.radius, again.height) == pytest.approx(
            (0.0, place.radius, place.height), abs=1e-12
        )


def test_forward_kinematics_holds_with_the_rod_askew(arm: BallArm, rng: np.random.Generator) -> None:
    model = pin.buildModelFromXML(URDF)
    data = model.createData()
    for _ in range(50):
        joints = rng.uniform([-3, 0.3, -2.0, -0.5], [3, 1.2, -0.5, 0.5])
        pin.framesForwardKinematics(model, data, joints)
        ball = data.oMf[model.getFrameId("ball")].translation
        found = arm.ball(joints)
        if found.radius > 0.0:
            assert (found.radius, found.height) == pytest.approx((np.hypot(*ball[:2]), ball[2]))


@pytest.mark.parametrize("radius", [0.0, 0.05, 0.9, 3.0])
def test_out_of_reach_is_told_with_the_reach(arm: BallArm, radius: float) -> None:
    with pytest.raises(ControlError, match=r"expected a place 0.14 to 0.82 m from its column"):
        arm.joints(Place(1.0, radius, 0.015))


def test_a_stroke_is_followed_within_limits_and_pushes_straight(arm: BallArm) -> None:
    strokes = Strokes(arm)
    settings = strokes.settings
    stowed = arm.joints(strokes.stowed)
    path = np.array([[0.05, 0.10], [0.10, 0.13]])
    stroke = strokes.push(stowed, path)
    whole = stroke.then(strokes.stow(stroke.joints[-1]))
    joints = np.vstack((stowed, whole.joints))
    assert (np.abs(np.diff(joints, axis=0)) / whole.period <= arm.velocity + 1e-9).all()
    points = np.array([arm.point(arm.ball(each)) for each in stroke.joints])
    np.testing.assert_allclose(points[-1], [*path[1], settings.low], atol=1e-9)
    low = points[points[:, 2] < settings.low + 1e-6]
    way = (path[1] - path[0]) / np.hypot(*(path[1] - path[0]))
    across = (low[:, :2] - path[0]) @ np.array([-way[1], way[0]])
    np.testing.assert_allclose(across, 0.0, atol=1e-9)
    along = (low[:, :2] - path[0]) @ way
    assert (np.diff(along) >= -1e-9).all()
    assert np.diff(along).max() / whole.period <= settings.push_speed + 1e-6
    np.testing.assert_allclose(whole.joints[-1], stowed, atol=1e-9)
    # It comes down where it begins to push, and is over everything before.
    over = points[: np.flatnonzero(points[:, 2] < settings.height - 1e-6)[0], :2]
    np.testing.assert_allclose(over[-1], path[0], atol=1e-9)


def test_the_column_does_not_turn_past_its_stop(arm: BallArm) -> None:
    strokes = Strokes(arm)
    for x in (-0.2, 0.4):
        stroke = strokes.push(arm.joints(strokes.stowed), np.array([[x, -0.2], [x, -0.15]]))
        assert (stroke.joints[:, 0] >= arm.lower[0]).all()
        assert (stroke.joints[:, 0] <= arm.upper[0]).all()
        assert np.abs(np.diff(stroke.joints[:, 0])).max() < 0.1


def test_what_is_no_arm_and_no_path_is_refused(arm: BallArm) -> None:
    with pytest.raises(ControlError, match="expected URDF text"):
        BallArm("<nothing/>", BASE)
    other = URDF.replace("arm_wrist", "hand")
    with pytest.raises(ControlError, match=f"expected the joints {', '.join(JOINTS)}"):
        BallArm(other, BASE)
    with pytest.raises(ControlError, match="finite base"):
        BallArm(URDF, np.array([0.0, math.nan, 0.0]))
    with pytest.raises(ControlError, match="readable URDF"):
        BallArm.from_file(Path("nowhere.urdf"), BASE)
    strokes = Strokes(arm, StrokeSettings(settle=0.0))
    start = arm.joints(strokes.stowed)
    with pytest.raises(ControlError, match="two finite points"):
        strokes.push(start, np.array([[0.0, 0.0], [np.inf, 0.0]]))
    with pytest.raises(ControlError, match="expected a place"):
        strokes.push(start, np.array([[0.0, 0.0], [5.0, 0.0]]))
    with pytest.raises(ControlError, match="height that it reaches"):
        arm.reach(3.0)
