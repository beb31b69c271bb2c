"""Trapezoids: bounds are kept, ends are at rest, speed and acceleration are derivatives."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrl_control.errors import ControlError
from pbrl_control.trajectories.timing import Trapezoid


@pytest.mark.parametrize(("distance", "duration"), [(1.0, 1.0 / 0.2 + 0.2 / 0.1), (0.1, 2.0 * math.sqrt(0.1 / 0.1))])
def test_duration_is_that_of_the_textbook(distance: float, duration: float) -> None:
    assert Trapezoid(distance, 0.2, 0.1).duration == pytest.approx(duration)


def test_derivatives_and_bounds(rng: np.random.Generator) -> None:
    for _ in range(20):
        profile = Trapezoid(*rng.uniform(0.05, 2.0, size=3))
        times = np.linspace(-0.1, profile.duration + 0.1, 2001)
        way, speed, change = np.array([profile.at(float(time)) for time in times]).T
        assert (np.diff(way) >= -1e-15).all()
        assert speed.max() <= profile.speed + 1e-12
        assert np.abs(change).max() <= profile.acceleration + 1e-12
        np.testing.assert_allclose(
            np.gradient(way, times), speed, atol=0.5 * (times[1] - times[0]) * profile.acceleration
        )
        assert way[0] == 0.0
        assert way[-1] == profile.distance
        assert speed[0] == speed[-1] == 0.0


def test_no_way_takes_no_time() -> None:
    assert Trapezoid(0.0, 1.0, 1.0).duration == 0.0
    assert Trapezoid(0.0, 1.0, 1.0).at(0.0) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("numbers", [(-1.0, 1.0, 1.0), (1.0, 0.0, 1.0), (1.0, 1.0, -1.0), (math.nan, 1.0, 1.0)])
def test_hostile_numbers_are_refused(numbers: tuple[float, float, float]) -> None:
    with pytest.raises(ControlError, match="timing: expected"):
        Trapezoid(*numbers)
