"""Rivals: closed forms of what each of them regresses, and what they may and may not claim on a made-up recording."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pbrl_bringup.rivals import gaussian_process, lisdd, sindy
from pbrl_bringup.rivals.claim import Claim
from pbrl_bringup.rivals.run import RIVALS
from pbrl_bringup.rivals.samples import EVERY, Samples, cells_of, regimes_of

COUNT = 300


def states(rng: np.random.Generator) -> np.ndarray:
    """Return (n, 6) states of a body that goes forth and back and turns."""
    time = EVERY * np.arange(COUNT)
    x, y, theta = np.sin(0.5 * time), 0.5 * np.cos(0.8 * time), 0.7 * np.sin(0.3 * time)
    rates = [0.5 * np.cos(0.5 * time), -0.4 * np.sin(0.8 * time), 0.21 * np.cos(0.3 * time)]
    return np.column_stack([x, y, theta, *rates]) + 1e-3 * rng.standard_normal((COUNT, 6))


def given(wrench: np.ndarray, state: np.ndarray, sd: float = 0.1) -> Any:
    """Return what a rival is given, without a recording: nothing is held out."""
    samples = Samples(
        np.arange(COUNT), EVERY * np.arange(COUNT), state, state[:, None, :2].copy(), np.ones(COUNT, dtype=bool)
    )
    return SimpleNamespace(
        samples=samples,
        regimes=regimes_of(samples),
        wrench=wrench,
        sd=np.full((COUNT, 3), sd),
        open=np.ones(COUNT, dtype=bool),
        heldout=None,
    )


@pytest.mark.parametrize("name", ["Gaussian process", "SINDy", "LISDD"])
def test_a_wrench_that_is_there_half_the_time_is_claimed_there(name: str) -> None:
    rng = np.random.default_rng(2)
    state = states(rng)
    wrench = 0.1 * rng.standard_normal((COUNT, 3))
    acts = state[:, 0] > 0.2
    wrench[acts, 0] += 3.0
    found = RIVALS[name](given(wrench, state))
    claimed = np.zeros(COUNT, dtype=bool)
    for start, end in found.when:
        claimed |= (EVERY * np.arange(COUNT) >= start) & (EVERY * np.arange(COUNT) <= end)
    assert claimed[acts].mean() > 0.75, name
    assert claimed[acts].mean() > claimed[~acts].mean() + 0.3, name
    assert isinstance(found, Claim) and found.rival == name and np.isnan(found.heldout)


@pytest.mark.parametrize("name", ["Gaussian process", "SINDy", "LISDD"])
def test_noise_is_not_claimed_and_the_same_is_said_twice(name: str) -> None:
    rng = np.random.default_rng(4)
    state, wrench = states(rng), 0.1 * rng.standard_normal((COUNT, 3))
    one, other = RIVALS[name](given(wrench, state)), RIVALS[name](given(wrench, state))
    assert sum(end - start for start, end in one.when) < 0.1 * COUNT * EVERY
    assert (one.when, one.regimes, one.notes) == (other.when, other.regimes, other.notes)


def test_sindy_finds_the_law_that_made_the_wrench_and_no_other_term() -> None:
    rng = np.random.default_rng(1)
    state = states(rng)
    features = sindy.library(state)
    assert features.shape == (COUNT, len(sindy.NAMES))
    wrench = np.zeros((COUNT, 3))
    wrench[:, 0] = -8.0 * features[:, sindy.NAMES.index("u")]
    law = sindy.fit_law(state, wrench + 0.02 * rng.standard_normal((COUNT, 3)), np.full((COUNT, 3), 0.02))
    assert law.coefficients[sindy.NAMES.index("u"), 0] == pytest.approx(-8.0, rel=0.05)
    np.testing.assert_allclose(law.predict(state)[:, 0], wrench[:, 0], atol=0.1)
    assert np.count_nonzero(law.coefficients[:, 1:]) == 0


def test_a_gaussian_process_goes_through_what_is_sure_and_doubts_what_is_far() -> None:
    rng = np.random.default_rng(3)
    state = states(rng)
    wrench = np.column_stack([2.0 * np.sin(2.0 * state[:, 0]), state[:, 1], 0.0 * state[:, 0]])
    process = gaussian_process.fit_process(state[::3], wrench[::3], np.full((COUNT // 3, 3), 0.05))
    mean, sd = process.predict(state)
    assert np.sqrt(np.mean((mean - wrench) ** 2)) < 0.15
    far = state[:1] + np.array([[50.0, 50.0, 0.0, 0.0, 0.0, 0.0]])
    mean_far, sd_far = process.predict(far)
    assert np.all(sd_far[0, :2] > 3.0 * np.median(sd[:, :2], axis=0)) and np.all(np.abs(mean_far) < 0.5)
    gram = gaussian_process.kernel(process.log, process.inputs, process.inputs)
    np.testing.assert_allclose(gram, gram.T)
    assert np.linalg.eigvalsh(gram).min() > -1e-8 * np.linalg.eigvalsh(gram).max()


def test_discoveries_are_those_of_benjamini_and_hochberg() -> None:
    p_values = np.array([0.001, 0.008, 0.039, 0.041, 0.042, 0.06, 0.074, 0.205, 0.212, 0.216])
    assert lisdd.discoveries(p_values).tolist() == [True, True] + [False] * 8
    assert lisdd.discoveries(p_values[::-1]).sum() == 2
    assert not lisdd.discoveries(np.ones(5)).any() and lisdd.discoveries(np.zeros(5)).all()
    assert lisdd.discoveries(np.array([])).shape == (0,)


def test_the_split_f_test_is_level_on_noise_and_finds_the_structure() -> None:
    rng = np.random.default_rng(5)
    state = states(rng)[:40]
    sd = np.ones((40, 3))
    p_values = [lisdd.test_regime(state, rng.standard_normal((40, 3)), sd)[2] for _ in range(200)]
    assert np.mean(np.array(p_values) < 0.05) < 0.09
    truth = np.array([4.0, -3.0, 1.0])
    wrench = lisdd.design("constant in the world", state) @ truth + rng.standard_normal((40, 3))
    form, coefficients, p_value = lisdd.test_regime(state, wrench, sd)
    assert form == "constant in the world" and p_value < 1e-6
    np.testing.assert_allclose(coefficients, truth, atol=0.8)


def test_regimes_part_the_moving_samples() -> None:
    samples = given(np.zeros((COUNT, 3)), states(np.random.default_rng(0))).samples
    for axis, bins in regimes_of(samples).items():
        counted = np.sum(list(bins.values()), axis=0)
        assert np.all(counted >= 1) and (axis == "floor" or np.all(counted == 1))
    assert cells_of(np.array([[0.01, -0.01]])).tolist() == [[0, -1]]


def test_intervals_and_samples_are_there_and_back() -> None:
    samples = given(np.zeros((COUNT, 3)), states(np.random.default_rng(0))).samples
    chosen = np.zeros(COUNT, dtype=bool)
    chosen[10:20] = chosen[50] = True
    found = samples.intervals(chosen)
    assert len(found) == 2
    assert found[0] == pytest.approx((1.0, 1.9))
    assert np.array_equal(samples.inside(found), chosen)
