"""What one window says for a wrench that the model does not have: a Bayes factor, which is an e-value.

In a window the poses, over their noise and linearised, are

    r = S z + A d + B w + n,    z, d, n Gaussian,

with the nuisances z of `search.objective` (the start, the sensor's own error), what is not known of the parameters, d,
and a wrench w that is straight between three knots, B as it moves a body that nothing else holds. Under the model w is
nothing; otherwise each knot has forces of the order tau along each axis. With the scale of the noise known only from
the windows before, both densities are of Student's form, and their ratio is the evidence. Its mean is one if the model
is right, whatever came before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.kernels import places as at
from pbrl_mismatch.search.objective import NUISANCES, Objective
from pbrl_mismatch.search.predictive import pushed

Array = NDArray[np.float64]

ROUNDS = 3
"""Linearisations in the nuisances: the start is far enough from its guess to stick or slip."""
FIRST_FREEDOM, MOST_FREEDOM = 20.0, 400.0
"""Numbers that the scale of the noise is worth before the first window, and at most."""
KEPT = 0.3
"""Share of a reading's first standard deviation that is kept, however much is heard."""


@dataclass(frozen=True)
class Window:
    """One window linearised under one reading, whitened by all that is noise or not known.

    Attributes:
        residual: (n,) of unit variance and independent if the model is right.
        slope: (n, K) of the parameters' coordinates, whitened likewise.
        strength: (D,) how many standard deviations the wrench of one newton (a radius of gyration away for a torque)
            moves the poses, along D directions that are independent of each other.
        explained: (D,) parts of the residual along those directions.
    """

    residual: Array
    slope: Array
    strength: Array
    explained: Array

    @property
    def rest(self) -> float:
        """Return the squares that no wrench explains."""
        return max(float(self.residual @ self.residual - self.explained @ self.explained), 0.0)

    @property
    def freedom(self) -> int:
        """Return how many numbers no wrench explains."""
        return len(self.residual) - len(self.explained)


@dataclass(frozen=True)
class Noise:
    """What is known of the scale of the noise: `squares / freedom` is its variance over what was thought."""

    freedom: float = FIRST_FREEDOM
    squares: float = FIRST_FREEDOM

    @property
    def scale(self) -> float:
        """Return the standard deviation over what was thought."""
        return float(np.sqrt(self.squares / self.freedom))

    def with_window(self, window: Window) -> Noise:
        """Return it after one window more; old ones fade."""
        freedom, squares = self.freedom + window.freedom, self.squares + window.rest
        fade = min(1.0, MOST_FREEDOM / freedom)
        return Noise(fade * freedom, fade * squares)


def look(objective: Objective, coordinates: Array, covariance: Array) -> Window:
    """Linearise and whiten the single window of an objective.

    Args:
        objective: a model over one window.
        coordinates: (K,) where the parameters are thought to be.
        covariance: (K, K) how well.
    """
    centred, spread, slope = linearised(objective, coordinates)
    noise = np.eye(len(centred)) + spread @ spread.T
    lower = np.linalg.cholesky(noise + slope @ covariance @ slope.T)
    mass = float(objective.hypothesis.rows(coordinates[None])[0, at.MASS])
    push = pushed(objective.cuts, mass)[0][_seen(objective)]
    left, strength, _ = np.linalg.svd(np.linalg.solve(lower, push), full_matrices=False)
    residual = np.linalg.solve(lower, centred)
    return Window(residual, np.linalg.solve(lower, slope), strength, left.T @ residual)


def linearised(objective: Objective, coordinates: Array) -> tuple[Array, Array, Array]:
    """Linearise the single window of an objective.

    Returns:
        Residual (n,) with no nuisances, slopes in nuisances (n, NUISANCES) and parameters (n, K) of what was seen.
    """
    u = coordinates[None]
    z = objective.at_rest(1)
    linear = objective.linearise(u, z)
    for _ in range(ROUNDS - 1):
        spread, residual = linear.spread[0, 0], linear.residual[0, 0]
        z = z + np.linalg.solve(spread.T @ spread + np.eye(NUISANCES), spread.T @ residual - z[0, 0])
        linear = objective.linearise(u, z)
    seen = _seen(objective)
    spread = linear.spread[0, 0][seen]
    return linear.residual[0, 0][seen] + spread @ z[0, 0], spread, linear.slope[0, 0][seen]


def _seen(objective: Objective) -> NDArray[np.bool_]:
    return np.asarray(objective.cuts.weight[0].reshape(-1) > 0.0)


def log_e_value(window: Window, noise: Noise, forces: tuple[float, ...]) -> float:
    """Return the logarithm of the evidence for a left-out wrench, sizes of it weighed alike.

    Args:
        window: whitened.
        noise: known from windows before.
        forces: sizes tau [N].
    """
    squares = float(window.residual @ window.residual)
    freedom = noise.freedom + len(window.residual)
    found = []
    for tau in forces:
        ratio = (tau * window.strength) ** 2
        left = squares - float(np.sum(window.explained**2 * ratio / (1.0 + ratio)))
        gain = np.log((noise.squares + squares) / (noise.squares + max(left, 0.0)))
        found.append(0.5 * freedom * gain - 0.5 * float(np.sum(np.log1p(ratio))))
    return float(np.logaddexp.reduce(found) - np.log(len(found)))


def adjusted(residual: Array, slope: Array, coordinates: Array, covariance: Array) -> tuple[Array, Array]:
    """Return coordinates (K,) and covariance (K, K) after a window (Kalman's update).

    Args:
        residual: (n,) whitened by all that is noise or not known.
        slope: (n, K) whitened likewise.
        coordinates: (K,) before it.
        covariance: (K, K) before it.
    """
    gain = covariance @ slope.T
    return coordinates + gain @ residual, covariance - gain @ gain.T


def grown(statistic: float, value: float) -> float:
    """Return the logarithm of R after a window, R <- (1 + R) e.

    Args:
        statistic: logarithm of R before.
        value: logarithm of the window's e-value.
    """
    return float(np.logaddexp(0.0, statistic)) + value


def no_sharper(covariance: Array, first: Array, share: float) -> Array:
    """Return a covariance (K, K) that in no direction has less than a share of another one's standard deviation.

    Args:
        covariance: (K, K).
        first: (K, K) the other one, positive definite.
        share: of its standard deviation.
    """
    lower = np.linalg.cholesky(first)
    whitened = np.linalg.solve(lower, np.linalg.solve(lower, covariance).T)
    values, vectors = np.linalg.eigh(0.5 * (whitened + whitened.T))
    root = lower @ (vectors * np.sqrt(np.maximum(values, share**2)))
    return root @ root.T
