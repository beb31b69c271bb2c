"""Block-wise adaptive Metropolis, several chains in step (thesis 5.3.2: object by object, sigma its own block).

`init` and `step` are pure: state in, state and info out, randomness passed in. All chains propose at once, so that
one kernel call serves them all. Each chain has its own proposal, a Gaussian with the covariance of what it has seen,
scaled towards the acceptance that is best for a Gaussian target (Roberts and Rosenthal 2009). Adaptation is a flag of
the state: after `freeze` the chain is plain Metropolis and keeps detailed balance.

Where the density is dear, a cheap one near it can go before it: only proposals that the cheap one takes are judged by
the exact one, for what the two differ in (delayed acceptance, Christen and Fox 2005). The chain is then one of the
exact density.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_model.errors import ModelError

Array = NDArray[np.float64]
LogDensity = Callable[[Array, Array | None], tuple[Array, Array]]
"""(positions (C, D), memo or None) -> (log densities (C,), memo (C, ...)). See `FrozenTarget.density`."""

ExactDensity = Callable[[Array, NDArray[np.int64]], Array]
"""(positions (R, D), their chains (R,)) -> log densities (R,)."""

WANTED = {1: 0.44, 2: 0.35}
WANTED_MANY = 0.25
"""Acceptance to aim at, by the size of the block."""
SMALL_STEP = 0.1
"""Share of proposals that are ten times smaller: the way out of a corner where large ones all fail."""


@dataclass(frozen=True)
class Block:
    """Columns that move together.

    Attributes:
        columns: of the position.
        keeps_memo: whether a move of these alone leaves the memo as it is.
    """

    columns: tuple[int, ...]
    keeps_memo: bool = False


@dataclass(frozen=True)
class State:
    """What the next step needs.

    Attributes:
        position: (C, D).
        log_density: (C,).
        memo: (C, ...) what the density remembers of the position.
        mean: (C, D) running mean.
        covariance: (C, D, D) running covariance.
        log_scale: (C, B) of each block's proposal.
        count: steps done while adapting.
        adapting: whether steps still adapt.
        exact: (C,) exact log densities where `log_density` is a cheap one's, else None.
    """

    position: Array
    log_density: Array
    memo: Array
    mean: Array
    covariance: Array
    log_scale: Array
    count: int
    adapting: bool
    exact: Array | None = None


@dataclass(frozen=True)
class Info:
    """What a human needs: (C, B) whether each block's proposal was taken."""

    accepted: NDArray[np.bool_]


def init(
    density: LogDensity,
    position: Array,
    covariance: Array,
    blocks: Sequence[Block],
    exact: ExactDensity | None = None,
) -> State:
    """Return the first state.

    Args:
        density: log density.
        position: (C, D).
        covariance: (C, D, D) first guess of the target's covariance around each.
        blocks: that together cover the columns.
        exact: where `density` only goes before it.

    Raises:
        ModelError: a chain starts where the density is zero.
    """
    log_density, memo = density(position, None)
    value = None if exact is None else exact(position, np.arange(len(position)))
    if not np.all(np.isfinite(log_density if value is None else value)):
        raise ModelError(
            f"chains: expected starts of positive density, got {np.sum(~np.isfinite(log_density))} without"
        )
    scale = np.log([[2.38 / np.sqrt(len(block.columns)) for block in blocks]] * len(position))
    return State(position.copy(), log_density, memo, position.copy(), covariance.copy(), scale, 0, True, value)


def freeze(state: State) -> State:
    """Return the state with adaptation ended: from here on samples count."""
    return replace(state, adapting=False)


def step(
    rng: np.random.Generator,
    state: State,
    density: LogDensity,
    blocks: Sequence[Block],
    exact: ExactDensity | None = None,
) -> tuple[State, Info]:
    """Move every block of every chain once.

    Args:
        rng: source of randomness.
        state: of all chains.
        density: log density.
        blocks: as given to `init`.
        exact: as given to `init`.
    """
    accepted = np.zeros((len(state.position), len(blocks)), dtype=bool)
    log_scale = state.log_scale.copy()
    for b, block in enumerate(blocks):
        state, taken, probability = _move(rng, state, density, block, np.exp(state.log_scale[:, b]), exact)
        accepted[:, b] = taken
        if state.adapting:
            wanted = WANTED.get(len(block.columns), WANTED_MANY)
            log_scale[:, b] += (probability - wanted) * min(1.0, 3.0 / np.sqrt(state.count + 1.0))
    if state.adapting:
        state = _learn(replace(state, log_scale=log_scale))
    return state, Info(accepted)


def _move(
    rng: np.random.Generator,
    state: State,
    density: LogDensity,
    block: Block,
    scale: Array,
    exact: ExactDensity | None,
) -> tuple[State, NDArray[np.bool_], Array]:
    """Propose and accept or reject one block in every chain; return (state, taken, acceptance probability)."""
    columns = list(block.columns)
    chains = len(state.position)
    factor = np.linalg.cholesky(state.covariance[:, columns][:, :, columns])
    noise = rng.standard_normal((chains, len(columns)))
    shrink = np.where(rng.random(chains) < SMALL_STEP, 0.1, 1.0)
    luck = np.log(rng.random(chains))
    proposal = state.position.copy()
    proposal[:, columns] += (scale * shrink)[:, None] * (factor @ noise[..., None])[..., 0]
    log_density, memo = density(proposal, state.memo if block.keeps_memo else None)
    gain = log_density - state.log_density
    taken = luck < gain
    probability = np.exp(np.minimum(gain, 0.0))
    value = known = state.exact
    if exact is not None and known is not None:
        chosen, again = np.flatnonzero(taken), np.log(rng.random(chains))
        value = np.full(chains, -np.inf)
        if len(chosen):
            value[chosen] = exact(proposal[chosen], chosen)
        taken = taken & (again < value - known - np.where(taken, gain, 0.0))
        value, probability = np.where(taken, value, known), taken.astype(float)
    shaped = taken.reshape(-1, *([1] * (memo.ndim - 1)))
    moved = replace(
        state,
        position=np.where(taken[:, None], proposal, state.position),
        log_density=np.where(taken, log_density, state.log_density),
        memo=state.memo if block.keeps_memo else np.where(shaped, memo, state.memo),
        exact=value,
    )
    return moved, taken, probability


def _learn(state: State) -> State:
    """Update running mean and covariance; the first guess counts as a hundred steps."""
    weight = 1.0 / (100.0 + state.count)
    difference = state.position - state.mean
    mean = state.mean + weight * difference
    outer = difference[:, :, None] * (state.position - mean)[:, None, :]
    return replace(state, mean=mean, covariance=(1 - weight) * state.covariance + weight * outer, count=state.count + 1)


@dataclass(frozen=True)
class Chains:
    """Samples after burn-in.

    Attributes:
        position: (C, n, D).
        log_density: (C, n).
        acceptance: (C, B) share of proposals taken after burn-in.
    """

    position: Array
    log_density: Array
    acceptance: Array


def run(
    rng: np.random.Generator,
    state: State,
    density: LogDensity,
    blocks: Sequence[Block],
    *,
    burn_in: int,
    draws: int,
    thin: int = 1,
    exact: ExactDensity | None = None,
) -> Chains:
    """Adapt for `burn_in` steps, freeze, and keep every `thin`-th of the rest."""
    for _ in range(burn_in):
        state, _ = step(rng, state, density, blocks, exact)
    state = freeze(state)
    positions, densities, taken = [], [], []
    for k in range(draws * thin):
        state, info = step(rng, state, density, blocks, exact)
        taken.append(info.accepted)
        if (k + 1) % thin == 0:
            positions.append(state.position)
            densities.append(state.log_density if state.exact is None else state.exact)
    return Chains(np.stack(positions, 1), np.stack(densities, 1), np.mean(taken, axis=0))
