"""A Gaussian process over what a force can sensibly depend on: the place on the floor, the heading, the velocity.

    k((x, h, v), (x', h', v')) = s^2 exp(-|x - x'|^2 / 2 a^2 - |h - h'|^2 / 2 b^2 - |v - v'|^2 / 2 c^2)

with h on the unit circle, for each component of the wrench by itself, in world or in body axes, whichever makes the
wrench likelier. Lengths and sizes maximise the marginal likelihood with wide log-normal priors (Rasmussen and Williams
2006, chapter 5). Far from all that was seen it knows nothing: mean zero, the prior's variance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.unknown.samples import Samples
from pbrl_model.transforms import yaw_matrices

Array = NDArray[np.float64]
Axes = Literal["world", "body"]

MOST_POINTS = 160
BLOCKS = 8
"""Parts of the recording of which each is predicted from the others."""
TYPICAL = np.log([0.5, 0.8, 0.1])
"""Lengths in place [m], heading [1] and velocity [m/s] that are expected, and how widely."""
WIDE = 1.0
STEPS = 40
JITTER = 1e-6


@dataclass(frozen=True)
class WrenchProcess:
    """A fitted process.

    Attributes:
        axes: in which components are independent.
        lengths: (3,) in place [m], heading (on the unit circle) and velocity [m/s].
        size: (3,) standard deviation of each component far from everything seen [N, N, N m].
        left_over: (3,) standard deviation of what it does not follow [N, N, N m].
        inputs: (n, 6) place, cosine and sine of the heading, velocity.
        weights: (3, n) of the mean.
        roots: (3, n, n) lower Cholesky factors.
        share: of the wrench's squares that is predicted in parts of the recording from the other parts; below zero
            where it predicts worse than nothing would.
        log_likelihood: of the wrench [nat].
        settled: whether the search for lengths ended by itself.
    """

    axes: Axes
    lengths: Array
    size: Array
    left_over: Array
    inputs: Array
    weights: Array
    roots: Array
    share: float
    log_likelihood: float
    settled: bool

    def predict(self, place: Array, heading: Array, velocity: Array) -> tuple[Array, Array]:
        """Return mean (m, 3) and covariance (m, 3, 3) of the wrench, world axes.

        Args:
            place: (m, 2) of the centre of mass [m].
            heading: (m,) [rad].
            velocity: (m, 2) [m/s].
        """
        at = inputs_of(place, heading, velocity)
        mean, covariance = np.empty((len(at), 3)), np.zeros((len(at), 3, 3))
        near = _alike(at, self.inputs, self.lengths)
        for k in range(3):
            across = self.size[k] ** 2 * near
            mean[:, k] = across @ self.weights[k]
            known = np.linalg.solve(self.roots[k], across.T)
            covariance[:, k, k] = np.maximum(self.size[k] ** 2 - np.sum(known**2, axis=0), 0.0)
        if self.axes == "world":
            return mean, covariance
        turn = yaw_matrices(heading)
        return np.einsum("nij,nj->ni", turn, mean), turn @ covariance @ np.swapaxes(turn, -1, -2)

    def to_report(self) -> dict[str, Any]:
        """Return a JSON-able form."""
        return {
            "axes": self.axes,
            "lengths": {
                "place": {"value": float(self.lengths[0]), "unit": "m"},
                "heading": {"value": float(self.lengths[1]), "unit": "rad"},
                "velocity": {"value": float(self.lengths[2]), "unit": "m/s"},
            },
            "size": {"force": float(self.size[0]), "torque": float(self.size[2])},
            "left_over": {"force": float(self.left_over[0]), "torque": float(self.left_over[2])},
            "points": len(self.inputs),
            "share_predicted": self.share,
            "settled": self.settled,
        }


def inputs_of(place: Array, heading: Array, velocity: Array) -> Array:
    """Return (m, 6) place, cosine and sine of the heading, velocity."""
    return np.column_stack([place, np.cos(heading), np.sin(heading), velocity])


def wrench_process(samples: Samples) -> WrenchProcess:
    """Fit the process in both frames and return the likelier one.

    Raises:
        MismatchError: there are too few moments.
    """
    if len(samples) < BLOCKS:
        raise MismatchError(f"wrench process: expected at least {BLOCKS} moments, got {len(samples)}")
    rows = np.unique(np.linspace(0, len(samples) - 1, min(len(samples), MOST_POINTS)).round().astype(np.int64))
    used = samples.take(rows)
    fits = [_fitted(used, axes) for axes in ("world", "body")]
    return max(fits, key=lambda fit: fit.log_likelihood)


def _alike(left: Array, right: Array, lengths: Array) -> Array:
    scale = np.repeat(lengths, 2)
    a, b = left / scale, right / scale
    squares = np.sum(a**2, 1)[:, None] + np.sum(b**2, 1)[None] - 2.0 * a @ b.T
    return np.exp(-0.5 * np.maximum(squares, 0.0))


def _fitted(samples: Samples, axes: Axes) -> WrenchProcess:
    inputs = inputs_of(samples.place, samples.heading, samples.velocity)
    wrench, covariance = samples.wrench, samples.covariance
    if axes == "body":
        back = np.swapaxes(yaw_matrices(samples.heading), -1, -2)
        wrench = np.einsum("nij,nj->ni", back, wrench)
        covariance = back @ covariance @ np.swapaxes(back, -1, -2)
    known = np.diagonal(covariance, axis1=1, axis2=2)
    force = max(float(np.sqrt(np.mean(wrench[:, :2] ** 2))), 1e-3)
    torque = max(float(np.sqrt(np.mean(wrench[:, 2] ** 2))), 1e-3 * samples.gyration)
    typical = np.array([*TYPICAL, np.log(force), np.log(torque), np.log(0.3)])

    def parts(values: Array) -> tuple[Array, Array, Array]:
        size = np.exp([values[3], values[3], values[4]])
        return np.exp(values[:3]), size, size * np.exp(values[5])

    def cost(values: Array) -> float:
        lengths, size, left_over = parts(values)
        near = _alike(inputs, inputs, lengths)
        total = 0.0
        for k in range(3):
            root = np.linalg.cholesky(_covariance(near, size[k], left_over[k], known[:, k]))
            along = np.linalg.solve(root, wrench[:, k])
            total += 0.5 * float(along @ along) + float(np.sum(np.log(np.diag(root))))
        return total + 0.5 * float(np.sum(((values - typical) / WIDE) ** 2))

    bounds = [(centre - 3.0 * WIDE, centre + 3.0 * WIDE) for centre in typical]
    found = minimize(cost, typical, method="L-BFGS-B", bounds=bounds, options={"maxiter": STEPS, "ftol": 1e-5})
    lengths, size, left_over = parts(found.x)
    near = _alike(inputs, inputs, lengths)
    matrices = [_covariance(near, size[k], left_over[k], known[:, k]) for k in range(3)]
    weights = np.stack([cho_solve(cho_factor(each, lower=True), wrench[:, k]) for k, each in enumerate(matrices)])
    return WrenchProcess(
        axes,
        lengths,
        size,
        left_over,
        inputs,
        weights,
        np.stack([np.linalg.cholesky(each) for each in matrices]),
        _predicted_share(matrices, weights, wrench / samples.scale, samples.scale),
        -float(found.fun),
        bool(found.success),
    )


def _covariance(near: Array, size: float, left_over: float, known: Array) -> Array:
    return size**2 * near + np.diag(left_over**2 + known + JITTER * size**2)


def _predicted_share(matrices: list[Array], weights: Array, scaled: Array, scale: Array) -> float:
    """Return the share of the wrench's squares (n, 3), over their scale, that is predicted across blocks of time."""
    missed = np.empty_like(scaled)
    blocks = np.array_split(np.arange(len(scaled)), BLOCKS)
    for k, matrix in enumerate(matrices):
        inverse = np.linalg.inv(matrix)
        for block in blocks:
            missed[block, k] = np.linalg.solve(inverse[np.ix_(block, block)], weights[k][block]) / scale[k]
    return 1.0 - float(np.sum(missed**2) / max(float(np.sum(scaled**2)), 1e-18))
