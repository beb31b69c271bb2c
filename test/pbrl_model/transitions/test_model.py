"""The learner on transitions: it finds the class and the parameters, is honest, and gives the same bytes again."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_bag.types import BodyGeometry
from pbrl_model.errors import ModelError
from pbrl_model.geometry import mass_properties
from pbrl_model.parameters import KERNEL_COLUMNS, BodyParameters
from pbrl_model.prior_options import PriorOptions
from pbrl_model.symmetry import canonical_wheel
from pbrl_model.transitions.classes import NoisePrior, transition_class
from pbrl_model.transitions.data import Transitions, displacements, observed
from pbrl_model.transitions.model import LearnOptions, PhysicsRegression, TransitionPosterior, learn, update
from pbrl_model.transitions.problem import TransitionProblem, simulate

Array = NDArray[np.float64]

BOX = np.array([[0.0, -0.3], [1.0, -0.3], [1.0, 0.3], [0.0, 0.3]])
BODY = mass_properties(BOX)
LEVER = float(np.sqrt(BODY.inertia_per_mass))
GEOMETRY = BodyGeometry("cart", BOX, 0.8, float("nan"), True, np.zeros(3))
FREE = BodyParameters(40.0)
WHEEL = BodyParameters(20.0, wheel_x=0.1, wheel_y=0.05, wheel_theta=0.4, mu_x=0.02, mu_y=0.1)
REVOLUTE = BodyParameters(15.0, hinge_x=2.0, hinge_y=-1.0, hinge_radius=0.0, anchor_x=0.8, anchor_y=0.1)
SERIAL = LearnOptions(parallel=False)


def pushed(truth: BodyParameters, n: int, seed: int = 0, ground: float = 0.0, strength: float = 1.0) -> Transitions:
    """Push the cart n times for 0.3 s, every fourth time from rest; a hinged one starts at its hinge."""
    rng = np.random.default_rng(seed)
    row = truth.to_vector()[None]
    row[:, KERNEL_COLUMNS.index("mu_ground")] = ground
    states, ends = np.empty((n, 1, 6)), np.empty((n, 1, 6))
    wrench = rng.uniform(-1.0, 1.0, (n, 3)) * strength * truth.mass * np.array([1.5, 1.5, 0.4])
    state = np.zeros(6)
    for k in range(n):
        if k % 4 == 0:
            theta = rng.uniform(-3.0, 3.0)
            c, s = np.cos(theta), np.sin(theta)
            arm = np.array([[c, -s], [s, c]]) @ (np.array([truth.anchor_x, truth.anchor_y]) - BODY.com)
            place = np.array([truth.hinge_x, truth.hinge_y]) - arm if truth.has_hinge else rng.normal(size=2)
            state = np.array([*place, theta, 0.0, 0.0, 0.0])
        states[k, 0] = state
        ends[k] = simulate(row, state[None], wrench[k][None], np.array([0.3]), BODY, 0.01, parallel=False)[0]
        state = ends[k, 0]
    return Transitions(states, np.zeros(n, dtype=int), wrench, np.full(n, 0.3), ends)


def learned(truth: BodyParameters, n: int, noise: float, strength: float = 1.0) -> TransitionPosterior:
    noisy = observed(np.random.default_rng(9), pushed(truth, n, strength=strength), noise, [LEVER])
    return learn(np.random.default_rng(0), noisy, 0, GEOMETRY, SERIAL)


def error(posterior: TransitionPosterior, truth: BodyParameters) -> Array:
    """Return the largest error (6,) of predicted displacements over their spread, on pushes that were not seen."""
    test = pushed(truth, 40, seed=77)
    end = posterior.predict(test.state[:, 0], test.wrench, test.duration)
    true = displacements(test.state[:, 0], test.next_state[:, 0])
    return np.abs(displacements(end, test.next_state[:, 0])).max(axis=0) / true.std(axis=0)


@pytest.mark.parametrize(
    ("name", "truth", "strength"), [("free", FREE, 1.0), ("wheel", WHEEL, 1.0), ("revolute", REVOLUTE, 10.0)]
)
def test_the_class_is_named_and_pushes_are_foretold(name: str, truth: BodyParameters, strength: float) -> None:
    posterior = learned(truth, 16, 0.005, strength)
    assert posterior.best_class == name
    assert posterior.class_probabilities[name] > 0.95
    assert posterior.converged, posterior.notes
    assert error(posterior, truth).max() < 0.15
    np.testing.assert_allclose(np.median(posterior.noise), 0.005, rtol=0.2)


def test_a_pivot_and_a_wheel_that_never_slips_are_not_told_apart_but_foretell_alike() -> None:
    posterior = learned(REVOLUTE, 12, 0.002)
    assert 0.02 < posterior.class_probabilities["revolute"] < 0.98
    assert 0.02 < posterior.class_probabilities["wheel"] < 0.98
    assert error(posterior, REVOLUTE).max() < 0.15


def test_parameters_are_found_within_their_own_uncertainty() -> None:
    posterior = learned(WHEEL, 30, 0.005)
    rows = canonical_wheel(posterior.rows, KERNEL_COLUMNS)
    columns = [KERNEL_COLUMNS.index(name) for name in ("mass", "wheel_x", "wheel_y", "wheel_theta", "mu_x", "mu_y")]
    off = (rows[:, columns].mean(axis=0) - WHEEL.to_vector()[columns]) / rows[:, columns].std(axis=0)
    assert np.abs(off).max() < 4.0
    assert rows[:, columns[1:3]].std(axis=0).max() < 0.02


def test_without_noise_four_pushes_give_what_they_can_give() -> None:
    posterior = learned(WHEEL, 4, 0.0)
    assert posterior.best_class == "wheel"
    rows = canonical_wheel(posterior.rows, KERNEL_COLUMNS)
    for name in ("mass", "wheel_x", "wheel_y", "wheel_theta", "mu_x"):
        np.testing.assert_allclose(rows[:, KERNEL_COLUMNS.index(name)], getattr(WHEEL, name), rtol=0.01, atol=1e-3)
    # It never slipped sideways: how hard that would be is not known, only that it is harder than what was tried.
    sideways = rows[:, KERNEL_COLUMNS.index("mu_y")]
    assert sideways.min() > 0.05
    assert sideways.std() > 0.1


def test_a_pivot_is_where_the_states_put_it() -> None:
    data = observed(np.random.default_rng(9), pushed(REVOLUTE, 8), 0.002, [LEVER])
    rows = learn(np.random.default_rng(0), data, 0, GEOMETRY, LearnOptions(("revolute",), parallel=False)).rows
    for name in ("hinge_x", "hinge_y", "anchor_x", "anchor_y"):
        np.testing.assert_allclose(rows[:, KERNEL_COLUMNS.index(name)].mean(), getattr(REVOLUTE, name), atol=0.02)


def test_a_body_thought_pinned_is_foretold_alike_wherever_it_is() -> None:
    posterior = learned(REVOLUTE, 8, 0.002)
    test = pushed(REVOLUTE, 5, seed=3)
    moved = test.state[:, 0] + np.array([3.0, -2.0, 0.0, 0.0, 0.0, 0.0])
    here = posterior.predict(test.state[:, 0], test.wrench, test.duration)
    there = posterior.predict(moved, test.wrench, test.duration)
    np.testing.assert_allclose(there - here, np.broadcast_to([3.0, -2.0, 0.0, 0.0, 0.0, 0.0], (5, 6)), atol=1e-9)


def test_friction_on_the_floor_is_learned_where_it_is_asked_for() -> None:
    data = observed(np.random.default_rng(9), pushed(FREE, 12, ground=0.08), 0.002, [LEVER])
    posterior = learn(np.random.default_rng(0), data, 0, GEOMETRY, LearnOptions(("free",), ground=True, parallel=False))
    np.testing.assert_allclose(posterior.rows[:, KERNEL_COLUMNS.index("mu_ground")].mean(), 0.08, atol=0.003)


def test_evidence_of_the_free_class_is_that_of_a_grid() -> None:
    data = observed(np.random.default_rng(9), pushed(FREE, 6), 0.004, [LEVER]).body(0)
    kind = transition_class("free", GEOMETRY, PriorOptions(), NoisePrior(), ground=False)
    problem = TransitionProblem(kind, data, BODY, 0.01, parallel=False)
    mass, noise = np.linspace(np.log(35.0), np.log(45.0), 301), np.linspace(np.log(1e-3), np.log(2e-2), 201)
    grid = np.stack(np.meshgrid(mass, noise, indexing="ij"), axis=-1).reshape(-1, 2)
    log = problem.log_prior(grid) + problem.log_likelihood(grid)
    area = (mass[1] - mass[0]) * (noise[1] - noise[0])
    exact = np.log(np.exp(log - log.max()).sum() * area) + log.max()
    found = learned(FREE, 6, 0.004).inferences[0]
    np.testing.assert_allclose(found.log_evidence, exact, atol=0.1)


def test_the_likelihood_is_the_density_of_gaussian_noise() -> None:
    data = observed(np.random.default_rng(9), pushed(FREE, 3), 0.01, [LEVER]).body(0)
    kind = transition_class("free", GEOMETRY, PriorOptions(), NoisePrior(), ground=False)
    problem = TransitionProblem(kind, data, BODY, 0.01, parallel=False)
    theta = np.array([[np.log(30.0), np.log(0.02)]])
    row = np.zeros((1, 12))
    row[0, 0], row[0, KERNEL_COLUMNS.index("hinge_radius")] = 30.0, np.nan
    end = simulate(row, data.start, data.wrench, data.duration, BODY, 0.01, parallel=False)[0]
    sd = 0.02 / np.array([1.0, 1.0, LEVER, 1.0, 1.0, LEVER])
    by_hand = (-0.5 * ((data.end - end) / sd) ** 2 - np.log(sd) - 0.5 * np.log(2.0 * np.pi)).sum()
    np.testing.assert_allclose(problem.log_likelihood(theta), by_hand)


def test_other_descriptions_of_a_wheel_have_the_same_posterior_density() -> None:
    data = pushed(WHEEL, 3).body(0)
    kind = transition_class("wheel", GEOMETRY, LearnOptions().priors, NoisePrior(), ground=False)
    problem = TransitionProblem(kind, data, BODY, 0.01, parallel=False)
    theta = problem.sample_prior(np.random.default_rng(0), 5)
    values = [problem.log_prior(image) + problem.log_likelihood(image) for image in problem.images(theta)]
    assert len(values) == 4
    np.testing.assert_allclose(values, np.broadcast_to(values[0], (4, 5)), rtol=1e-6)


def test_the_same_seed_gives_the_same_bytes_on_one_core_and_on_all() -> None:
    data = observed(np.random.default_rng(9), pushed(WHEEL, 5), 0.005, [LEVER])
    rows = [
        learn(np.random.default_rng(3), data, 0, GEOMETRY, LearnOptions(parallel=parallel)).rows.tobytes()
        for parallel in (False, False, True)
    ]
    assert rows[0] == rows[1] == rows[2]


def test_going_on_counts_all_transitions_alike() -> None:
    data = observed(np.random.default_rng(9), pushed(WHEEL, 12), 0.005, [LEVER])
    first = learn(np.random.default_rng(0), data[:8], 0, GEOMETRY, SERIAL)
    on = update(np.random.default_rng(1), first, data[8:], 0)
    at_once = learn(np.random.default_rng(2), data, 0, GEOMETRY, SERIAL)
    np.testing.assert_array_equal(on.data.end, at_once.data.end)
    means = [canonical_wheel(each.rows, KERNEL_COLUMNS)[:, 0].mean() for each in (on, at_once)]
    np.testing.assert_allclose(means[0], means[1], rtol=0.01)
    evidence = [each.inferences[1].log_evidence for each in (on, at_once)]
    np.testing.assert_allclose(evidence[0], evidence[1], atol=0.5)


def test_bodies_are_learned_side_by_side_like_baselines() -> None:
    one, other = pushed(FREE, 6), pushed(REVOLUTE, 6)
    still = np.zeros((6, 1, 6))
    both = Transitions(
        np.concatenate([np.concatenate([one.state, still], 1), np.concatenate([still, other.state], 1)]),
        np.repeat([0, 1], 6),
        np.concatenate([one.wrench, other.wrench]),
        np.full(12, 0.3),
        np.concatenate([np.concatenate([one.next_state, still], 1), np.concatenate([still, other.next_state], 1)]),
    )
    model = PhysicsRegression(np.random.default_rng(0), [GEOMETRY, GEOMETRY], SERIAL).fit(both)
    assert [each.best_class for each in model.posteriors] == ["free", "revolute"]
    told = both[:3]
    end = model.predict(told.state, told.target, told.wrench, told.duration)
    np.testing.assert_allclose(end[:, 0], told.next_state[:, 0], atol=0.01)


def test_what_says_nothing_is_refused_in_one_line() -> None:
    data, rng = pushed(FREE, 4), np.random.default_rng(0)
    coasting = Transitions(data.state, data.target, 0.0 * data.wrench, data.duration, data.next_state)
    longer = Transitions(data.state, data.target, data.wrench, data.duration + 0.004, data.next_state)
    cases = [
        (data[:0], GEOMETRY, "push it first"),
        (coasting, GEOMETRY, "push it first"),
        (longer, GEOMETRY, "whole steps"),
        (data, BodyGeometry("cart", BOX[[0, 2, 1, 3]], 0.8, 1.0, True, np.zeros(3)), "cross"),
        (data, BodyGeometry("cart", BOX, 0.8, -1.0, True, np.zeros(3)), "nominal mass"),
    ]
    for transitions, geometry, said in cases:
        with pytest.raises(ModelError, match=said) as caught:
            learn(rng, transitions, 0, geometry, SERIAL)
        assert "\n" not in str(caught.value)
    with pytest.raises(ModelError, match="did you mean 'wheel'"):
        learn(rng, data, 0, GEOMETRY, LearnOptions(("wheels",)))
    for bad in ({"classes": ()}, {"dt": 0.0}, {"draws": 0}):
        with pytest.raises(ModelError, match="learn: expected"):
            LearnOptions(**bad)  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="floor < ceiling"):
        learn(rng, data, 0, GEOMETRY, LearnOptions(noise=NoisePrior(floor=0.0)))


def test_data_that_contradict_every_class_are_explained_by_noise_not_by_a_sure_model() -> None:
    data = pushed(FREE, 12)
    nonsense = np.random.default_rng(5).normal(size=data.next_state.shape)
    wild = Transitions(data.state, data.target, data.wrench, data.duration, data.state + nonsense)
    posterior = learn(np.random.default_rng(0), wild, 0, GEOMETRY, SERIAL)
    assert np.median(posterior.noise) > 0.3
    assert posterior.rows[:, 0].std() > 0.2 * posterior.rows[:, 0].mean()
