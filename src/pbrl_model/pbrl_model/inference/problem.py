"""What inference needs to know of a problem: prior, likelihood, residuals, and which descriptions mean the same."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pbrl_model.errors import ModelError

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class Problem(Protocol):
    """A posterior to be found. Rows of theta (P, D) are evaluated together, so that one kernel call serves them all.

    Attributes:
        names: D names of the columns.
        bounds: (2, D) ends of the prior's support, infinite where there is none; finite for periodic columns.
        periodic: (D,) which columns live on a circle whose length is the distance of their bounds.
        noise_column: column that holds ln s, the scale of all residuals; None where their scale is known.
    """

    @property
    def names(self) -> tuple[str, ...]: ...  # noqa: D102 - described by the class

    @property
    def bounds(self) -> Array: ...  # noqa: D102

    @property
    def periodic(self) -> Flags: ...  # noqa: D102

    @property
    def noise_column(self) -> int | None: ...  # noqa: D102

    def sample_prior(self, rng: np.random.Generator, n: int) -> Array:
        """Draw (n, D) from the prior."""
        ...

    def log_prior(self, theta: Array) -> Array:
        """Return (P,) log prior densities [nat], -inf outside the support."""
        ...

    def log_likelihood(self, theta: Array) -> Array:
        """Return (P,) log likelihoods [nat]; only asked for rows inside the prior's support."""
        ...

    def residuals(self, theta: Array, share: float = 1.0) -> Array:
        """Return (P, M) residuals divided by their standard deviations, those of the scale s = 1.

        Args:
            theta: (P, D) inside the prior's support.
            share: of the horizon, in (0, 1]; M may depend on it. A horizon that grows finds needles.
        """
        ...

    def images(self, theta: Array) -> Array:
        """Return (S, P, D) all descriptions of the same things, the given one first; S = 1 where there is no other."""
        ...


@dataclass(frozen=True)
class Domain:
    """Where theta lives.

    Attributes:
        bounds: (2, D).
        periodic: (D,).
    """

    bounds: Array
    periodic: Flags

    def __post_init__(self) -> None:
        bounds = np.asarray(self.bounds, dtype=float)
        periodic = np.asarray(self.periodic, dtype=bool)
        if bounds.ndim != 2 or bounds.shape[0] != 2 or periodic.shape != (bounds.shape[1],):
            raise ModelError(
                f"domain: expected bounds (2, D) and periodic (D,), got shapes {bounds.shape} and {periodic.shape}"
            )
        if not np.all(bounds[0] < bounds[1]):
            raise ModelError(f"domain: expected every lower bound below the upper, got {bounds.tolist()}")
        if not np.all(np.isfinite(bounds[:, periodic])):
            raise ModelError(f"domain: expected finite bounds of periodic columns, got {bounds[:, periodic].tolist()}")
        object.__setattr__(self, "bounds", bounds)
        object.__setattr__(self, "periodic", periodic)

    @classmethod
    def unbounded(cls, dimension: int) -> Domain:
        """Return the whole space."""
        return cls(np.array([[-np.inf], [np.inf]]) * np.ones(dimension), np.zeros(dimension, dtype=bool))

    @property
    def dimension(self) -> int:
        """Return D."""
        return int(self.bounds.shape[1])

    @property
    def period(self) -> Array:
        """Return (D,) lengths of the circles, infinite where a column is not periodic."""
        return np.where(self.periodic, self.bounds[1] - self.bounds[0], np.inf)

    def fold(self, theta: Array) -> Array:
        """Bring periodic columns of theta (..., D) into their bounds."""
        out = np.array(theta, dtype=float)
        low, period = self.bounds[0, self.periodic], self.period[self.periodic]
        out[..., self.periodic] = low + np.mod(out[..., self.periodic] - low, period)
        return out

    def clip(self, theta: Array) -> Array:
        """Bring theta (..., D) into the bounds: periodic columns folded, the others clipped."""
        return np.clip(self.fold(theta), self.bounds[0], self.bounds[1])

    def inside(self, theta: Array) -> Flags:
        """Tell for theta (..., D) whether every column is finite and within its bounds."""
        return np.all((theta >= self.bounds[0]) & (theta <= self.bounds[1]) & np.isfinite(theta), axis=-1)

    def offset(self, theta: Array, centre: Array) -> Array:
        """Return theta - centre, periodic columns the shorter way round."""
        out = theta - centre
        period = self.period[self.periodic]
        turns = out[..., self.periodic]
        out[..., self.periodic] = turns - period * np.round(turns / period)
        return out


def domain_of(problem: Problem) -> Domain:
    """Return where a problem's theta lives."""
    return Domain(problem.bounds, problem.periodic)
