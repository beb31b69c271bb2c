"""The likelihood along a path is the Gaussian that it claims to be, and the evidence its integral."""

from __future__ import annotations

import math

import numpy as np
import pytest
from doors_pulled import bump, noise, opened, pulled
from scipy.stats import multivariate_normal

from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.joint.evidence import SENSOR_FLOOR, TEXTURE_LENGTH, Hypothesis, Problem, checked, explained
from pbrl_mismatch.joint.laws import LAWS, laws_of
from pbrl_mismatch.joint.pull import senses
from pbrl_mismatch.joint.search import baseline_of
from pbrl_mismatch.joint.texture_kernel import whitened


@pytest.mark.parametrize(("sensor", "spread", "length"), [(0.1, 0.5, 0.05), (0.01, 1.0, 1.0), (0.3, 0.0, 0.1)])
def test_whitened_series_have_the_closed_form_density(sensor: float, spread: float, length: float) -> None:
    rng = np.random.default_rng(1)
    step = rng.uniform(0.001, 0.05, 40)
    step[[0, 17]] = np.inf  # two pulls: nothing is carried from one into the other
    pull = np.cumsum(np.isinf(step))
    way = np.cumsum(np.where(np.isinf(step), 0.0, step))
    away = np.where(pull[:, None] == pull[None], np.abs(way[:, None] - way[None]), np.inf)
    covariance = spread**2 * np.exp(-away / length) + sensor**2 * np.eye(40)
    series = rng.standard_normal((40, 2))
    white = np.empty_like(series)
    half = whitened(series, step, sensor, spread, length, white)
    assert half == pytest.approx(0.5 * np.linalg.slogdet(covariance)[1], rel=1e-9)
    assert white.T @ white == pytest.approx(series.T @ np.linalg.solve(covariance, series), rel=1e-8)


def test_strengths_are_integrated_out_in_closed_form() -> None:
    angle = opened(40.0, 0.5)
    pull = pulled(0.5 + noise(np.random.default_rng(2), angle), angle)
    problem = Problem(pull, Hypothesis(()))
    at = problem.mean
    covariance = math.exp(at[0]) ** 2 * np.exp(-np.abs(angle[:, None] - angle[None]) / TEXTURE_LENGTH)
    covariance += SENSOR_FLOOR**2 * np.eye(len(angle))
    grid = np.linspace(0.0, 4.0, 2001)
    gaussian = multivariate_normal(cov=covariance)
    density = np.array([gaussian.logpdf(pull.force - each) for each in grid])
    prior = math.log(2.0) - 0.5 * (grid / pull.strength) ** 2 - math.log(pull.strength * math.sqrt(2.0 * math.pi))
    top = (density + prior).max()
    expected = top + math.log(np.trapezoid(np.exp(density + prior - top), grid))
    assert problem.solved(at).log_likelihood == pytest.approx(expected, abs=1e-3)


def test_evidence_by_laplace_and_by_samples_is_that_of_quadrature() -> None:
    angle = opened(60.0)
    pull = pulled(0.5 + noise(np.random.default_rng(3), angle), angle)
    found = baseline_of(pull)
    problem = found.problem
    grid = np.linspace(problem.mean[0] - 8.0, problem.mean[0] + 8.0, 2001)
    density = np.array([problem.log_density(np.array([each])) for each in grid])
    expected = density.max() + math.log(np.trapezoid(np.exp(density - density.max()), grid))
    sampled = checked(np.random.default_rng(0), found)
    assert found.settled and found.evidence == pytest.approx(expected, abs=0.1)
    assert abs(sampled.evidence - expected) < 5.0 * sampled.checked + 1e-3


@pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.effect}-{law.form}")
def test_every_law_recovers_its_own_strength(law: object) -> None:
    assert isinstance(law, type(LAWS[0]))
    angle = opened()
    rng = np.random.default_rng(4)
    blank = pulled(np.ones(len(angle)), angle)
    values = law.starts(blank)[len(law.starts(blank)) // 2]
    shape = law.shape(blank, values)
    if law.multiplies:
        pull = pulled(3.0 * shape[:, 0] + noise(rng, angle), angle)
    else:
        pull = pulled(0.5 + shape @ np.full(shape.shape[1], 3.0 / np.abs(shape).max()) + noise(rng, angle), angle)
    problem = Problem(pull, Hypothesis((law,)))
    unknowns = law.unknowns(pull)
    told = [math.log(value) if each.positive else value for each, value in zip(unknowns, values, strict=True)]
    start = np.array([[*told, math.log(0.2)]])
    found = explained(problem, start)
    left = pull.force - found.law_force(pull)
    assert float(np.sqrt(np.mean(left**2))) < 0.45
    assert found.evidence > baseline_of(pull).evidence


def test_a_sense_turns_only_after_a_clear_way_back() -> None:
    there = np.radians([0.0, 1.0, 2.0, 1.8, 3.0, 4.0, 3.0, 2.0, 2.3, 1.0])
    assert senses(there).tolist() == [1, 1, 1, 1, 1, 1, -1, -1, -1, -1]


def test_what_is_left_of_the_way_keeps_its_own_travel() -> None:
    angle = opened(30.0)
    pull = pulled(bump(angle, 10.0, 2.0), angle)
    part = pull.take(angle > np.radians(10.0))
    assert part.travelled[0] > np.radians(9.5) and np.isinf(part.step[0]) and np.isfinite(part.step[1:]).all()


def test_a_library_of_nothing_is_refused() -> None:
    with pytest.raises(MismatchError, match="expected at least one effect"):
        laws_of(tuple(law.effect for law in LAWS))
