"""Stops: a thing goes as far as a line, in closed form, and no further; where it stands past it, not further still."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrl_control.planar import compose
from pbrl_namo.beliefs import Stop
from pbrl_namo.beliefs.stops import SAMPLES, reach
from pbrl_namo.errors import NamoError
from pbrl_namo.manipulation.plane_kernel import moved

EAST = np.array([1.0, 0.0])
CORNER = np.array([0.5, 0.5])
STRAIGHT, TURN = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


def far(stops: list[Stop], pose: np.ndarray, twist: np.ndarray, end: float = 2.0) -> float:
    return float(reach(stops, pose, twist[None], np.array([end]))[0])


def test_a_straight_way_ends_at_the_line() -> None:
    went = far([Stop(CORNER, EAST, 1.2)], np.zeros(3), STRAIGHT)
    assert 0.7 - 2.0 / SAMPLES <= went <= 0.7 + 1e-9


def test_a_turn_ends_where_the_corner_gets_to_the_line() -> None:
    """From 45 degrees the corner swings clockwise to the east: at angle a it is at 0.707 cos(a)."""
    level = math.sqrt(0.5) * math.cos(math.radians(20.0))
    went = far([Stop(CORNER, EAST, level)], np.zeros(3), -TURN)
    assert math.radians(25.0) - 2.0 / SAMPLES <= went <= math.radians(25.0) + 1e-9
    assert far([Stop(CORNER, EAST, level)], np.zeros(3), TURN) == 2.0


def test_past_the_line_it_goes_back_and_along_but_not_on() -> None:
    stop = [Stop(CORNER, EAST, 0.3)]
    assert far(stop, np.zeros(3), STRAIGHT) == 0.0
    assert far(stop, np.zeros(3), -STRAIGHT) == 2.0
    assert far(stop, np.zeros(3), np.array([0.0, 1.0, 0.0])) == 2.0


def test_without_stops_everything_is_followed_to_its_end() -> None:
    assert far([], np.zeros(3), STRAIGHT) == 2.0


@pytest.mark.parametrize("seed", range(5))
def test_it_is_the_same_in_every_frame_and_no_place_on_the_way_is_past_the_line(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pose, twist = rng.normal(size=3), rng.normal(size=3)
    angle = rng.uniform(-math.pi, math.pi)
    stop = Stop(rng.normal(size=2), np.array([math.cos(angle), math.sin(angle)]), 0.0)
    stop = Stop(stop.point, stop.direction, float(stop.beyond(pose)) + 0.2)
    went = far([stop], pose, twist)
    for share in np.linspace(0.0, 1.0, 20):
        there = np.empty(3)
        moved(pose, twist, share * went, there)
        assert stop.beyond(there) <= 1e-3
    frame = rng.normal(size=3)
    direction = np.array([math.cos(angle + frame[2]), math.sin(angle + frame[2])])
    turned = Stop(stop.point, direction, 0.0)
    turned = Stop(stop.point, direction, float(turned.beyond(compose(frame, pose))) + 0.2)
    np.testing.assert_allclose(far([turned], compose(frame, pose), twist), went, atol=1e-9)


@pytest.mark.parametrize(
    ("point", "direction", "level"),
    [
        (np.array([math.nan, 0.0]), EAST, 0.0),
        (np.zeros(2), np.array([1.0, 1.0]), 0.0),
        (np.zeros(2), np.zeros(2), 0.0),
        (np.zeros(3), EAST, 0.0),
        (np.zeros(2), EAST, math.inf),
    ],
)
def test_what_is_no_line_is_refused(point: np.ndarray, direction: np.ndarray, level: float) -> None:
    with pytest.raises(NamoError, match="stop: expected"):
        Stop(point, direction, level)
