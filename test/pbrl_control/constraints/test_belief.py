"""From posterior to class: the likeliest one, and a draw of it that somebody drew."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_control.constraints.belief import ClassBelief
from pbrl_control.constraints.classes import ModelClass, classify
from pbrl_control.errors import ControlError
from pbrl_model.posterior import Posterior
from pbrl_model.ros.conversions import posterior_from_msg, posterior_to_msg

TABLE = np.array([[-0.375, -0.75], [0.375, -0.75], [0.375, 0.75], [-0.375, 0.75]])
NAMES = ("mass", "wheel_x", "wheel_y", "wheel_theta", "mu_x", "mu_y")


def posterior(draws: np.ndarray, names: tuple[str, ...] = NAMES) -> Posterior:
    return Posterior("table", "wheel" if len(names) > 1 else "free", names, draws[None])


def wheels(rng: np.random.Generator, n: int, x: float, mu_x: float, mu_y: float) -> np.ndarray:
    middle = np.array([33.0, x, -0.69, 0.2, mu_x, mu_y])
    return middle + rng.normal(size=(n, 6)) * [0.5, 0.01, 0.01, 0.02, 0.005, 0.01]


def test_two_modes_give_a_draw_of_the_likelier_and_no_mean_of_both(rng: np.random.Generator) -> None:
    draws = np.vstack((wheels(rng, 70, -0.315, 0.5, 0.5), wheels(rng, 30, 0.315, 0.02, 0.6)))
    belief = ClassBelief.of(posterior(rng.permutation(draws)), TABLE)
    assert belief.probabilities[ModelClass.FIXED_POINT] == pytest.approx(0.7)
    assert belief.probabilities[ModelClass.ANISOTROPIC] == pytest.approx(0.3)
    assert sum(belief.probabilities.values()) == pytest.approx(1.0)
    assert belief.model_class == classify(belief.model) == ModelClass.FIXED_POINT
    np.testing.assert_allclose(belief.model.wheel, [-0.315, -0.69], atol=0.02)
    assert any(np.array_equal(belief.model.parameters.mass, mass) for mass in draws[:, 0])


def test_the_same_wheel_described_two_ways_is_one_wheel(rng: np.random.Generator) -> None:
    draws = wheels(rng, 40, -0.315, 0.02, 0.6)
    draws[::2, 3] += np.pi / 2
    draws[::2, 4:] = draws[::2, :3:-1]
    belief = ClassBelief.of(posterior(draws), TABLE)
    assert belief.probabilities[ModelClass.ANISOTROPIC] == 1.0
    p = belief.model.parameters
    rolls = p.wheel_theta if p.mu_x < p.mu_y else p.wheel_theta + np.pi / 2
    assert np.angle(np.exp(2j * (rolls - 0.2))) / 2 == pytest.approx(0.0, abs=0.06)


def test_it_takes_what_is_published(rng: np.random.Generator) -> None:
    learned = posterior(wheels(rng, 20, -0.315, 0.02, 0.6))
    heard = posterior_from_msg(posterior_to_msg(learned))
    assert ClassBelief.of(heard, TABLE).probabilities == ClassBelief.of(learned, TABLE).probabilities


def test_same_posterior_same_model(rng: np.random.Generator) -> None:
    learned = posterior(wheels(rng, 300, -0.315, 0.02, 0.6))
    one, two = (ClassBelief.of(learned, TABLE) for _ in range(2))
    np.testing.assert_array_equal(one.model.parameters.to_vector(), two.model.parameters.to_vector())


def test_of_draws_alike_any_will_do() -> None:
    belief = ClassBelief.of(posterior(np.full((10, 1), 33.0), ("mass",)), TABLE)
    assert belief.model_class == ModelClass.UNCONSTRAINED
    assert belief.model.mass == 33.0


def test_a_posterior_with_a_negative_mass_is_refused() -> None:
    with pytest.raises(ControlError, match="mass above zero"):
        ClassBelief.of(posterior(np.full((1, 1), -1.0), ("mass",)), TABLE)
