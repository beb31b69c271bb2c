"""Where the base is, from odometry that drifts and tags that are late and noisy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from floor_cases import wrapped

from pbrl_control.kinematics import SIDES, Posture, RobotKinematics
from pbrl_control.localizer import BaseLocalizer, LocalizerSettings
from pbrl_control.percept import Tag
from pbrl_control.planar import compose
from pbrl_control.settings import ControllerSettings

STOWED = np.array(ControllerSettings().stowed)
POSTURE = Posture(2.732, 0.0, STOWED, -STOWED)
START = np.array([1.0, -2.0, 2.5])


def tag_of(
    kinematics: RobotKinematics, base: np.ndarray, side: str, time: float, noise: np.ndarray | None = None
) -> Tag:
    """Return a gripper's tag as seen with the base at (3,) in `world`; noise is x, y [m], yaw [rad]."""
    yaw = base[2] + (0.0 if noise is None else noise[2])
    frame = kinematics.frame(POSTURE, f"{side}_ft")
    exact = compose(base, np.array([*frame.position[:2], 0.0]))[:2]
    half = np.array([0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0)])
    q = frame.quaternion()
    vector = half[3] * q[:3] + q[3] * half[:3] + np.cross(half[:3], q[:3])
    position = np.array([*(exact + (0.0 if noise is None else noise[:2])), frame.position[2]])
    return Tag(time, position, np.array([*vector, half[3] * q[3] - half[:3] @ q[:3]]))


def away(pose: np.ndarray | None, truth: np.ndarray) -> tuple[float, float]:
    assert pose is not None
    return float(np.hypot(*(pose - truth)[:2])), abs(wrapped(pose[2] - truth[2]))


@pytest.mark.parametrize("side", SIDES)
def test_one_tag_tells_where_the_base_is(kinematics: RobotKinematics, side: str, rng: np.random.Generator) -> None:
    for base in rng.uniform(-3.0, 3.0, (20, 3)):
        localizer = BaseLocalizer(kinematics)
        localizer.odometry(0.0, np.array([0.4, -0.3, 1.0]))
        localizer.tag(side, tag_of(kinematics, base, side, 0.0), POSTURE)
        position, yaw = away(localizer.pose(0.0), base)
        assert position < 1e-9
        assert yaw < 1e-9


def test_drifting_odometry_and_late_noisy_tags_give_a_centimetre_and_half_a_degree(
    kinematics: RobotKinematics, rng: np.random.Generator
) -> None:
    """A quarter turn a second that odometry overrates by 3 %, then a rest; tags at 15 Hz, 80 ms late."""
    localizer, truth, odom, late = BaseLocalizer(kinematics), START.copy(), np.zeros(3), []
    worst = []
    for i in range(600):
        now, omega = 0.01 * i, 0.5 if i < 400 else 0.0
        truth[2] += 0.01 * omega
        odom[2] += 0.0103 * omega
        localizer.odometry(now, odom)
        if i % 7 == 0:
            late += [
                (now + 0.08, s, tag_of(kinematics, truth, s, now, rng.normal(size=3) * [3e-3, 3e-3, 8.7e-3]))
                for s in SIDES
            ]
        while late and late[0][0] <= now:
            _, side, tag = late.pop(0)
            localizer.tag(side, tag, POSTURE)
        if i > 500:
            worst.append(away(localizer.pose(now), truth))
    assert abs(odom[2] - 2.0) > math.radians(3.0), "odometry alone is off by more"
    position, yaw = np.max(worst, axis=0)
    assert position < 0.01
    assert yaw < math.radians(0.5)


def test_a_pose_is_lost_without_fresh_odometry_or_tags(kinematics: RobotKinematics) -> None:
    localizer = BaseLocalizer(kinematics)
    assert localizer.pose(0.0) is None
    assert "odometry" in localizer.fault(0.0)
    localizer.odometry(0.0, np.zeros(3))
    assert "gripper tags" in localizer.fault(0.0)
    frozen = tag_of(kinematics, START, "left", 0.0)
    for i in range(200):
        localizer.odometry(0.01 * i, np.zeros(3))
        localizer.tag("left", frozen, POSTURE)  # a stream that repeats its last tag is no stream
        assert (localizer.pose(0.01 * i) is not None) == (i <= 100)
    assert "gripper tags" in localizer.fault(1.99)
    localizer.tag("right", tag_of(kinematics, START, "right", 1.99), POSTURE)
    assert localizer.fault(1.99) == ""
    assert "odometry" in localizer.fault(2.5)


@pytest.mark.parametrize("bad", ["nan tag", "jump", "nan odometry", "old odometry", "tag of the future"])
def test_what_cannot_be_true_changes_nothing(kinematics: RobotKinematics, bad: str) -> None:
    localizer = BaseLocalizer(kinematics)
    for i in range(50):
        localizer.odometry(0.01 * i, np.array([0.01 * i, 0.0, 0.0]))
    localizer.tag("left", tag_of(kinematics, START, "left", 0.4), POSTURE)
    before = localizer.pose(0.5)
    match bad:
        case "nan tag":
            localizer.tag("left", Tag(0.45, np.full(3, np.nan), np.array([0, 0, 0, 1.0])), POSTURE)
        case "jump":
            localizer.tag("left", tag_of(kinematics, START + 1.0, "left", 0.45), POSTURE)
        case "nan odometry":
            localizer.odometry(0.5, np.array([np.nan, 0.0, 0.0]))
        case "old odometry":
            localizer.odometry(0.2, np.array([5.0, 0.0, 0.0]))
        case _:
            localizer.tag("left", tag_of(kinematics, START, "left", 7.0), POSTURE)
    np.testing.assert_array_equal(localizer.pose(0.5), before)


def test_longer_smoothing_listens_less_to_a_tag(kinematics: RobotKinematics) -> None:
    moved = []
    for smoothing in (0.1, 0.4, 2.0):
        localizer = BaseLocalizer(kinematics, LocalizerSettings(smoothing=smoothing))
        for i in range(20):
            localizer.odometry(0.01 * i, np.zeros(3))
        localizer.tag("left", tag_of(kinematics, START, "left", 0.0), POSTURE)
        localizer.tag("left", tag_of(kinematics, START + np.array([0.1, 0.0, 0.0]), "left", 0.1), POSTURE)
        moved.append(away(localizer.pose(0.19), START)[0])
    np.testing.assert_allclose(moved, 0.1 * (1.0 - np.exp(-0.1 / np.array([0.1, 0.4, 2.0]))), rtol=1e-6)


@pytest.mark.parametrize("back", [5.0, 1.5])
def test_a_pose_from_before_a_clock_was_set_back_is_lost_until_there_is_another(
    kinematics: RobotKinematics, back: float
) -> None:
    localizer, elsewhere = BaseLocalizer(kinematics), START + np.array([2.0, 0.0, 0.0])
    for i in range(1000):
        localizer.odometry(0.01 * i, np.zeros(3))
        localizer.tag("left", tag_of(kinematics, START, "left", 0.01 * i), POSTURE)
    assert localizer.pose(10.0) is not None
    again = 10.0 - back
    assert localizer.fault(again)
    there = elsewhere if back > 2.0 else START
    for i in range(300):
        localizer.odometry(again + 0.01 * i, np.zeros(3))
        localizer.tag("left", tag_of(kinematics, there, "left", again + 0.01 * i), POSTURE)
    position, _ = away(localizer.pose(again + 3.0), there)
    assert position < 1e-6
