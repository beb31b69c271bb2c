"""Simulation-based calibration (Talts et al. 2018), which tells whether posteriors are as wide as they should be.

Draw a truth from the prior and data from the truth, infer, and rank the truth among posterior draws. If the inference
is right, whatever the model, the rank of every parameter is uniform on 0..L over many such trials: draws that are too
narrow put ranks at both ends, a bias tilts them. Running (`rank_among`, by whoever knows the problem) and judging
(`judge`) are apart, so that ranks of long runs can be kept and looked at again.

A wheel has several descriptions: ranks are taken among representatives (`symmetry.canonical_wheel`), truth and draws
alike, for the rank of any function of the parameters is uniform.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom, chi2

from pbrl_model.errors import ModelError

Array = NDArray[np.float64]
Index = NDArray[np.int64]

LEAST_TRIALS = 20
"""With fewer trials nothing can be said."""
A_BIN = 8
"""Trials expected in each bin of a histogram, at least."""
SIMULATIONS = 2000
"""Uniform samples that the ECDF's deviation is compared with."""


@dataclass(frozen=True)
class Ranks:
    """What a run of trials left.

    Attributes:
        names: K parameters.
        rank: (T, K) how many of the draws lie below the truth, 0..draws.
        draws: L of each trial.
    """

    names: tuple[str, ...]
    rank: Index
    draws: int

    def __post_init__(self) -> None:
        rank = np.asarray(self.rank)
        if rank.ndim != 2 or rank.shape[1] != len(self.names):
            raise ModelError(f"ranks: expected (trials, {len(self.names)}), got shape {rank.shape}")
        if rank.size and (rank.min() < 0 or rank.max() > self.draws):
            raise ModelError(f"ranks: expected 0..{self.draws}, got {rank.min()}..{rank.max()}")

    @property
    def trials(self) -> int:
        """Return how many there were."""
        return len(self.rank)

    @property
    def bins(self) -> int:
        """Return how many bins a histogram has: divisors of L + 1 keep them equally likely."""
        most = max(self.trials // A_BIN, 2)
        return max(count for count in range(1, self.draws + 2) if (self.draws + 1) % count == 0 and count <= most)

    def histogram(self) -> Index:
        """Return (K, bins) counts."""
        width = (self.draws + 1) // self.bins
        return np.stack([np.bincount(column // width, minlength=self.bins) for column in self.rank.T])


@dataclass(frozen=True)
class Uniformity:
    """What the ranks of one parameter say.

    Attributes:
        p_histogram: chi-square over the bins.
        p_ecdf: of the largest deviation of the empirical distribution anywhere (Sailynoja et al. 2022), which sees
            small shifts and widths that bins do not.
        centre: mean rank over L, 0.5 where there is no bias.
        spread: standard deviation of the rank over that of a uniform one: above 1 posteriors are too narrow.
    """

    p_histogram: float
    p_ecdf: float
    centre: float
    spread: float

    @property
    def p(self) -> float:
        """Return the smaller of the two, times two (Bonferroni), at most 1."""
        return min(2.0 * min(self.p_histogram, self.p_ecdf), 1.0)


def rank_among(rng: np.random.Generator, truth: Array, draws: Array) -> Index:
    """Return (K,) how many draws (L, K) lie below the truth (K,); draws that equal it count by the toss of a coin."""
    below = np.sum(draws < truth, axis=0)
    same = np.sum(draws == truth, axis=0)
    return below + rng.integers(0, same + 1)


def judge(ranks: Ranks, rng: np.random.Generator) -> dict[str, Uniformity]:
    """Return what the ranks say of each parameter; NaN where there are too few trials to tell.

    Args:
        ranks: of a run.
        rng: source of the uniform samples that are compared with.
    """
    if ranks.trials < LEAST_TRIALS:
        nothing = Uniformity(np.nan, np.nan, np.nan, np.nan)
        return dict.fromkeys(ranks.names, nothing)
    uniform = rng.integers(0, ranks.draws + 1, size=(SIMULATIONS, ranks.trials))
    reference = np.sort(least_tail(uniform, ranks.draws))
    expected = ranks.trials / ranks.bins
    out = {}
    for name, column, counts in zip(ranks.names, ranks.rank.T, ranks.histogram(), strict=True):
        statistic = float(np.sum((counts - expected) ** 2 / expected))
        found = least_tail(column[None], ranks.draws)[0]
        beyond = int(np.searchsorted(reference, found * (1.0 + 1e-9), side="right"))
        spread = float(column.std() / np.sqrt(((ranks.draws + 1) ** 2 - 1) / 12.0))
        out[name] = Uniformity(
            float(chi2.sf(statistic, ranks.bins - 1)),
            (beyond + 1) / (SIMULATIONS + 1),
            float(column.mean() / ranks.draws),
            spread,
        )
    return out


def least_tail(ranks: Index, draws: int) -> Array:
    """Return (S,) the least probability, over all places, of an empirical distribution as far off as that of ranks.

    Args:
        ranks: (S, T) in 0..draws.
        draws: L.
    """
    trials = ranks.shape[1]
    counts = np.stack([np.bincount(row, minlength=draws + 1) for row in ranks])
    below = np.cumsum(counts, axis=1)[:, :-1]  # at the last place everything is below
    share = np.arange(1, draws + 1) / (draws + 1)
    lower, upper = binom.cdf(below, trials, share), binom.sf(below - 1, trials, share)
    return np.asarray(2.0 * np.minimum(lower, upper).min(axis=1))
