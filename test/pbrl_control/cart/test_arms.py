"""Joint rates of both arms: what hands of a rigid cart do, both laws, limits."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from pbrl_control.cart import ArmState, hand_twists, pseudo_inverse_rates, transpose_rates
from pbrl_control.cart.settings import ArmLawSettings
from pbrl_control.errors import ControlError

SETTINGS = ArmLawSettings()
GRIP = np.array([0.65, 0.0])
HANDS = GRIP + np.array([[0.0, 0.25], [0.0, -0.25]])


def arms_of(rng: np.random.Generator, speed: float = 1e3) -> ArmState:
    stops = np.full((2, 7), 2.0)
    return ArmState(rng.normal(size=(2, 6, 7)), rng.uniform(-1, 1, (2, 7)), -stops, stops, np.full((2, 7), speed))


def test_hands_move_as_points_of_the_cart_do() -> None:
    twist, dt = np.array([0.1, -0.2, 0.4]), 1e-6
    found = hand_twists(twist, GRIP, HANDS)
    c, s = math.cos(twist[2] * dt), math.sin(twist[2] * dt)
    moved = (HANDS - GRIP) @ np.array([[c, s], [-s, c]]) + GRIP + dt * twist[:2]
    assert np.allclose(found[:, :2], (moved - HANDS) / dt, atol=1e-5)
    assert np.array_equal(found[:, 5], [0.4, 0.4]) and not found[:, 2:5].any()
    assert np.allclose(np.diff(found[:, :2], axis=0) @ np.diff(HANDS, axis=0).T, 0.0), "their distance stays"


def test_the_pseudo_inverse_does_both_hands_twists(rng: np.random.Generator) -> None:
    for _ in range(10):
        arms, twists = arms_of(rng), hand_twists(rng.uniform(-0.2, 0.2, 3), GRIP, HANDS)
        found = pseudo_inverse_rates(arms, twists, ArmLawSettings(threshold=1e-6))
        assert np.allclose(np.einsum("kij,kj->ki", arms.jacobians, found.rates), found.scale * twists)
        assert np.allclose(found.missed, 0.0, atol=1e-9)
        shortest = [np.linalg.lstsq(arms.jacobians[k], twists[k], rcond=None)[0] for k in range(2)]
        assert np.allclose(found.rates, found.scale * np.array(shortest))


def test_the_transpose_goes_the_right_way_but_misses_what_the_inverse_does(rng: np.random.Generator) -> None:
    for _ in range(10):
        arms, twists = arms_of(rng), hand_twists(rng.uniform(-0.2, 0.2, 3), GRIP, HANDS)
        found = transpose_rates(arms, twists, SETTINGS)
        done = np.einsum("kij,kj->ki", arms.jacobians, found.rates)
        assert np.sum(done * twists) > 0.0
        assert np.linalg.norm(found.missed) < np.linalg.norm(twists)
        assert np.linalg.norm(found.missed) > np.linalg.norm(pseudo_inverse_rates(arms, twists, SETTINGS).missed)
        best = np.linalg.norm(found.missed)
        ratio = found.rates[0, 0] / (arms.jacobians[0].T @ twists[0])[0] / found.scale
        for gain in (0.9 * ratio, 1.1 * ratio):
            other = transpose_rates(arms, twists, ArmLawSettings(gain=gain))
            assert np.linalg.norm(other.missed) > best


def test_damping_keeps_rates_down_at_a_singularity(rng: np.random.Generator) -> None:
    arms = arms_of(rng)
    u, s, vt = np.linalg.svd(arms.jacobians, full_matrices=False)
    s[:, -1] = 1e-9
    singular = dataclasses.replace(arms, jacobians=u * s[:, None] @ vt)
    twists = hand_twists(np.array([0.1, 0.1, 0.2]), GRIP, HANDS)
    found = pseudo_inverse_rates(singular, twists, SETTINGS)
    assert np.abs(found.rates).max() < np.linalg.norm(twists) / SETTINGS.damping


@pytest.mark.parametrize("law", [pseudo_inverse_rates, transpose_rates])
def test_limits_slow_both_arms_down_by_the_same_share(law, rng: np.random.Generator) -> None:
    twists = hand_twists(np.array([0.1, -0.1, 0.3]), GRIP, HANDS)
    for _ in range(20):
        arms = arms_of(rng, 0.02)
        found = law(arms, twists, SETTINGS)
        free = law(
            dataclasses.replace(arms, speed=np.full((2, 7), 1e6), lower=arms.lower - 1e6, upper=arms.upper + 1e6),
            twists,
            SETTINGS,
        )
        assert (np.abs(found.rates) <= arms.speed + 1e-12).all()
        assert np.allclose(found.rates, found.scale * free.rates)


def test_joints_stop_before_their_stops_and_may_leave_them(rng: np.random.Generator) -> None:
    arms = arms_of(rng)
    twists = hand_twists(np.array([0.1, -0.1, 0.3]), GRIP, HANDS)
    joints, dt = arms.joints.copy(), 0.05
    for _ in range(400):
        now = dataclasses.replace(arms, joints=joints)
        joints = joints + dt * pseudo_inverse_rates(now, twists, SETTINGS).rates
        assert (np.abs(joints) <= 2.0).all()
    stuck = dataclasses.replace(arms, joints=joints)
    assert pseudo_inverse_rates(stuck, twists, SETTINGS).scale < 0.01
    assert pseudo_inverse_rates(stuck, -twists, SETTINGS).scale > 0.05


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"jacobians": np.zeros((2, 3, 7))}, "jacobians"),
        ({"joints": np.full((2, 7), np.nan)}, "joints"),
        ({"lower": np.full((2, 7), np.nan)}, "lower"),
        ({"speed": np.full((2, 7), -1.0)}, "speeds"),
        ({"lower": np.full((2, 7), 3.0)}, "lower stops"),
    ],
)
def test_arms_that_are_none_are_refused_in_words(changes: dict, words: str, rng: np.random.Generator) -> None:
    with pytest.raises(ControlError, match=words):
        dataclasses.replace(arms_of(rng), **changes)
