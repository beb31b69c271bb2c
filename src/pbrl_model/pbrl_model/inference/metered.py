"""A problem with its domain, and a count of the likelihood calls made."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pbrl_model.errors import ModelError
from pbrl_model.inference.problem import Domain, Problem, domain_of

Array = NDArray[np.float64]

SPREAD_DRAWS = 400
"""Prior draws by which the prior's spread is judged."""


@dataclass
class Metered:
    """Evaluates a problem and counts rows.

    Attributes:
        problem: to be evaluated.
        domain: of its theta.
        spread: (D,) scale of each column under the prior.
        calls: rows for which residuals or likelihood were computed.
    """

    problem: Problem
    spread: Array
    domain: Domain = field(init=False)
    calls: int = 0

    def __post_init__(self) -> None:
        self.domain = domain_of(self.problem)
        if len(self.problem.names) != self.domain.dimension:
            raise ModelError(
                f"problem: expected a name for each of {self.domain.dimension} columns, got {self.problem.names}"
            )

    @classmethod
    def of(cls, rng: np.random.Generator, problem: Problem) -> Metered:
        """Return a meter at zero.

        Raises:
            ModelError: the prior's draws do not fit the names, or are not finite.
        """
        draws = np.asarray(problem.sample_prior(rng, SPREAD_DRAWS), dtype=float)
        if draws.shape != (SPREAD_DRAWS, len(problem.names)) or not np.isfinite(draws).all():
            raise ModelError(
                f"problem: expected {SPREAD_DRAWS} finite prior draws of {len(problem.names)} columns, "
                f"got shape {draws.shape}"
            )
        # Half the middle 68 %: a log-normal's standard deviation would be that of its far tail.
        low, high = np.quantile(draws, [0.16, 0.84], axis=0)
        return cls(problem, np.maximum(0.5 * (high - low), 1e-12))

    def log_density(self, theta: Array) -> Array:
        """Return (P,) log of prior times likelihood; -inf outside the prior's support, where nothing is called."""
        out = np.array(self.problem.log_prior(theta), dtype=float)
        out[~self.domain.inside(theta)] = -np.inf
        legal = np.flatnonzero(np.isfinite(out))
        if len(legal):
            self.calls += len(legal)
            out[legal] += self.problem.log_likelihood(theta[legal])
        return np.where(np.isnan(out), -np.inf, out)

    def residuals(self, theta: Array, share: float) -> Array:
        """Return (P, M) residuals, see `Problem.residuals`."""
        self.calls += len(theta)
        return np.asarray(self.problem.residuals(theta, share), dtype=float)

    def posterior(self, theta: Array, residuals: Array) -> tuple[Array, Array]:
        """Return theta with the noise scale at its best, and (P,) log densities up to a constant.

        The best scale of Gaussian residuals is their root mean square (the prior on ln s is taken as flat for it).
        """
        column = self.problem.noise_column
        squares = np.einsum("pm,pm->p", residuals, residuals)
        out, count = theta, residuals.shape[1]
        if column is None:
            value = -0.5 * squares
        else:
            out = theta.copy()
            best = 0.5 * np.log(np.maximum(squares / max(count, 1), math.exp(-200.0)))
            out[:, column] = np.clip(best, *self.domain.bounds[:, column])
            value = -0.5 * squares * np.exp(-2.0 * out[:, column]) - count * out[:, column]
        value = value + self.problem.log_prior(out)
        return out, np.where(np.isfinite(value), value, -np.inf)
