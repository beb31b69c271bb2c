"""Laws of sequential Monte Carlo: closed-form evidences, one go or in pieces, resampling, same seed same bytes."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_model.errors import ModelError
from pbrl_model.inference import smc
from pbrl_model.inference.cloud import Cloud, covariances, effective, normalised, resample, systematic

Array = NDArray[np.float64]

PARTICLES = 600
DIMENSION = 3
WIDTH = 2.0
"""Standard deviation of the prior in each column."""


def log_normal(x: Array, mean: Array, covariance: Array) -> Array:
    """Return (n,) log densities of rows."""
    white = np.linalg.solve(np.linalg.cholesky(covariance), (x - mean).T)
    _, log_det = np.linalg.slogdet(2 * np.pi * covariance)
    return -0.5 * np.sum(white**2, axis=0) - 0.5 * log_det


class Regression:
    """y = X theta + noise: prior, likelihood, posterior and evidence in closed form."""

    def __init__(self, rows: int = 40, noise: float = 0.3, seed: int = 0):
        rng = np.random.default_rng(seed)
        self.matrix = rng.normal(size=(rows, DIMENSION)) * [1.0, 0.3, 2.0]
        self.value = self.matrix @ [1.0, -2.0, 0.5] + noise * rng.normal(size=rows)
        self.noise = noise
        precision = np.eye(DIMENSION) / WIDTH**2 + self.matrix.T @ self.matrix / noise**2
        self.covariance = np.linalg.inv(precision)
        self.mean = self.covariance @ self.matrix.T @ self.value / noise**2
        marginal = WIDTH**2 * self.matrix @ self.matrix.T + noise**2 * np.eye(rows)
        self.log_evidence = float(log_normal(self.value[None], np.zeros(rows), marginal)[0])

    def prior(self, theta: Array) -> Array:
        return log_normal(theta, np.zeros(DIMENSION), WIDTH**2 * np.eye(DIMENSION))

    def likelihood(self, theta: Array, part: slice = slice(None)) -> Array:
        error = self.value[part] - theta @ self.matrix[part].T
        return -0.5 * np.sum((error / self.noise) ** 2 + np.log(2 * np.pi * self.noise**2), axis=1)

    def path(self, part: slice = slice(None), before: slice = slice(0, 0)) -> smc.Path:
        return lambda at, _: (self.prior(at) + self.likelihood(at, before), self.likelihood(at, part))


@pytest.fixture(scope="module")
def problem() -> Regression:
    return Regression()


def prior_cloud(rng: np.random.Generator, path: smc.Path) -> Cloud:
    return smc.init(path, WIDTH * rng.standard_normal((PARTICLES, DIMENSION)))


def in_pieces(problem: Regression, pieces: int, seed: int) -> Cloud:
    rng = np.random.default_rng(seed)
    edges = np.linspace(0, len(problem.value), pieces + 1).round().astype(int).tolist()
    first = problem.path(slice(0, edges[1]))
    cloud, _ = smc.run(rng, prior_cloud(rng, first), first)
    for start, stop in pairwise(edges[1:]):
        begin = smc.go_on(smc.settled(cloud), problem.likelihood(cloud.position, slice(start, stop)))
        cloud, _ = smc.run(rng, begin, problem.path(slice(start, stop), slice(0, start)))
    return cloud


def moments(cloud: Cloud) -> tuple[Array, Array]:
    mean = cloud.weight @ cloud.position
    centred = cloud.position - mean
    return mean, (centred * cloud.weight[:, None]).T @ centred


@pytest.mark.parametrize("pieces", [1, 4, 40], ids=["in one go", "in four", "row by row"])
def test_evidence_and_posterior_are_the_closed_form_s(problem: Regression, pieces: int) -> None:
    clouds = [in_pieces(problem, pieces, seed) for seed in range(3)]
    evidences = np.array([cloud.log_evidence for cloud in clouds])
    assert np.abs(evidences.mean() - problem.log_evidence) < 0.3
    mean = np.mean([moments(cloud)[0] for cloud in clouds], axis=0)
    spread = np.sqrt(np.diag(problem.covariance))
    assert np.all(np.abs(mean - problem.mean) < 0.2 * spread)
    deviation = np.sqrt(np.mean([np.diag(moments(cloud)[1]) for cloud in clouds], axis=0))
    np.testing.assert_allclose(deviation, spread, rtol=0.15)


def test_a_cheap_density_that_is_wrong_changes_nothing_but_the_work(problem: Regression) -> None:
    path = problem.path()

    def cheap(at: Array, group: NDArray[np.int64]) -> tuple[Array, Array]:
        base, gain = path(at, group)
        return base, gain - 0.5 * ((at - problem.mean - 0.02) ** 2 / (4 * np.diag(problem.covariance))).sum(axis=1)

    means, evidences = [], []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        cloud, infos = smc.run(rng, prior_cloud(rng, path), path, cheap=cheap)
        means.append(moments(cloud)[0])
        evidences.append(cloud.log_evidence)
        assert all(0.2 < info.acceptance < 1.0 for info in infos if info.resampled)
    assert np.all(np.abs(np.mean(means, axis=0) - problem.mean) < 0.2 * np.sqrt(np.diag(problem.covariance)))
    assert np.abs(np.mean(evidences) - problem.log_evidence) < 0.3


def test_two_modes_keep_their_shares_and_their_own_steps() -> None:
    centres = np.array([[-6.0, 0.0], [6.0, 1.0]])
    spreads = [np.diag([1.0, 0.01]), np.diag([0.01, 1.0])]

    def target(at: Array) -> Array:
        return np.logaddexp(*(np.log(0.5) + log_normal(at, c, s) for c, s in zip(centres, spreads, strict=True)))

    def start(at: Array) -> Array:
        return np.logaddexp(*(np.log(0.5) + log_normal(at, c, 4.0 * np.eye(2)) for c in centres))

    def path(at: Array, _: NDArray[np.int64]) -> tuple[Array, Array]:
        return start(at), target(at) - start(at)

    rng = np.random.default_rng(1)
    group = np.repeat([0, 1], PARTICLES // 2)
    cloud, infos = smc.run(rng, smc.init(path, centres[group] + 2.0 * rng.standard_normal((PARTICLES, 2)), group), path)
    assert np.abs(cloud.log_evidence) < 0.3
    assert np.abs(cloud.weight[cloud.group == 0].sum() - 0.5) < 0.1
    assert min(info.acceptance for info in infos if info.resampled) > 0.1
    own = covariances(cloud.position, cloud.weight, cloud.group)
    for number, spread in enumerate(spreads):
        np.testing.assert_allclose(np.sqrt(np.diag(own[number])), np.sqrt(np.diag(spread)), rtol=0.3)


def test_systematic_resampling_gives_each_its_share_to_within_one() -> None:
    rng = np.random.default_rng(2)
    weight = rng.dirichlet(np.ones(7))
    counts = np.array([np.bincount(systematic(rng, weight, 50), minlength=7) for _ in range(300)])
    assert np.all(counts.sum(axis=1) == 50)
    assert np.all(np.abs(counts - 50 * weight) < 1.0)
    np.testing.assert_allclose(counts.mean(axis=0), 50 * weight, atol=0.15)
    assert systematic(rng, np.array([0.0, 1.0, 0.0]), 3).tolist() == [1, 1, 1]


def test_effective_size_counts_equal_particles() -> None:
    assert effective(np.full(20, -3.0)) == pytest.approx(20.0)
    assert effective(np.array([0.0, -np.inf, -np.inf])) == pytest.approx(1.0)
    assert effective(np.full(3, -np.inf)) == 0.0
    log_weight, total = normalised(np.array([0.0, np.log(3.0), -np.inf]))
    assert total == pytest.approx(np.log(4.0))
    np.testing.assert_allclose(np.exp(log_weight), [0.25, 0.75, 0.0])


def test_temperatures_leave_the_wanted_share(problem: Regression) -> None:
    rng = np.random.default_rng(3)
    options = smc.Options(keep=0.7)
    cloud = prior_cloud(rng, problem.path())
    reached = smc.reweight(cloud, smc.next_temperature(cloud, options))
    assert 0.0 < reached.temperature < 1.0
    assert reached.ess == pytest.approx(0.7 * PARTICLES, rel=1e-3)


def test_same_seed_same_bytes(problem: Regression) -> None:
    first, second, other = (in_pieces(problem, 3, seed) for seed in (5, 5, 6))
    assert first.position.tobytes() == second.position.tobytes() != other.position.tobytes()
    assert first.log_weight.tobytes() == second.log_weight.tobytes()


def test_resampling_keeps_what_belongs_together(problem: Regression) -> None:
    rng = np.random.default_rng(4)
    path = problem.path()
    cloud = resample(rng, smc.reweight(prior_cloud(rng, path), 0.01))
    base, gain = path(cloud.position, cloud.group)
    np.testing.assert_allclose(cloud.base, base)
    np.testing.assert_allclose(cloud.gain, gain)
    assert cloud.ess == pytest.approx(PARTICLES)


def wrong(fields: dict[str, float]) -> Callable[[], object]:
    return lambda: smc.Options(**fields)  # type: ignore[arg-type]


@pytest.mark.parametrize("fields", [{"keep": 0.0}, {"keep": 1.5}, {"most_sweeps": 0}, {"wanted_moves": float("nan")}])
def test_options_out_of_range_are_refused(fields: dict[str, float]) -> None:
    with pytest.raises(ModelError, match="smc: expected"):
        wrong(fields)()


def test_hostile_densities_are_said_to_be_so() -> None:
    at = np.zeros((4, 2))
    nothing = (np.zeros(4), np.full(4, -np.inf))
    with pytest.raises(ModelError, match="prior excludes them"):
        smc.run(np.random.default_rng(0), smc.init(lambda *_: nothing, at), lambda *_: nothing)
    broken = (np.zeros(4), np.full(4, np.nan))
    with pytest.raises(ModelError, match="prior excludes them"):
        smc.run(np.random.default_rng(0), smc.init(lambda *_: broken, at), lambda *_: broken)
    with pytest.raises(ModelError, match="positive density at the start, got 4"):
        smc.init(lambda *_: (np.full(4, np.nan), np.zeros(4)), at)
    with pytest.raises(ModelError, match="at least two particles"):
        smc.init(lambda *_: (np.zeros(1), np.zeros(1)), np.zeros((1, 2)))
    with pytest.raises(ModelError, match="temperature 1"):
        smc.go_on(smc.init(lambda *_: (np.zeros(4), np.zeros(4)), at), np.zeros(4))
