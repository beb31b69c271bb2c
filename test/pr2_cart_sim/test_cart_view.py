"""Where the cart is by hands and checkerboard, against the truth; odometry against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bullet_sim.bristle import wrap
from pr2_cart_sim.cart_view import pose_from_points
from pr2_cart_sim.checkerboard import find_board
from pr2_cart_sim.observations import CartReading
from pr2_cart_sim.reckoning import Localiser, Odometry
from pr2_cart_sim.scene import with_board
from pr2_cart_sim.sensing import in_base
from pr2_cart_sim.sensor_settings import BoardSettings, LocalisationSettings, OdometrySettings

SMALL = st.floats(-3.0, 3.0)


@given(SMALL, SMALL, st.floats(-math.pi, math.pi), st.lists(st.tuples(SMALL, SMALL), min_size=2, max_size=5))
def test_points_of_a_moved_body_give_its_pose(x, y, theta, places):
    held = np.array(places)
    if np.hypot(*(held - held.mean(axis=0)).T).max() < 1e-3:
        return
    turn = np.array([[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]])
    pose, misfit = pose_from_points(held, held @ turn.T + [x, y])
    np.testing.assert_allclose(pose[:2], [x, y], atol=1e-6)
    assert abs(wrap(pose[2] - theta)) < 1e-6
    assert misfit < 1e-6


def test_hands_that_drift_apart_show_as_misfit():
    _, misfit = pose_from_points(np.array([[0.0, -0.25], [0.0, 0.25]]), np.array([[0.0, -0.27], [0.0, 0.27]]))
    assert misfit == pytest.approx(0.02)


def test_a_rendered_checkerboard_is_found_where_it_is(make_scene, make_session, run):
    scene = with_board(make_scene(sensors={"checkerboard": {"bias": 0.0, "latency": 0.0, "rate": 10.0}}), "rendered")
    session = make_session(scene)
    seen = [one for one in run(session, 0.25) if isinstance(one, CartReading) and one.source == "checkerboard"]
    true = in_base(session.robot.base_pose(), session.office.world.pose("cart"))
    assert len(seen) >= 2
    for reading in seen:
        assert np.hypot(*(reading.pose - true)[:2]) < 0.01
        assert abs(wrap(reading.pose[2] - true[2])) < 0.02


def test_no_board_in_the_picture_is_none():
    assert find_board(np.full((120, 160), 200, np.uint8), np.diag([100.0, 100.0, 1.0]), BoardSettings()) is None


def test_a_board_out_of_view_is_not_read(make_scene, make_session, run):
    session = make_session(make_scene(sensors={"checkerboard": {"dropout": 0.0, "latency": 0.0}}))
    run(session, 0.6, lambda: session.command_head(3.0, 0.0))
    late = [one for one in run(session, 0.3) if isinstance(one, CartReading) and one.source == "checkerboard"]
    assert late == []


def test_odometry_without_faults_is_the_truth():
    faultless = OdometrySettings(scale=0, turn_scale=0, noise=0, turn_noise=0)
    odometry = Odometry(faultless, np.array([1.0, 2.0, 0.5]), np.random.default_rng(1))
    for k in range(1, 2001):
        angle = 2 * math.pi * k / 2000  # a circle of 1 m, facing its middle all the way
        true = np.array([1.0 + math.cos(angle) - 1.0, 2.0 + math.sin(angle), 0.5 + angle])
        odometry.update(k * 0.02, true)
    np.testing.assert_allclose(odometry.pose, [0, 0, 2 * math.pi], atol=1e-4)
    assert odometry.twist[2] == pytest.approx(2 * math.pi / 40, rel=1e-3)
    assert math.hypot(*odometry.twist[:2]) == pytest.approx(2 * math.pi / 40, rel=1e-3)


def test_odometry_drifts_with_the_way_and_stands_still_at_rest():
    errors = []
    for seed in range(60):
        odometry = Odometry(OdometrySettings(), np.zeros(3), np.random.default_rng(seed))
        for k in range(1, 201):
            odometry.update(k * 0.1, np.array([0.05 * k, 0.0, 0.0]))
        at_end = odometry.pose.copy()
        odometry.update(30.0, np.array([10.0, 0.0, 0.0]))
        np.testing.assert_array_equal(odometry.pose, at_end)
        errors.append(at_end[0] - 10.0)
    assert np.std(errors) == pytest.approx(math.hypot(10.0 * 0.01, 0.004 * math.sqrt(10.0)), rel=0.3)


def test_localisation_comes_late_and_is_unbiased_without_a_field():
    settings = LocalisationSettings(bias=0.0, latency=0.1, rate=10.0)
    localiser = Localiser(settings, np.random.default_rng(1))
    readings, delays = [], []
    for k in range(4000):
        time = k * 0.01
        for reading, reckoned in localiser.measure(time, np.array([time, 0.0, 0.0]), np.array([0.9 * time, 0.0, 0.0])):
            assert reckoned[0] == 0.9 * reading.time
            readings.append(reading.pose - [reading.time, 0.0, 0.0])
            delays.append(time - reading.time)
    np.testing.assert_allclose(delays, 0.1, atol=1e-6)
    np.testing.assert_allclose(np.std(readings, axis=0), [0.01, 0.01, 0.005], rtol=0.15)
