"""The marginal likelihood: a free body is linear in its start and in forces, so that everything has a closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from pbrl_model.fitting.likelihood import WindowedLikelihood
from pbrl_model.geometry import MassProperties
from pbrl_model.parameters import BodyParameters
from pbrl_model.sensing.windows import Windows

MASS = 20.0
BODY = MassProperties(1.0, np.zeros(2), 0.25)
LEVER = 0.5
STEPS, DT = 80, 0.01
SIGMA, DRAG = 1.3, 3.0


@pytest.fixture
def windows() -> Windows:
    """Two windows of a body that starts somewhere near where it is thought to, with poses between the steps."""
    rng = np.random.default_rng(4)
    count, poses = 2, 6
    root = 0.02 * rng.normal(size=(count, 6, 6))
    place = np.sort(rng.uniform(0, STEPS, (count, poses)), axis=1)
    return Windows(
        dt=DT,
        wrench=rng.normal(size=(count, STEPS, 3)) * [20, 20, 5],
        rate=np.zeros((count, STEPS, 3)),
        delay=0.0,
        heading=np.zeros((count, STEPS)),
        steps=np.full(count, STEPS),
        initial=rng.normal(size=(count, 6)) * 0.2,
        covariance=root @ np.swapaxes(root, 1, 2),
        step=np.minimum(np.floor(place), STEPS - 1).astype(np.int64),
        fraction=place - np.minimum(np.floor(place), STEPS - 1),
        pose=rng.normal(size=(count, poses, 3)) * 0.1,
        seen=rng.random((count, poses, 3)) < 0.8,
        episode=np.zeros(count, dtype=np.int64),
        start=np.array([0.0, 0.8]),
        noise=np.tile([0.003, 0.004, 0.01], (count, 1)),
    )


def row(mass: float = MASS, **fields: float) -> np.ndarray:
    return BodyParameters(mass=mass, **fields).to_vector()[None]


def slow_pose(initial: np.ndarray, wrench: np.ndarray, step: int, fraction: float) -> np.ndarray:
    """Newton by hand: the pose advances with the old velocity, then the force acts."""
    position, velocity = initial[:3].copy(), initial[3:].copy()
    path = [position.copy()]
    for force in wrench:
        position = position + velocity * DT
        velocity = velocity + force * DT / (MASS * np.array([1, 1, BODY.inertia_per_mass]))
        path.append(position.copy())
    return path[step] + fraction * (path[step + 1] - path[step])


def brute_force(windows: Windows, drag: float) -> float:
    """Multivariate normal of the observed numbers, its covariance put together from unit responses."""
    total = 0.0
    for w in range(len(windows)):
        places = list(zip(windows.step[w], windows.fraction[w], strict=True))

        def poses(initial: np.ndarray, wrench: np.ndarray, places: list = places) -> np.ndarray:
            return np.concatenate([slow_pose(initial, wrench, step, fraction) for step, fraction in places])

        zero = np.zeros((STEPS, 3))
        by_start = np.stack([poses(unit, zero) for unit in np.eye(6)], -1)
        unit_forces = np.diag([1.0, 1.0, LEVER])
        by_force = np.stack([poses(np.zeros(6), np.tile(unit, (STEPS, 1))) for unit in unit_forces], -1)
        covariance = np.diag(np.tile(windows.noise[w], len(places)) ** 2) * SIGMA**2
        covariance += by_start @ windows.covariance[w] @ by_start.T + drag**2 * by_force @ by_force.T
        mean = poses(windows.initial[w], windows.wrench[w])
        seen = windows.seen[w].ravel()
        total += multivariate_normal(mean[seen], covariance[np.ix_(seen, seen)]).logpdf(windows.pose[w].ravel()[seen])
    return total


def log_density(
    likelihood: WindowedLikelihood, rows: np.ndarray, sigma: float = SIGMA, drag: float = DRAG
) -> np.ndarray:
    nuisance = likelihood.at_rest(len(rows))
    linear = likelihood.linearise(rows, nuisance)
    count = np.ones(len(rows))
    return likelihood.log_density(likelihood.residuals(rows, nuisance), linear, sigma * count, drag * count)


def test_marginal_is_the_multivariate_normal(windows: Windows) -> None:
    found = log_density(WindowedLikelihood(BODY, windows), row())
    assert found[0] == pytest.approx(brute_force(windows, DRAG), abs=1e-4)


def test_without_left_out_force(windows: Windows) -> None:
    found = log_density(WindowedLikelihood(BODY, windows, with_drag=False), row())
    assert found[0] == pytest.approx(brute_force(windows, 0.0), abs=1e-4)


def test_with_nothing_unknown_residuals_are_independent(windows: Windows) -> None:
    known = replace(windows, covariance=np.zeros_like(windows.covariance))
    likelihood = WindowedLikelihood(BODY, known, with_drag=False)
    assert not likelihood.has_nuisance
    residual = likelihood.residuals(row(), likelihood.at_rest(1))[0]
    seen = known.seen.reshape(len(known), -1)
    scale = np.log(np.tile(known.noise, known.seen.shape[1]) * SIGMA * np.sqrt(2 * np.pi))
    expected = -0.5 * np.sum((residual[seen] / SIGMA) ** 2) - np.sum(scale[seen])
    assert log_density(likelihood, row())[0] == pytest.approx(expected)


def test_where_it_is_linearised_does_not_matter_for_a_linear_model(windows: Windows) -> None:
    likelihood = WindowedLikelihood(BODY, windows)
    nuisance = np.random.default_rng(0).normal(size=(1, len(windows), 9))
    linear = likelihood.linearise(row(), nuisance)
    residuals = likelihood.residuals(row(), nuisance)
    found = likelihood.log_density(residuals, linear, np.array([SIGMA]), np.array([DRAG]))
    assert found[0] == pytest.approx(log_density(likelihood, row())[0], abs=1e-4)


@pytest.mark.parametrize("rounds", [1, 4])
def test_compiled_marginal_is_the_multivariate_normal(windows: Windows, rounds: int) -> None:
    likelihood = WindowedLikelihood(BODY, windows)
    start = np.random.default_rng(1).normal(size=(1, len(windows), 9))
    one = np.ones(1)
    found = likelihood.marginal(row(), SIGMA * one, DRAG * one, 0 * one, start, rounds=rounds)
    assert found[0] == pytest.approx(brute_force(windows, DRAG), abs=2e-4)


def test_compiled_climb_ends_where_nuisances_are_most_likely(windows: Windows) -> None:
    likelihood = WindowedLikelihood(BODY, windows)
    found, one = likelihood.at_rest(1), np.ones(1)
    likelihood.marginal(row(), SIGMA * one, DRAG * one, 0 * one, found)
    linear = likelihood.linearise(row(), likelihood.at_rest(1))
    residuals = likelihood.residuals(row(), likelihood.at_rest(1))
    best = likelihood.best_nuisance(residuals, linear, SIGMA * one, DRAG * one)
    np.testing.assert_allclose(found, best, atol=0.02)


def test_compiled_marginal_of_a_held_body_is_that_of_the_settled_linearisation(windows: Windows) -> None:
    near = replace(windows, pose=0.05 * windows.pose + windows.initial[:, None, :3], covariance=windows.covariance / 9)
    likelihood = WindowedLikelihood(BODY, near)
    nuisance, noise = likelihood.at_rest(1), (np.array([8.0]), np.array([DRAG]))
    compiled = likelihood.marginal(HELD, *noise, np.zeros(1), nuisance, rounds=8)
    linear = likelihood.linearise(HELD, nuisance)
    slow = likelihood.log_density(likelihood.residuals(HELD, nuisance), linear, *noise)
    assert compiled[0] == pytest.approx(slow[0], abs=0.2)


def test_best_nuisance_is_where_the_misfit_is_least(windows: Windows) -> None:
    likelihood = WindowedLikelihood(BODY, windows)
    start, one = likelihood.at_rest(1), np.ones(1)
    linear = likelihood.linearise(row(), start)
    best = likelihood.best_nuisance(likelihood.residuals(row(), start), linear, SIGMA * one, DRAG * one)

    def misfit(nuisance: np.ndarray) -> float:
        residuals = likelihood.residuals(row(), nuisance)
        return float(likelihood.misfit(residuals, nuisance, SIGMA * one, DRAG * one).sum())

    least = misfit(best)
    rng = np.random.default_rng(2)
    assert all(misfit(best + 0.05 * rng.normal(size=best.shape)) > least for _ in range(20))


def test_normal_equations_are_the_slope_of_the_quadratic_form(windows: Windows) -> None:
    likelihood = WindowedLikelihood(BODY, windows)
    nuisance = likelihood.at_rest(1)
    linear = likelihood.linearise(row(), nuisance)
    base = likelihood.residuals(row(), nuisance)
    direction = np.random.default_rng(3).normal(size=(*base.shape, 1))
    noise = np.array([SIGMA]), np.array([DRAG])
    curvature, slope = likelihood.normal_equations(base, direction, linear, *noise)
    plus, minus = (likelihood.log_density(base - h * direction[..., 0], linear, *noise)[0] for h in (1e-2, -1e-2))
    middle = likelihood.log_density(base, linear, *noise)[0]
    assert slope[0, 0] == pytest.approx((plus - minus) / 2e-2, rel=1e-4)
    assert -curvature[0, 0, 0] == pytest.approx((plus - 2 * middle + minus) / 1e-4, rel=1e-3)


def test_rows_are_judged_alone(windows: Windows) -> None:
    likelihood = WindowedLikelihood(BODY, windows)
    rows = np.concatenate([row(), row(35.0), row(12.0, wheel_x=0.2, mu_x=0.1, mu_y=0.3)])
    together = log_density(likelihood, rows)
    alone = [log_density(likelihood, rows[k : k + 1])[0] for k in range(3)]
    np.testing.assert_allclose(together, alone, rtol=1e-12)


HELD = row(25.0, wheel_x=0.3, wheel_y=-0.2, mu_x=0.9, mu_y=0.9)


# A held body is not linear in its start, and the differences are taken along the axes of P0: hence the wider bound.
@pytest.mark.parametrize(("body", "bound"), [(row(), 1e-6), (HELD, 1e-3)], ids=["free", "held"])
def test_the_world_may_be_laid_out_otherwise(windows: Windows, body: np.ndarray, bound: float) -> None:
    angle, shift = 1.1, np.array([3.0, -2.0, 0.0])
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    both = np.kron(np.eye(2), turn)
    here = replace(windows, noise=np.tile([0.003, 0.003, 0.01], (2, 1)), seen=np.ones_like(windows.seen))
    there = replace(
        here,
        wrench=here.wrench @ turn.T,
        heading=here.heading + angle,
        initial=here.initial @ both.T + np.array([*shift[:2], angle, 0.0, 0.0, 0.0]),
        covariance=both @ here.covariance @ both.T,
        pose=here.pose @ turn.T + np.array([*shift[:2], angle]),
    )
    one, other = (log_density(WindowedLikelihood(BODY, layout), body)[0] for layout in (here, there))
    assert one == pytest.approx(other, rel=bound)


def test_headings_are_wrapped(windows: Windows) -> None:
    likelihood = WindowedLikelihood(BODY, windows)
    spun = WindowedLikelihood(BODY, replace(windows, pose=windows.pose + np.array([0, 0, 4 * np.pi])))
    assert log_density(likelihood, row())[0] == pytest.approx(log_density(spun, row())[0], rel=1e-9)


def test_a_heading_that_was_not_observed_does_not_count(windows: Windows) -> None:
    seen = windows.seen.copy()
    seen[..., 2] = False
    blind = replace(windows, seen=seen)
    garbage = replace(blind, pose=np.where(seen, blind.pose, 1e3))
    one, other = (log_density(WindowedLikelihood(BODY, w), row())[0] for w in (blind, garbage))
    assert one == other and np.isfinite(one)
    assert one == pytest.approx(brute_force(blind, DRAG), abs=1e-4)


def test_model_error_widens_sigma(windows: Windows) -> None:
    likelihood = WindowedLikelihood(BODY, windows)
    sigmas = np.geomspace(0.5, 200, 30)
    # The poses of the fixture are a decimetre of noise: forty times what they are said to be.
    best = sigmas[int(np.argmax([log_density(likelihood, row(), sigma)[0] for sigma in sigmas]))]
    assert best > 5.0
