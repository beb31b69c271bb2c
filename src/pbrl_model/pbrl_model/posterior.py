"""A posterior over the physics of one object: draws with names and units, and what is reported of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_model.errors import ModelError
from pbrl_model.parameters import ANGLES, UNITS, BodyParameters, column_indices, expand, free_columns
from pbrl_model.symmetry import THETA_PERIOD, canonical_wheel, circular_mean, circular_sd

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Posterior:
    """Draws from the posterior of one object.

    Attributes:
        object: name of the body.
        model_class: "free", "wheel", "wheel+ground" or "hinge".
        names: K names among `KERNEL_COLUMNS`.
        draws: (chains, n, K), read-only.
        base: values of the parameters that were not learned.
        log_evidence: [nat]; NaN where it was not computed or did not converge.
        log_evidence_sd: its standard error [nat]; NaN likewise.
        ess: effective samples behind the draws, where they were weighted; NaN for chains, which are asked themselves.
        heldout_rmse: position error on windows left out of the fit [m]; NaN where none were.
        notes: what the data do not say, in sentences.
    """

    object: str
    model_class: str
    names: tuple[str, ...]
    draws: Array
    base: BodyParameters = field(default_factory=lambda: BodyParameters(mass=1.0))
    log_evidence: float = math.nan
    heldout_rmse: float = math.nan
    notes: tuple[str, ...] = ()
    log_evidence_sd: float = math.nan
    ess: float = math.nan

    def __post_init__(self) -> None:
        draws = np.array(self.draws, dtype=float)
        free_columns(self.model_class)
        column_indices(self.names)
        if draws.ndim != 3 or draws.shape[2] != len(self.names) or draws.shape[0] * draws.shape[1] == 0:
            raise ModelError(
                f"posterior of {self.object!r}: expected draws (chains, n, {len(self.names)}), got {draws.shape}"
            )
        if not np.isfinite(draws).all():
            raise ModelError(f"posterior of {self.object!r}: expected finite draws, got NaN or infinity")
        draws.flags.writeable = False
        object.__setattr__(self, "draws", draws)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the parameters, in order."""
        return tuple(UNITS[name] for name in self.names)

    @property
    def flat(self) -> Array:
        """All chains one after another, (chains * n, K)."""
        return self.draws.reshape(-1, len(self.names))

    def column(self, name: str) -> Array:
        """Return the draws (chains, n) of one parameter.

        Raises:
            ModelError: it was not learned.
        """
        if name not in self.names:
            raise ModelError(f"posterior of {self.object!r}: expected one of {', '.join(self.names)}, got {name!r}")
        return self.draws[..., self.names.index(name)]

    def rows(self) -> Array:
        """Return every draw as a whole row for the kernel, (chains * n, 12)."""
        return expand(self.flat, self.names, self.base)

    def canonical(self) -> Posterior:
        """Return the same posterior with every wheel as its one representative (see `symmetry`)."""
        return replace(self, draws=canonical_wheel(self.draws, self.names))

    def thinned(self, n: int, rng: np.random.Generator) -> Posterior:
        """Return one chain of at most `n` draws, chosen without replacement, in their order."""
        count = min(n, len(self.flat))
        chosen = np.sort(rng.choice(len(self.flat), size=count, replace=False))
        return replace(self, draws=self.flat[chosen][None])

    def mean(self) -> Array:
        """Return the means (K,) of the representatives; circular for angles."""
        return np.array([_mean(name, values) for name, values in self._reported()])

    def sd(self) -> Array:
        """Return the standard deviations (K,) of the representatives; circular for angles."""
        return np.array([_sd(name, values) for name, values in self._reported()])

    def summary(self) -> dict[str, dict[str, float | str]]:
        """Return {parameter: {"mean", "sd", "unit"}}, the form of `report.json`."""
        return {
            name: {"mean": _mean(name, values), "sd": _sd(name, values), "unit": UNITS[name]}
            for name, values in self._reported()
        }

    def _reported(self) -> list[tuple[str, Array]]:
        flat = canonical_wheel(self.flat, self.names)
        return list(zip(self.names, flat.T, strict=True))


def _mean(name: str, values: Array) -> float:
    return circular_mean(values, THETA_PERIOD) if name in ANGLES else float(values.mean())


def _sd(name: str, values: Array) -> float:
    return circular_sd(values, THETA_PERIOD) if name in ANGLES else float(values.std())
