"""Have the chains arrived? Effective sample size and split R-hat, through ArviZ; NaN where they cannot tell.

Angles are looked at through the cosine and sine of their whole period, the worse of the two counting, for a chain
that crosses the cut would otherwise seem not to mix. Wheels are taken as their representatives: a chain that
sits in one of several descriptions of the same wheel has not missed anything.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_model.arviz_import import az
from pbrl_model.parameters import ANGLES
from pbrl_model.posterior import Posterior
from pbrl_model.symmetry import THETA_PERIOD

Array = NDArray[np.float64]

MIN_DRAWS = 8  # a chain: each half needs a few for a variance
CONVERGED_RHAT = 1.01
CONVERGED_ESS = 400.0


@dataclass(frozen=True)
class Convergence:
    """What the chains say of one parameter.

    Attributes:
        ess: bulk effective sample size; NaN where chains are too short or stand still.
        rhat: split, rank-normalised R-hat; NaN for a single chain as well.
    """

    ess: float
    rhat: float

    @property
    def arrived(self) -> bool | None:
        """Tell whether the usual thresholds are met (R-hat below 1.01, 400 samples); None: cannot tell."""
        if np.isnan(self.rhat) or np.isnan(self.ess):
            return None
        return self.rhat < CONVERGED_RHAT and self.ess > CONVERGED_ESS


def effective_sample_size(chains: Array) -> float:
    """Return the bulk effective sample size of draws (chains, n); NaN where it cannot be told.

    ArviZ calls a chain that never moved a perfect one; here it is NaN, as are chains of fewer than `MIN_DRAWS` draws.
    """
    draws = np.atleast_2d(np.asarray(chains, dtype=float))
    if not _tells(draws):
        return float("nan")
    return float(az().ess(draws, method="bulk"))


def split_rhat(chains: Array) -> float:
    """Return the split R-hat of draws (chains, n); NaN for one chain or where it cannot be told."""
    draws = np.atleast_2d(np.asarray(chains, dtype=float))
    if draws.shape[0] < 2 or not _tells(draws):
        return float("nan")
    return float(az().rhat(draws, method="rank"))


def convergence(posterior: Posterior) -> dict[str, Convergence]:
    """Return what the chains say of each parameter."""
    canonical = posterior.canonical()
    return {
        name: Convergence(
            _worst(effective_sample_size, np.min, name, canonical.column(name)),
            _worst(split_rhat, np.max, name, canonical.column(name)),
        )
        for name in posterior.names
    }


def _worst(measure: Callable[[Array], float], choose: Callable[..., Any], name: str, chains: Array) -> float:
    if name not in ANGLES:
        return measure(chains)
    turn = 2.0 * np.pi * chains / THETA_PERIOD
    return float(choose([measure(np.cos(turn)), measure(np.sin(turn))]))


def _tells(draws: Array) -> bool:
    """Tell whether every chain is long enough, finite, and moves."""
    return bool(draws.shape[1] >= MIN_DRAWS and np.isfinite(draws).all() and np.all(np.ptp(draws, axis=1) > 0.0))
