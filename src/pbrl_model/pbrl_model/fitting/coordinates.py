"""Coordinates in which a posterior is nearly a mixture of Gaussians: no bounds, no turns, one point for each wheel.

- What is positive goes by its logarithm, what lies between bounds by the log odds of its place between them: a mass and
  a friction coefficient of which only the product is known lie on a straight line.
- A wheel has four descriptions (see `symmetry`) and, where it holds alike in every direction, no turn at all. Its
  coefficients and turn (mu_x, mu_y, theta) go as (low, a, b): the smaller coefficient, and (a, b) = r (cos 2 theta,
  sin 2 theta) with r^2 the greater minus the smaller. One wheel is then one point, a wheel without direction is the
  origin, and one that rolls in a known direction but whose hold across it is not known is a ray. Since
  d mu d theta = 2 r dr d theta = da db, the map keeps volumes.

A density over positions becomes one over coordinates by the sum over the descriptions of its prior, so that integrals
stay what they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, log_expit, logit, logsumexp

from pbrl_model.fitting.target import Target
from pbrl_model.symmetry import WHEEL_NAMES, canonical_wheel, equivalent_wheels

Array = NDArray[np.float64]

EDGE = 1e-4
"""Starts this near to a bound, as a share of its width, are taken as this far from it."""
ROUND = 0.05
"""Least r at which a slope is taken: at the origin the turn of a wheel has none."""
INSET = 2e-4
"""Slopes are taken at least this far from a bound, as a share of its width."""
VARIANCE = (1e-8, 2.0)
"""Variances of a mode in units of the prior's, clipped: no mode is wider than what was known before."""
SCALE_DRAWS = 400
SLOPE_STEP = 1e-4
"""Share of the standard deviation over which the map's slope is taken."""


@dataclass(frozen=True)
class Coordinates:
    """The map between positions (P, D) of a target and coordinates (P, D) without bounds.

    Attributes:
        target: whose positions.
        merged: whether a wheel's descriptions are one point; else its coefficients and turn stay three numbers.
    """

    target: Target
    merged: bool = True

    @cached_property
    def _names(self) -> list[str]:
        return list(self.target.names)

    @cached_property
    def _wheel(self) -> tuple[int, int, int] | None:
        """Return the columns of wheel_theta, mu_x and mu_y, or None where they are not all learned."""
        if not self.merged or not all(name in self._names for name in WHEEL_NAMES):
            return None
        theta, mu_x, mu_y = (self._names.index(name) for name in WHEEL_NAMES)
        return theta, mu_x, mu_y

    @cached_property
    def _bounds(self) -> Array:
        """Return (2, D) bounds of each column once the wheel is (low, a, b): low at mu_x, a and b at the others."""
        bounds = np.column_stack([self.target.prior.bounds, [[-np.inf] * 3, [np.inf] * 3]])
        if self._wheel is not None:
            theta, mu_x, mu_y = self._wheel
            bounds[:, mu_x] = min(bounds[0, mu_x], bounds[0, mu_y]), max(bounds[1, mu_x], bounds[1, mu_y])
            bounds[:, [theta, mu_y]] = [[-np.inf], [np.inf]]
        return bounds

    @cached_property
    def _in_box(self) -> NDArray[np.bool_]:
        """Return (K,) which parameters lie between bounds, circles left out."""
        return np.all(np.isfinite(self.target.prior.bounds), axis=0) & ~self.target.prior.periodic

    @cached_property
    def _boxed(self) -> NDArray[np.bool_]:
        return np.all(np.isfinite(self._bounds), axis=0)

    @cached_property
    def _positive(self) -> NDArray[np.bool_]:
        return np.isfinite(self._bounds[0]) & np.isinf(self._bounds[1])

    def positions(self, coordinates: Array) -> Array:
        """Return the positions (P, D), wheels as their representatives."""
        out = np.array(coordinates, dtype=float)
        lower, upper = self._bounds
        box, positive = self._boxed, self._positive
        out[:, box] = lower[box] + (upper - lower)[box] * expit(out[:, box])
        out[:, positive] = lower[positive] + np.exp(out[:, positive])
        if self._wheel is not None:
            theta, mu_x, mu_y = self._wheel
            a, b = out[:, theta].copy(), out[:, mu_y].copy()
            out[:, mu_y] = out[:, mu_x] + a * a + b * b
            out[:, theta] = 0.5 * np.arctan2(b, a)
        return out

    def of(self, positions: Array, edge: float = EDGE) -> Array:
        """Return the coordinates (P, D) of positions, those on a bound moved off it by the share `edge`."""
        out, physics = self._off_bounds(positions, edge), len(self._names)
        if self._wheel is not None:
            out[:, :physics] = canonical_wheel(out[:, :physics], self._names)
            theta, mu_x, mu_y = self._wheel
            r = np.sqrt(np.maximum(out[:, mu_y] - out[:, mu_x], 0.0))
            turn = 2.0 * out[:, theta]
            out[:, theta], out[:, mu_y] = r * np.cos(turn), r * np.sin(turn)
        lower, upper = self._bounds
        box, positive = self._boxed, self._positive
        out[:, box] = logit((out[:, box] - lower[box]) / (upper - lower)[box])
        out[:, positive] = np.log(np.maximum(out[:, positive] - lower[positive], 1e-12))
        return out

    def _off_bounds(self, positions: Array, edge: float) -> Array:
        """Return positions at least the share `edge` of the width between two bounds away from either."""
        out = np.array(positions, dtype=float)
        box = np.flatnonzero(self._in_box)
        lower, upper = self.target.prior.bounds[:, box]
        width = edge * (upper - lower)
        out[:, box] = np.clip(out[:, box], lower + width, upper - width)
        return out

    def inside(self, positions: Array) -> Array:
        """Return positions with those on a bound, or beyond, moved off it."""
        return self.positions(self.of(positions))

    def rates(self, coordinates: Array) -> Array:
        """Return (P, D) how fast each column of positions changes with its own coordinate, merged wheels left out."""
        out = np.ones_like(coordinates)
        lower, upper = self._bounds
        box, positive = self._boxed, self._positive
        out[:, box] = (upper - lower)[box] * expit(coordinates[:, box]) * expit(-coordinates[:, box])
        out[:, positive] = np.exp(coordinates[:, positive])
        return out

    @cached_property
    def scale(self) -> Array:
        """Return (D,) spreads of the prior over the coordinates."""
        return self.sample_prior(np.random.default_rng(0), SCALE_DRAWS).std(axis=0)

    def log_volume(self, coordinates: Array) -> Array:
        """Return (P,) the log of how much volume of positions one of coordinates is."""
        box, positive = self._boxed, self._positive
        lower, upper = self._bounds
        width = np.log((upper - lower)[box])
        slope = log_expit(coordinates[:, box]) + log_expit(-coordinates[:, box])
        return np.asarray(np.sum(slope + width, axis=1) + np.sum(coordinates[:, positive], axis=1))

    def log_prior(self, coordinates: Array) -> Array:
        """Return (P,) log prior densities over coordinates."""
        positions = self.positions(coordinates)
        return self.log_volume(coordinates) + logsumexp(self._image_priors(positions), axis=0)

    def log_density(self, coordinates: Array, nuisance: Array | None = None) -> Array:
        """Return (P,) log densities over coordinates; see `Target.full_log_density`."""
        # The likelihood is the same for every description: take one that the prior allows.
        images = self._images(self.positions(coordinates))
        priors = np.stack([self.target.log_prior(image) for image in images])
        best = np.argmax(priors, axis=0)
        likely = self.target.full_log_density(images[best, np.arange(len(best))], nuisance)
        others = logsumexp(priors - np.maximum(np.max(priors, axis=0), -1e300), axis=0)
        return likely + others + self.log_volume(coordinates)

    def sample_prior(self, rng: np.random.Generator, n: int) -> Array:
        """Draw (n, D) coordinates from the prior."""
        return self.of(self.target.sample_prior(rng, n), edge=1e-12)

    def describe(self, rng: np.random.Generator, coordinates: Array) -> Array:
        """Return positions (P, D), each wheel in one of its descriptions, drawn as the prior has them."""
        positions = self.positions(coordinates)
        images = self._images(positions)
        priors = self._image_priors(positions)
        share = np.cumsum(np.exp(priors - logsumexp(priors, axis=0)), axis=0)
        chosen = np.minimum(np.sum(rng.random(len(positions)) > share, axis=0), len(images) - 1)
        return images[chosen, np.arange(len(positions))]

    def covariance(self, positions: Array, covariance: Array) -> Array:
        """Return (M, D, D) covariances over coordinates of those over positions, no wider than the prior's.

        Args:
            positions: (M, D) where they were taken.
            covariance: (M, D, D).
        """
        centre = self._off_edges(positions)
        spread = np.sqrt(np.einsum("mii->mi", covariance))
        slope = np.empty_like(covariance)
        for column in range(positions.shape[1]):
            step = np.zeros_like(centre)
            step[:, column] = SLOPE_STEP * spread[:, column]
            slope[:, :, column] = (self.of(centre + step, 0.0) - self.of(centre - step, 0.0)) / (2 * step[:, [column]])
        out = slope @ covariance @ np.swapaxes(slope, -1, -2)
        values, vectors = np.linalg.eigh(out / np.outer(self.scale, self.scale))
        shape = (vectors * np.clip(values, *VARIANCE)[:, None, :]) @ np.swapaxes(vectors, -1, -2)
        return shape * np.outer(self.scale, self.scale)

    def _off_edges(self, positions: Array) -> Array:
        """Return positions moved to where the map has a slope: off the bounds, wheels off having no direction."""
        out = self._off_bounds(positions, INSET)
        if self._wheel is not None:
            _, mu_x, mu_y = self._wheel
            lower_one = np.where(out[:, mu_x] <= out[:, mu_y], mu_x, mu_y)
            other = mu_x + mu_y - lower_one
            rows = np.flatnonzero(np.abs(out[:, mu_x] - out[:, mu_y]) < ROUND**2)
            out[rows, other[rows]] = out[rows, lower_one[rows]] + ROUND**2
        return out

    def _images(self, positions: Array) -> Array:
        """Return (S, P, D) all descriptions."""
        physics = len(self._names)
        if self._wheel is None:
            return positions[None]
        turned = equivalent_wheels(positions[:, :physics], self._names)
        return np.concatenate([turned, np.repeat(positions[None, :, physics:], len(turned), axis=0)], -1)

    def _image_priors(self, positions: Array) -> Array:
        """Return (S, P) log priors of all descriptions."""
        return np.stack([self.target.log_prior(image) for image in self._images(positions)])
