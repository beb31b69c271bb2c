"""Dry friction of many contacts in one implicit step, against what crawls to the same answer."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrl_mismatch.kernels.account_kernel import CREEP
from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.kernels.friction_kernel import FOOT
from pbrl_mismatch.kernels.state import STATE
from pbrl_mismatch.kernels.step_kernel import fixed_axes, respond
from pbrl_model.kernel import GRAVITY

MASS, INERTIA = 30.0, 6.0
FEET = np.array([[0.5, 0.3], [0.5, -0.3], [-0.5, 0.3], [-0.5, -0.3]])
WHEEL, TURN = np.array([0.2, 0.1]), 0.7
STILL = np.array([0.0, 0.0, 0.0])


def stepped(
    mu: float,
    wheel: tuple[float, float],
    twist: np.ndarray,
    wrench: np.ndarray,
    dt: float,
    which: str = "wheel2",
    cone: float = 1.0,
) -> np.ndarray:
    """Return the twist (3,) after a step of the kernel; the body's axes are the world's."""
    row, limits = neutral_row(), ("mu_x", "mu_y") if which == "wheel" else ("wheel2_mu_x", "wheel2_mu_y")
    row[[COLUMN["slide_mu"], *(COLUMN[each] for each in limits), COLUMN["cone"]]] = mu, *wheel, cone
    row[[COLUMN[f"{which}_x"], COLUMN[f"{which}_y"], COLUMN[f"{which}_theta"]]] = *WHEEL, TURN
    state, acc, axes, room = np.zeros(STATE), np.zeros(9), np.empty(7), np.empty((len(FEET) + 2, FOOT))
    state[3:6], acc[:3] = twist, wrench
    fixed_axes(row, dt, axes)
    respond(row, state, 1.0, 0.0, MASS, INERTIA, np.zeros(2), FEET, axes, state[3:6], acc, room, dt)
    return state[3:6]


def crawled(mu: float, wheel: tuple[float, float], twist: np.ndarray, wrench: np.ndarray, dt: float) -> np.ndarray:
    """Return the same by taking friction as a resistance at the speed of the iteration before, thousands of times."""
    masses = np.diag([MASS, MASS, INERTIA])
    levers = [np.array([[1.0, 0.0, -y], [0.0, 1.0, x]]) for x, y in (*FEET, WHEEL)]
    c, s = math.cos(TURN), math.sin(TURN)
    limits = [np.eye(2) * mu * MASS * GRAVITY / len(FEET)] * len(FEET)
    limits.append(np.diag(wheel) * MASS * GRAVITY @ np.array([[c, s], [-s, c]]))
    found = twist
    for _ in range(5000):
        resistance = np.zeros((3, 3))
        for lever, limit in zip(levers, limits, strict=True):
            scaled = limit @ lever
            rest = CREEP * np.linalg.norm(limit, 2)
            if rest > 0.0:
                resistance += scaled.T @ scaled / math.hypot(*(scaled @ found), rest)
        found = np.linalg.solve(masses + dt * resistance, masses @ twist + dt * wrench)
    return found


@pytest.mark.parametrize("dt", [0.01, 0.1])
@pytest.mark.parametrize(
    ("mu", "wheel"), [(0.3, (0.0, 0.0)), (0.0, (0.05, 0.4)), (0.1, (0.3, 0.0)), (0.02, (0.2, 0.2))]
)
@pytest.mark.parametrize(
    ("twist", "wrench"),
    [
        ([0.3, -0.1, 0.2], [60.0, 20.0, 5.0]),  # slides on
        ([0.03, 0.01, -0.05], [5.0, 0.0, 0.0]),  # comes to rest
        ([0.0, 0.0, 0.0], [80.0, 0.0, 0.0]),  # stands under what nearly moves it
        ([0.0, 0.0, 0.0], [30.0, 10.0, 40.0]),  # is turned, or stands
        ([0.2, 0.0, 0.0], [-90.0, 0.0, 0.0]),  # turns about
    ],
)
def test_an_implicit_step_of_dry_friction_ends_where_a_crawl_ends(mu, wheel, twist, wrench, dt):
    case = mu, wheel, np.array(twist), np.array(wrench), dt
    np.testing.assert_allclose(stepped(*case), crawled(*case), atol=2e-3 * dt + 2e-5)


@pytest.mark.parametrize("wheel", [(0.05, 0.6), (0.002, 0.6)])
@pytest.mark.parametrize("cone", [0.0, 1.0])
@pytest.mark.parametrize("mu", [0.0, 0.1])
def test_a_wheel_that_rolls_under_a_push_across_answers_alike_in_long_steps_and_in_short_ones(wheel, cone, mu):
    # One after the other, feet rub against where the wheel will not let them go: the longer the step, the more.
    ahead = np.array([math.cos(TURN), math.sin(TURN), 0.0])
    across = np.array([-ahead[1], ahead[0], 0.0])
    wrench = 60.0 * across + [0.0, 0.0, 60.0 * float(WHEEL @ ahead[:2])]
    twist = short = 0.2 * ahead
    for _ in range(100):
        short = stepped(mu, wheel, short, wrench, 5e-4, "wheel", cone)
    long = stepped(mu, wheel, twist, wrench, 0.05, "wheel", cone)
    np.testing.assert_allclose(long, short, atol=0.004)
    assert abs(long @ across) < 0.01


def test_the_baseline_s_wheel_beside_feet_is_the_second_one_with_its_parameters():
    rng = np.random.default_rng(4)
    for _ in range(30):
        wheel = tuple(rng.uniform(0.0, 0.3, 2))
        case = 0.05, wheel, rng.normal(size=3) * 0.1, rng.normal(size=3) * 40.0, 0.01
        np.testing.assert_allclose(stepped(*case, "wheel"), stepped(*case), atol=1e-9)


def test_a_body_at_rest_that_nothing_pushes_stays_at_rest():
    np.testing.assert_array_equal(stepped(0.3, (0.1, 0.1), STILL, STILL, 0.01), STILL)


def test_friction_takes_energy_and_never_gives_any():
    rng = np.random.default_rng(3)
    masses = np.array([MASS, MASS, INERTIA])
    for _ in range(300):
        mu, wheel, twist = rng.exponential(0.3), tuple(rng.exponential(0.3, 2)), rng.normal(0.0, 0.2, 3)
        slower = stepped(mu, wheel, twist, STILL, float(rng.choice([0.01, 0.1])))
        assert masses @ slower**2 <= masses @ twist**2 + 1e-12
