"""A mixture of Student-t densities on a domain: what importance sampling draws from, and how it learns.

Each component is a t with its own mean, scale matrix and weight. Draws that fall out of the bounds, or further round a
circle than half a turn from their component's mean, are marked and count as draws of weight zero: the mixture cut at
the bounds needs no normalising constant that way, and what is marked costs no likelihood call.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, logsumexp

from pbrl_model.errors import ModelError
from pbrl_model.inference.problem import Domain, Flags

Array = NDArray[np.float64]

DOF = 5.0
"""Degrees of freedom: heavier tails than a posterior's, so that weights stay bounded."""
TRIES = 20
"""Batches of draws at most, to have as many within the domain as wanted."""
FLATTEST = 1e-10
"""Columns scaled to unit diagonal, no eigenvalue of a matrix counts as smaller: it would be rounding."""
LEAST_WEIGHT = 0.2
"""No component falls below this share of an equal weight: a mode that few draws hit now may still be one."""


@dataclass(frozen=True)
class Mixture:
    """Student-t components.

    Attributes:
        mean: (K, D).
        scale: (K, D, D) scale matrices; a component's covariance is dof / (dof - 2) times its scale.
        weight: (K,) positive, of sum 1.
        domain: where the draws live.
        dof: degrees of freedom, above 2.
    """

    mean: Array
    scale: Array
    weight: Array
    domain: Domain
    dof: float = DOF

    def __post_init__(self) -> None:
        k, d = np.shape(self.mean)
        if np.shape(self.scale) != (k, d, d) or np.shape(self.weight) != (k,) or d != self.domain.dimension or k == 0:
            raise ModelError(
                f"mixture: expected mean (K, {self.domain.dimension}) with scale and weight to match, got shapes "
                f"{np.shape(self.mean)}, {np.shape(self.scale)} and {np.shape(self.weight)}"
            )
        if not self.dof > 2.0:
            raise ModelError(f"mixture: expected more than 2 degrees of freedom, got {self.dof}")

    @classmethod
    def around(cls, mean: Array, covariance: Array, weight: Array, domain: Domain, dof: float = DOF) -> Mixture:
        """Return a mixture of components with these covariances (K, D, D)."""
        total = np.asarray(weight, dtype=float) / np.sum(weight)
        return cls(np.asarray(mean, dtype=float), covariance * (dof - 2.0) / dof, total, domain, dof)

    def sample(self, rng: np.random.Generator, n: int) -> tuple[Array, Flags]:
        """Draw n points (n, D), and tell which of them are within the domain (n,).

        Components get their share of the draws to within one: the weights of modes are then not blurred by chance.
        """
        component = stratified(rng, self.weight, n)
        factor = np.linalg.cholesky(self.scale)
        normal = rng.standard_normal((n, self.domain.dimension))
        tail = np.sqrt(rng.chisquare(self.dof, n) / self.dof)
        step = np.einsum("nij,nj->ni", factor[component], normal) / tail[:, None]
        near = np.all(np.abs(step) <= 0.5 * self.domain.period, axis=1)
        points = self.domain.fold(self.mean[component] + step)
        return points, near & self.domain.inside(points)

    def log_components(self, points: Array) -> Array:
        """Return (K, n) log densities of the weighted components at points (n, D)."""
        d = self.domain.dimension
        constant = gammaln((self.dof + d) / 2) - gammaln(self.dof / 2) - d / 2 * math.log(self.dof * math.pi)
        out = np.empty((len(self.mean), len(points)))
        for k, distance in enumerate(self.distances(points)):
            half_log_det = np.sum(np.log(np.diagonal(np.linalg.cholesky(self.scale[k]))))
            tail = -(self.dof + d) / 2 * np.log1p(distance / self.dof)
            out[k] = math.log(self.weight[k]) + constant - half_log_det + tail
        return out

    def distances(self, points: Array) -> Array:
        """Return (K, n) squared distances of points (n, D) from the means, in the components' own scales."""
        out = np.empty((len(self.mean), len(points)))
        for k, mean in enumerate(self.mean):
            inverse = np.linalg.inv(np.linalg.cholesky(self.scale[k]))
            white = np.einsum("ij,nj->ni", inverse, self.domain.offset(points, mean))
            out[k] = np.einsum("ni,ni->n", white, white)
        return out

    def log_density(self, points: Array) -> Array:
        """Return (n,) log densities at points (n, D) within the domain."""
        return np.asarray(logsumexp(self.log_components(points), axis=0))

    def adapted(self, points: Array, log_weights: Array) -> Mixture:
        """Return the mixture after one step of expectation-maximisation on weighted points.

        This is the update of population Monte Carlo (Cappe et al. 2008) for Student-t components. A component that few
        points inform keeps part of its scale, as if it had been seen D + 2 times.

        Args:
            points: (n, D) within the domain.
            log_weights: (n,) of the points, up to a constant.
        """
        d = self.domain.dimension
        weights = np.exp(log_weights - np.max(log_weights))
        weights = weights / weights.sum()
        log_components = self.log_components(points)
        shares = np.exp(log_components - logsumexp(log_components, axis=0))  # (K, n)
        tails = (self.dof + d) / (self.dof + self.distances(points))
        mean, scale, weight = self.mean.copy(), self.scale.copy(), np.empty_like(self.weight)
        for k in range(len(mean)):
            own = weights * shares[k]
            weight[k] = own.sum()
            seen = own.sum() ** 2 / max(float(np.sum(own**2)), 1e-300)
            if seen < 2.0:
                continue
            pull = own * tails[k] / np.sum(own * tails[k])
            offset = self.domain.offset(points, mean[k])
            shift = np.einsum("n,ni->i", pull, offset)
            centred = offset - shift
            spread = np.einsum("n,ni,nj->ij", own * tails[k] / own.sum(), centred, centred)
            mean[k] = self.domain.fold(mean[k] + shift * seen / (seen + 1.0))
            scale[k] = positive((seen * spread + (d + 2.0) * self.scale[k]) / (seen + d + 2.0))
        weight = np.maximum(weight, LEAST_WEIGHT / len(weight))
        return replace(self, mean=mean, scale=scale, weight=weight / weight.sum())


def stratified(rng: np.random.Generator, weight: Array, n: int) -> NDArray[np.int64]:
    """Return n indices drawn with these weights (sum 1) by one shared random offset, in ascending order."""
    edges = np.cumsum(weight)
    ticks = (rng.random() + np.arange(n)) / n
    return np.minimum(np.searchsorted(edges, ticks * edges[-1], side="right"), len(weight) - 1).astype(np.int64)


def positive(matrices: Array, floor: float = FLATTEST) -> Array:
    """Return symmetric matrices (..., D, D) with eigenvalues, columns scaled to unit diagonal, not below a floor."""
    values, vectors, scale = _axes(matrices)
    return _assembled(np.maximum(values, floor), vectors) * scale[..., :, None] * scale[..., None, :]


def inverse(matrices: Array, floor: float = FLATTEST) -> Array:
    """Return the inverses of what `positive` returns: positive as well, whatever rounding did to the matrices."""
    values, vectors, scale = _axes(matrices)
    return _assembled(1.0 / np.maximum(values, floor), vectors) / scale[..., :, None] / scale[..., None, :]


def _axes(matrices: Array) -> tuple[Array, Array, Array]:
    """Return eigenvalues and eigenvectors of matrices scaled to unit diagonal, and the columns' scales."""
    scale = np.sqrt(np.maximum(np.einsum("...ii->...i", matrices), 1e-300))
    scaled = matrices / scale[..., :, None] / scale[..., None, :]
    values, vectors = np.linalg.eigh(0.5 * (scaled + np.swapaxes(scaled, -1, -2)))
    return values, vectors, scale


def _assembled(values: Array, vectors: Array) -> Array:
    whole = np.einsum("...ik,...k,...jk->...ij", vectors, values, vectors)
    return 0.5 * (whole + np.swapaxes(whole, -1, -2))


def inside_draws(rng: np.random.Generator, mixture: Mixture, n: int) -> Array:
    """Return n draws within the domain, or fewer where nearly all fall out of it."""
    parts = [np.zeros((0, mixture.domain.dimension))]
    for _ in range(TRIES):
        points, inside = mixture.sample(rng, n)
        parts.append(points[inside])
        if sum(map(len, parts)) >= n:
            break
    return np.concatenate(parts)[:n]
