"""Trajectories: they pass where they were told to, within limits, and twists are the derivatives of poses."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from pbrl_control.constraints.classes import ModelClass, classify
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.errors import ControlError
from pbrl_control.planar import compose, inverse, shift, turn, wrap
from pbrl_control.trajectories.achievable import achievable_trajectory, peak_grip_force
from pbrl_control.trajectories.trajectory import MotionLimits, ObjectTrajectory, Trajectory, between, move
from pbrl_model.parameters import BodyParameters

LIMITS = MotionLimits()
TABLE = np.array([[-0.375, -0.75], [0.375, -0.75], [0.375, 0.75], [-0.375, 0.75]])
CASTER = np.array([-0.315, -0.69])
CONTACT = np.array([[-0.355, 0.40]])


def locked(**more: float) -> ObjectModel:
    wheel = {"wheel_x": CASTER[0], "wheel_y": CASTER[1], "mu_x": 0.175, "mu_y": 0.175}
    return ObjectModel.uniform(BodyParameters(mass=33.0, **wheel, **more), TABLE)


def samples(trajectory: Trajectory, count: int = 4001) -> tuple[np.ndarray, ...]:
    times = np.linspace(0.0, trajectory.duration, count)
    points = [trajectory.at(float(time)) for time in times]
    return (times, *(np.array([getattr(point, name) for point in points]) for name in ("pose", "twist", "rate")))


def random_trajectory(rng: np.random.Generator) -> ObjectTrajectory:
    waypoints = rng.uniform(-1.0, 1.0, size=(3, 3)) * [1.0, 1.0, 2.5]
    return ObjectTrajectory.through(rng.uniform(-1.0, 1.0, size=3), list(waypoints), LIMITS)


def test_screws_there_and_back(rng: np.random.Generator) -> None:
    for _ in range(50):
        a, b = rng.uniform(-3.0, 3.0, size=(2, 3))
        np.testing.assert_allclose(move(a, between(a, b)), b, atol=1e-9)


def test_a_screw_is_an_arc_of_the_textbook() -> None:
    np.testing.assert_allclose(move(np.zeros(3), np.array([math.pi / 2, 0.0, math.pi / 2])), [1, 1, math.pi / 2])
    np.testing.assert_allclose(move(np.zeros(3), np.array([0.3, -0.1, 0.0])), [0.3, -0.1, 0.0])


def test_it_stops_at_each_waypoint_and_nowhere_else_is_a_jump(rng: np.random.Generator) -> None:
    start, points = np.array([1.0, -0.2, 0.4]), [np.array([1.5, 0.1, 0.4]), np.array([1.5, 0.1, -0.5])]
    trajectory = ObjectTrajectory.through(start, points, LIMITS)
    np.testing.assert_allclose(trajectory.start, start)
    np.testing.assert_allclose(trajectory.end, points[-1], atol=1e-12)
    corner = trajectory.at(trajectory.pieces[0].timing.duration)
    np.testing.assert_allclose(corner.pose, points[0], atol=1e-12)
    assert not corner.twist.any()
    poses = samples(trajectory)[1]
    assert np.abs(np.diff(poses, axis=0)).max() < 1e-3


def test_twists_and_rates_are_derivatives_within_the_limits(rng: np.random.Generator) -> None:
    for _ in range(5):
        times, poses, twists, rates = samples(random_trajectory(rng))
        dt = times[1] - times[0]
        moved = np.array([compose(inverse(a), b) for a, b in itertools.pairwise(poses)]) / dt
        assert np.abs(moved - (twists[1:] + twists[:-1]) / 2).max() < 2e-3
        changed = np.abs(np.diff(twists, axis=0) / dt - (rates[1:] + rates[:-1]) / 2).max(axis=1)
        assert (changed > 1e-6).sum() <= 4 * 3, "but where a ramp begins or ends"
        for values, line, yaw in ((twists, LIMITS.speed, LIMITS.yaw_rate), (rates, LIMITS.acceleration, 0.25)):
            assert np.hypot(values[:, 0], values[:, 1]).max() <= line + 1e-9
            assert np.abs(values[:, 2]).max() <= yaw + 1e-9


def test_constant_twists_cover_twist_times_duration() -> None:
    twists, durations = np.array([[0.1, 0.0, 0.2], [0.0, -0.1, 0.0]]), np.array([3.0, 2.0])
    trajectory = ObjectTrajectory.of_twists(np.zeros(3), twists, durations, LIMITS)
    corner = trajectory.at(trajectory.pieces[0].timing.duration).pose
    np.testing.assert_allclose(corner, move(np.zeros(3), 3.0 * twists[0]), atol=1e-12)
    np.testing.assert_allclose(trajectory.end, move(corner, 2.0 * twists[1]), atol=1e-12)
    np.testing.assert_allclose(np.abs(samples(trajectory)[2]).max(axis=0), [0.1, 0.1, 0.2])


def test_a_frame_of_the_world_does_not_matter(rng: np.random.Generator) -> None:
    frame, start, point = rng.uniform(-1.0, 1.0, size=(3, 3))
    here = ObjectTrajectory.through(start, [point], LIMITS)
    there = ObjectTrajectory.through(compose(frame, start), [compose(frame, point)], LIMITS)
    assert there.duration == pytest.approx(here.duration)
    np.testing.assert_allclose(there.at(1.0).pose, compose(frame, here.at(1.0).pose), atol=1e-12)


@pytest.mark.parametrize(
    ("twists", "durations", "complaint"),
    [
        ([[0.3, 0.0, 0.0]], [1.0], "at most 0.15 m/s"),
        ([[0.0, 0.0, 0.4]], [1.0], "got 0.000 m/s and 0.400 rad/s"),
        ([[0.0, 0.0, 0.0]], [1.0], "twists that move"),
        ([[0.1, 0.0, 0.0]], [-1.0], "durations above zero"),
        ([], [], "at least one"),
    ],
)
def test_hostile_twists_are_refused(twists: list, durations: list, complaint: str) -> None:
    with pytest.raises(ControlError, match=complaint):
        ObjectTrajectory.of_twists(np.zeros(3), np.array(twists), np.array(durations), LIMITS)


def test_hostile_poses_are_refused() -> None:
    for start, points in ((np.full(3, math.nan), [np.zeros(3)]), (np.zeros(3), [np.full(3, math.inf)])):
        with pytest.raises(ControlError, match="finite poses"):
            ObjectTrajectory.through(start, points, LIMITS)
    with pytest.raises(ControlError, match="at least one"):
        ObjectTrajectory.through(np.zeros(3), [], LIMITS)


def test_what_is_free_is_achieved_as_wanted(rng: np.random.Generator) -> None:
    wanted = random_trajectory(rng)
    free = ObjectModel.uniform(BodyParameters(mass=33.0), TABLE)
    achieved = achievable_trajectory(wanted, free)
    for time in (0.5, 2.0, wanted.duration):
        np.testing.assert_allclose(achieved.at(time).pose, wanted.at(time).pose, atol=2e-4)


def test_pushed_straight_with_a_corner_locked_it_turns_about_the_corner() -> None:
    start = np.array([1.19, -0.25, 0.3])
    wanted = ObjectTrajectory.through(start, [compose(start, np.array([0.5, 0.0, 0.0]))], LIMITS)
    achieved = achievable_trajectory(wanted, locked())
    corner = np.array([compose(pose, np.array([*CASTER, 0.0]))[:2] for pose in achieved.poses])
    assert np.abs(corner - corner[0]).max() < 1e-9
    assert wrap(achieved.poses[-1, 2] - 0.3) < -0.3
    assert not achieved.twists[-1].any()


def test_about_its_corner_it_is_achieved_as_wanted() -> None:
    about = shift(np.array([0.0, 0.0, -0.18]), -CASTER)
    wanted = ObjectTrajectory.of_twists(np.zeros(3), about[None], np.array([3.0]), LIMITS)
    achieved = achievable_trajectory(wanted, locked())
    np.testing.assert_allclose(achieved.at(100.0).pose, wanted.end, atol=2e-4)
    assert peak_grip_force(wanted, locked(mu_ground=0.02), CONTACT) < 12.0


def test_a_static_object_stays() -> None:
    heavy = ObjectModel.uniform(BodyParameters(mass=400.0, mu_ground=0.5), TABLE)
    assert classify(heavy) == ModelClass.STATIC
    wanted = ObjectTrajectory.through(np.zeros(3), [np.array([0.5, 0.0, 0.0])], LIMITS)
    assert not achievable_trajectory(wanted, heavy).poses.any()


def test_peak_force_of_a_straight_push() -> None:
    model = ObjectModel.uniform(BodyParameters(mass=33.0, mu_ground=0.05), TABLE)
    wanted = ObjectTrajectory.through(np.zeros(3), [np.array([0.5, 0.0, 0.0])], LIMITS)
    pair = np.array([[-0.355, 0.16], [-0.355, -0.16]])
    whole = 33.0 * 0.15 + 0.05 * 33.0 * 9.81
    assert peak_grip_force(wanted, model, pair) == pytest.approx(whole / 2)
    turned = ObjectTrajectory.through(np.array([0.0, 0.0, 2.0]), [turn(np.array([0.5, 0.0, 2.0]), 0.0)], LIMITS)
    assert peak_grip_force(turned, model, pair) == pytest.approx(peak_grip_force(turned, model, pair[::-1]))
