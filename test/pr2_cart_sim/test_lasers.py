"""Scanners against the geometry of a room."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bullet_sim.client import BulletClient, Pose, yaw_quaternion
from bullet_sim.quiet import bullet
from pr2_cart_sim.lasers import Laser, Nod
from pr2_cart_sim.observations import Scan
from pr2_cart_sim.sensor_settings import LaserSettings, TiltLaserSettings

BOX = (-2.0, -1.5, 3.0, 7.0)  # left, bottom, right, top of the room [m]


@pytest.fixture
def room():
    with BulletClient() as client:
        left, bottom, right, top = BOX
        for x, y, wide, high in (
            (left - 0.5, 0, 0.5, 20),
            (right + 0.5, 0, 0.5, 20),
            (0, bottom - 0.5, 20, 0.5),
            (0, top + 0.5, 20, 0.5),
        ):
            shape = client.api.createCollisionShape(bullet.GEOM_BOX, halfExtents=[wide, high, 1.0])
            client.api.createMultiBody(0, shape, basePosition=[x, y, 0.0])
        yield client


def exact(place: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Ranges [m] to the walls of `BOX` from inside."""
    left, bottom, right, top = BOX
    c, s = np.cos(angles), np.sin(angles)
    with np.errstate(divide="ignore"):
        x = np.where(c > 0, (right - place[0]) / c, (left - place[0]) / c)
        y = np.where(s > 0, (top - place[1]) / s, (bottom - place[1]) / s)
    return np.minimum(np.where(c == 0, np.inf, x), np.where(s == 0, np.inf, y))


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (1.0, 5.0, 2.1)])
def test_ranges_are_those_of_the_room(room, pose):
    laser = Laser(room, LaserSettings(noise=0.0, increment=0.02), np.random.default_rng(1))
    x, y, theta = pose
    ranges = laser.scan(Pose(np.array([x, y, 0.3]), yaw_quaternion(theta)))
    angles = theta + laser.angle_min + 0.02 * np.arange(len(ranges))
    np.testing.assert_allclose(ranges, exact(np.array([x, y]), angles), atol=1e-4)


def test_nothing_within_reach_is_infinite_and_farther_than_reach_too(room):
    laser = Laser(room, LaserSettings(noise=0.0, increment=0.05, range_max=2.5), np.random.default_rng(1))
    ranges = laser.scan(Pose(np.array([0.0, 0.0, 0.3]), yaw_quaternion(0.0)))
    true = exact(np.zeros(2), laser.angle_min + 0.05 * np.arange(len(ranges)))
    assert np.array_equal(np.isinf(ranges), true > 2.5)
    high = laser.scan(Pose(np.array([0.0, 0.0, 5.0]), yaw_quaternion(0.0)))
    assert np.isinf(high).all()


def test_noise_has_the_standard_deviation_that_was_asked_for(room):
    laser = Laser(room, LaserSettings(noise=0.02, increment=0.01), np.random.default_rng(1))
    pose = Pose(np.array([0.0, 0.0, 0.3]), yaw_quaternion(0.0))
    ranges = np.array([laser.scan(pose) for _ in range(10)])
    true = exact(np.zeros(2), laser.angle_min + 0.01 * np.arange(ranges.shape[1]))
    assert (ranges - true).std() == pytest.approx(0.02, rel=0.05)
    assert abs((ranges - true).mean()) < 0.002


def test_beams_are_those_of_a_utm_30lx():
    settings = LaserSettings()
    assert abs(settings.beams - 1041) <= 2  # 2.2689 rad is a hair less than 130 degrees
    assert settings.range_max == 30.0


def test_scan_gives_points_in_its_frame():
    ranges = np.array([1.0, np.inf, 2.0])
    scan = Scan(0.0, "base", "base_laser_link", -math.pi / 2, math.pi / 2, 0.05, (0.1, 30.0), ranges, 0.0)
    np.testing.assert_allclose(scan.points(), [[0, -1], [0, 2]], atol=1e-12)


def test_the_robot_is_in_nobodys_way_unless_it_shall_be(make_scene, make_session, run):
    nearest = {}
    for sees in (False, True):
        sensors = {"tilt_laser": {"increment": 0.02, "half_angle": 2.2, "sees_robot": sees, "noise": 0.0}}
        session = make_session(make_scene(bodies={}, sensors=sensors))
        scans = [one for one in run(session, 0.2) if isinstance(one, Scan) and one.laser == "tilt"]
        nearest[sees] = min(float(scan.ranges.min()) for scan in scans)
    assert nearest[True] < 0.5 < nearest[False]


def test_base_laser_sees_the_cart_and_the_tilting_one_the_floor(make_scene, make_session, run):
    session = make_session(
        make_scene(sensors={"base_laser": {"noise": 0.0, "rate": 2.0}, "tilt_laser": {"noise": 0.0, "period": 1.6}})
    )
    seen = [one for one in run(session, 0.6) if isinstance(one, Scan)]
    base = next(one for one in seen if one.laser == "base")
    x, y = base.points().T
    assert ((x > 0.3) & (x < 1.5) & (np.abs(y) < 0.3)).any()  # posts and casters in front
    low = max((one for one in seen if one.laser == "tilt"), key=lambda one: one.tilt)
    height = 1.144 + 0.144
    floor = height / math.sin(low.tilt)
    assert low.tilt > 0.7
    assert np.abs(low.ranges[np.isfinite(low.ranges)] - floor).min() < 0.05


def test_nodding_turns_back_at_both_ends():
    settings = TiltLaserSettings(low=1.0, high=-0.2, period=2.0)
    nod, angle, seen = Nod(settings), 0.0, []
    for _ in range(800):
        angle += nod.rate(angle) / 400
        seen.append(angle)
    assert max(seen) == pytest.approx(1.0, abs=0.01)
    assert min(seen) == pytest.approx(-0.2, abs=0.01)
    assert sum(abs(np.diff(seen))) == pytest.approx(2.4, rel=0.01)  # 1.2 rad down and up in 2 s
