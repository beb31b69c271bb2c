"""What one trailing caster resists, against a wheel that rolls."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.kernels.friction_kernel import FOOT
from pbrl_mismatch.kernels.laws_kernel import roll_on, swivel


def test_a_caster_s_bearing_rubs_by_how_much_faster_than_the_body_its_fork_turns() -> None:
    # A body that turns about a point takes trailing forks along: their bearings do not move.
    row, omega, trail = neutral_row(), 0.4, 0.03
    row[[COLUMN["caster_trail"], COLUMN["caster_scrub"]]] = trail, 0.05
    pivot, centre = np.array([0.3, -0.2]), np.array([1.1, 0.4])
    velocity = omega * np.array([-(pivot - centre)[1], (pivot - centre)[0]])
    # The wheel rolls where its axle points to the centre of the turn.
    angle = math.asin(trail * omega / math.hypot(*velocity))
    heading = math.atan2(velocity[1], velocity[0]) - angle
    twist = np.array([*(velocity - omega * np.array([-pivot[1], pivot[0]])), omega])
    still = felt(row, math.cos(heading), math.sin(heading), twist, velocity)
    np.testing.assert_allclose(still, 0.0, atol=1e-9)
    rubbing = felt(row, math.cos(heading + 0.5), math.sin(heading + 0.5), twist, velocity)
    assert np.hypot(*rubbing[:2]) == pytest.approx(5.0, rel=1e-3)


@pytest.mark.parametrize(("angle", "share"), [(1.2, 1.0), (0.3, 0.5 * math.tan(0.3))])
def test_a_tread_that_rolls_while_it_turns_is_twisted_less(angle: float, share: float) -> None:
    row = neutral_row()
    row[[COLUMN["caster_trail"], COLUMN["caster_twist"], COLUMN["caster_lay"]]] = 0.03, 0.05, 0.015
    velocity = 0.2 * np.array([math.cos(angle), math.sin(angle)])
    force = felt(row, 1.0, 0.0, np.array([*velocity, 0.0]), velocity)
    np.testing.assert_allclose(force[:2], [0.0, 5.0 * min(share, 1.0)], atol=1e-2)


@pytest.mark.parametrize("heading", [-3.0, -1.5, 0.0, 1e-9, 2.0, 3.14])
def test_a_caster_turns_as_its_equation_of_motion_says(heading: float) -> None:
    # Rolling without slip, the fork turns by the sine of what is left to turn, for each trail of way.
    way, steps = 0.7, 20000
    left = math.remainder(-heading, 2.0 * math.pi)
    for _ in range(steps):
        left -= math.sin(left) * way / steps
    ex, ey = swivel(math.cos(heading), math.sin(heading), 1.0, 0.0, way)
    assert math.hypot(ex, ey) == pytest.approx(1.0)
    assert math.remainder(math.atan2(ey, ex) + left, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-3)
    again = swivel(*swivel(math.cos(heading), math.sin(heading), 1.0, 0.0, 0.3), 1.0, 0.0, way - 0.3)
    np.testing.assert_allclose(again, (ex, ey), atol=1e-5)


def test_a_caster_that_is_pulled_straight_backwards_turns_over() -> None:
    np.testing.assert_allclose(swivel(-1.0, 0.0, 1.0, 0.0, 20.0), (1.0, 0.0), atol=1e-4)


def felt(row: np.ndarray, ex: float, ey: float, twist: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Return the wrench with which a caster under 100 N resists."""
    acc, room = np.zeros(9), np.zeros((1, FOOT))
    room[0, :6] = 0.3, -0.2, 0.0, 100.0, ex, ey
    roll_on(row, room, 0, *velocity, twist[2], True, acc)
    xx, xy, yy, xt, yt, tt = acc[3:]
    return np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]]) @ twist - acc[:3]
