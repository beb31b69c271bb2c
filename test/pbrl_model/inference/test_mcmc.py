"""Metropolis: a known Gaussian's moments, detailed balance once frozen, same seed same bytes."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_model.errors import ModelError
from pbrl_model.inference import mcmc

MEAN = np.array([1.0, -2.0, 0.5])
COVARIANCE = np.array([[1.0, 0.8, 0.0], [0.8, 1.0, 0.2], [0.0, 0.2, 0.3]])
PRECISION = np.linalg.inv(COVARIANCE)
BLOCKS = (mcmc.Block((0, 1)), mcmc.Block((2,)))


def gaussian(position: np.ndarray, memo: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    offset = position - MEAN
    return -0.5 * np.einsum("ci,ij,cj->c", offset, PRECISION, offset), np.zeros((len(position), 1))


def sample(seed: int, burn_in: int = 400, draws: int = 3000) -> mcmc.Chains:
    start = np.tile([3.0, 3.0, 3.0], (4, 1))
    state = mcmc.init(gaussian, start, np.tile(0.01 * np.eye(3), (4, 1, 1)), BLOCKS)
    return mcmc.run(np.random.default_rng(seed), state, gaussian, BLOCKS, burn_in=burn_in, draws=draws)


def test_moments_of_a_known_gaussian() -> None:
    draws = sample(0).position.reshape(-1, 3)
    np.testing.assert_allclose(draws.mean(0), MEAN, atol=0.12)
    np.testing.assert_allclose(np.cov(draws.T), COVARIANCE, atol=0.15)


def test_frozen_block_is_reversible() -> None:
    # Detailed balance: the law of (x, x') is that of (x', x), for any pair of functions of them.
    block = (mcmc.Block((0, 1, 2)),)
    start = np.tile(MEAN, (40, 1))
    state = mcmc.freeze(mcmc.init(gaussian, start, np.tile(COVARIANCE, (40, 1, 1)), block))
    chains = mcmc.run(np.random.default_rng(1), state, gaussian, block, burn_in=0, draws=1500)
    now, following = chains.position[:, :-1], chains.position[:, 1:]
    for f, g in ((np.sin, lambda x: x**3), (lambda x: x, np.cos), (lambda x: x > 1, lambda x: x**2)):
        by_chain = np.mean(f(now[..., 0]) * g(following[..., 1]) - g(now[..., 1]) * f(following[..., 0]), axis=1)
        assert abs(by_chain.mean()) < 4 * by_chain.std() / np.sqrt(len(by_chain))


def test_one_block_keeps_detailed_balance_on_the_line() -> None:
    # Flow from left to right of any cut equals the flow back, here for three cuts at once (cell to cell).
    def normal(position: np.ndarray, memo: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        return -0.5 * position[:, 0] ** 2, np.zeros((len(position), 1))

    block = (mcmc.Block((0,)),)
    state = mcmc.freeze(mcmc.init(normal, np.zeros((50, 1)), np.ones((50, 1, 1)), block))
    chains = mcmc.run(np.random.default_rng(3), state, normal, block, burn_in=0, draws=2000)
    cell = np.digitize(chains.position[..., 0], [-1.0, 0.0, 1.0])
    flow = np.zeros((4, 4))
    np.add.at(flow, (cell[:, :-1].ravel(), cell[:, 1:].ravel()), 1)
    for a in range(4):
        for b in range(a):
            assert abs(flow[a, b] - flow[b, a]) < 5 * np.sqrt(flow[a, b] + flow[b, a])


def test_adaptation_ends_with_freeze() -> None:
    rng = np.random.default_rng(0)
    state = mcmc.freeze(mcmc.init(gaussian, np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)), BLOCKS))
    after = state
    for _ in range(20):
        after, _ = mcmc.step(rng, after, gaussian, BLOCKS)
    np.testing.assert_array_equal(after.covariance, state.covariance)
    np.testing.assert_array_equal(after.log_scale, state.log_scale)
    assert np.any(after.position != state.position)


def test_step_leaves_its_argument_alone() -> None:
    state = mcmc.init(gaussian, np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)), BLOCKS)
    before = state.position.copy(), state.covariance.copy(), state.log_scale.copy()
    mcmc.step(np.random.default_rng(0), state, gaussian, BLOCKS)
    for kept, now in zip(before, (state.position, state.covariance, state.log_scale), strict=True):
        np.testing.assert_array_equal(kept, now)


def test_same_seed_same_bytes() -> None:
    assert sample(5, 50, 50).position.tobytes() == sample(5, 50, 50).position.tobytes()
    assert sample(5, 50, 50).position.tobytes() != sample(6, 50, 50).position.tobytes()


def test_memo_follows_the_position() -> None:
    # A density that costs: its memo is the position itself. A block that keeps the memo must not change it.
    def density(position: np.ndarray, memo: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        memo = position[:, :1].copy() if memo is None else memo
        np.testing.assert_array_equal(memo[:, 0], position[:, 0])
        return gaussian(position, None)[0], memo

    blocks = (mcmc.Block((0,)), mcmc.Block((1, 2), keeps_memo=True))
    state = mcmc.init(density, np.zeros((3, 3)), np.tile(np.eye(3), (3, 1, 1)), blocks)
    rng = np.random.default_rng(0)
    for _ in range(200):
        state, _ = mcmc.step(rng, state, density, blocks)
        np.testing.assert_array_equal(state.memo[:, 0], state.position[:, 0])


def test_a_start_without_density_is_refused() -> None:
    def nowhere(position: np.ndarray, memo: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        return np.full(len(position), -np.inf), np.zeros((len(position), 1))

    with pytest.raises(ModelError, match="positive density"):
        mcmc.init(nowhere, np.zeros((2, 1)), np.ones((2, 1, 1)), (mcmc.Block((0,)),))
