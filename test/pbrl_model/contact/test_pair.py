"""Both bodies simulated together: at the truth nothing is left to explain, and friction is told where they slide."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_model.contact.episodes import Touch
from pbrl_model.contact.pair import PAIR_NAMES, PairLikelihood, learn_pair
from pbrl_model.contact.wrench import HeldBody
from pbrl_model.engines.contact_world import contact_scene
from pbrl_model.geometry import mass_properties
from pbrl_model.parameters import BodyParameters
from pbrl_model.sensing.motion import Motion
from pbrl_model.world import BodySpec, PhysicsWorld

Array = NDArray[np.float64]

SQUARE = np.array([[-0.4, -0.4], [0.4, -0.4], [0.4, 0.4], [-0.4, 0.4]])
LONG = SQUARE * np.array([2.0, 1.0])
DT, STEPS, EVERY = 0.01, 200, 7
HELD = BodyParameters(mass=9.0, mu_ground=0.01)
PUSHED = BodyParameters(mass=20.0, wheel_x=0.7, wheel_y=0.3, mu_x=0.2, mu_y=0.2, mu_ground=0.01)
FRICTION = 0.25


def _motion(name: str, states: Array, wrench: Array) -> Motion:
    time = np.linspace(0.0, DT * STEPS, STEPS + 1)
    rows = np.arange(0, STEPS + 1, EVERY)
    covariance = np.zeros((STEPS + 1, 6, 6))
    noise = np.full(3, 3e-3)
    return Motion(name, (), DT, time, wrench, time[rows], states[rows, :3], states, covariance, noise, True)


@pytest.fixture(scope="module")
def likelihood() -> PairLikelihood:
    """Return the likelihood of a noise-free run in which a square is guided along a table and slides on it."""
    world = PhysicsWorld(DT)
    coefficients = {"restitution": 0.0, "contact_friction": np.sqrt(FRICTION)}
    world.add_body(BodySpec("square", SQUARE, HELD, np.array([-0.3, -0.85, 0.15]), **coefficients))
    world.add_body(BodySpec("long", LONG, PUSHED, np.zeros(3), **coefficients))
    states, others, wrenches = [world.com_state("square")], [world.com_state("long")], []
    for k in range(STEPS):
        wanted = np.array([-0.3 + 0.2 * k * DT, -0.85 + 0.15 * k * DT, 0.15])
        wrench = np.array([900.0, 900.0, 120.0]) * (wanted - states[-1][:3])
        wrench += np.array([100.0, 100.0, 12.0]) * (np.array([0.2, 0.15, 0.0]) - states[-1][3:])
        world.apply_wrench("square", wrench)
        world.step()
        wrenches.append(wrench)
        states.append(world.com_state("square"))
        others.append(world.com_state("long"))
    held = _motion("square", np.array(states), np.array(wrenches))
    pushed = _motion("long", np.array(others), np.zeros((STEPS, 3)))
    body = HeldBody(HELD, mass_properties(SQUARE), np.zeros(3))
    touch = Touch(held, pushed, np.zeros(STEPS + 1))
    return PairLikelihood(contact_scene([SQUARE, LONG]), body, [touch], 1.0)


def _row(friction: float, pushed: BodyParameters = PUSHED) -> Array:
    return np.append(pushed.to_vector(), [0.0, friction])


def test_at_the_truth_nothing_is_left_to_explain(likelihood: PairLikelihood) -> None:
    residuals = likelihood.residuals(_row(FRICTION)[None], likelihood.at_rest(1))
    # Half a standard deviation: every few steps a space begins anew and has forgotten its contacts' impulses.
    assert np.abs(residuals).max() < 0.5
    assert np.abs(likelihood.windows.pose).max() > 0.1  # it did move


def test_sensitivities_are_differences_of_residuals(likelihood: PairLikelihood) -> None:
    nuisance = likelihood.at_rest(1)
    base = likelihood.residuals(_row(FRICTION)[None], nuisance)[0]
    slopes = likelihood.sensitivities(_row(FRICTION), nuisance[0], base)
    moved = nuisance.copy()
    moved[..., -1] += 0.5  # bias of the torque: exactly linear
    expected = base - likelihood.residuals(_row(FRICTION)[None], moved)[0]
    np.testing.assert_allclose(0.5 * slopes[..., -1], expected, atol=1e-9)


@pytest.mark.parametrize("wrong", [0.1, 0.5])
def test_the_true_friction_is_likelier(likelihood: PairLikelihood, wrong: float) -> None:
    nuisance, slopes = likelihood.settle(_row(FRICTION))
    right, other = likelihood.log_likelihood(np.stack([_row(FRICTION), _row(wrong)]), nuisance, slopes)
    assert right > other + 2.0


def test_friction_is_learned_and_restitution_is_not(likelihood: PairLikelihood) -> None:
    draws = learn_pair(np.random.default_rng(0), likelihood, PUSHED.to_vector()[None])
    friction, bounce = (draws[:, PAIR_NAMES.index(name)] for name in ("contact_friction", "restitution"))
    assert abs(friction.mean() - FRICTION) < 3.0 * friction.std() + 0.02
    assert friction.std() < 0.15
    assert bounce.std() == pytest.approx(np.sqrt(1.0 / 12.0), rel=0.15)


def test_same_seed_same_bytes(likelihood: PairLikelihood) -> None:
    first, second = (learn_pair(np.random.default_rng(3), likelihood, PUSHED.to_vector()[None]) for _ in range(2))
    assert first.tobytes() == second.tobytes()
