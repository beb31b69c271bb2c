"""The rival that regresses the lacking wrench on a library of features and keeps few of them.

Sequentially thresholded least squares of Brunton, Proctor and Kutz (PNAS 113, 2016), on the wrench in place of a
derivative: regress, drop what is small, regress again. How small is chosen by BIC.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_bringup.rivals.claim import Claim, Given, heldout_error

Array = NDArray[np.float64]

RIDGE = 1e-3
THRESHOLDS = (0.02, 0.05, 0.1, 0.2, 0.4)
"""Shares of the output's spread below which a standardised coefficient is dropped."""
ROUNDS = 12
SURE = 2.0
"""A wrench is claimed where its prediction is so many standard deviations, of what the regression leaves and of the
wrench itself."""
AT_REST = 0.005
"""Speed at which a direction is half-defined [m/s]."""
NAMES = (
    "1",
    "u",
    "v",
    "w",
    "u/|v|",
    "v/|v|",
    "w/|w|",
    "u|v|",
    "v|v|",
    "u w",
    "v w",
    "x",
    "y",
    "cos",
    "sin",
    "x cos",
    "x sin",
    "y cos",
    "y sin",
)
"""u, v: velocity in the body's axes; w: turn rate; x, y: place; cos, sin: of the heading."""


def library(state: Array) -> Array:
    """Return (n, len(NAMES)) features of states (n, 6)."""
    x, y, theta, vx, vy, w = state.T
    c, s = np.cos(theta), np.sin(theta)
    u, v = c * vx + s * vy, -s * vx + c * vy
    speed, turn = np.sqrt(u * u + v * v + AT_REST**2), np.sqrt(w * w + AT_REST**2)
    columns = [np.ones_like(u), u, v, w, u / speed, v / speed, w / turn, u * speed, v * speed, u * w, v * w]
    return np.column_stack([*columns, x, y, c, s, x * c, x * s, y * c, y * s])


@dataclass(frozen=True)
class SparseLaw:
    """A wrench as a sum of few features.

    Attributes:
        coefficients: (len(NAMES), 3) zero where a feature was dropped.
        left: (3,) standard deviation of what it leaves.
    """

    coefficients: Array
    left: Array

    def predict(self, state: Array) -> Array:
        """Return the wrench (n, 3) at states (n, 6), body's axes."""
        return library(state) @ self.coefficients


def thresholded(features: Array, output: Array, weight: Array, threshold: float) -> Array:
    """Return coefficients (k,) of an output (n,) by sequentially thresholded ridge regression.

    Args:
        features: (n, k).
        output: (n,).
        weight: (n,) one over the output's standard deviations.
        threshold: share of the output's spread; a feature that contributes less is dropped.
    """
    width = np.maximum(np.sqrt(np.mean(features**2, axis=0)), 1e-12)
    a, b = features / width * weight[:, None], output * weight
    spread = max(float(np.sqrt(np.mean(output**2))), 1e-12)
    kept = np.ones(features.shape[1], dtype=bool)
    solved = np.zeros(features.shape[1])
    for _ in range(ROUNDS):
        inner = a[:, kept].T @ a[:, kept]
        solved = np.zeros(features.shape[1])
        ridge = RIDGE * max(float(np.trace(inner)) / max(int(kept.sum()), 1), 1e-12)
        solved[kept] = np.linalg.solve(inner + ridge * np.eye(int(kept.sum())), a[:, kept].T @ b)
        still = kept & (np.abs(solved) > threshold * spread)
        if np.array_equal(still, kept):
            break
        kept = still
        if not kept.any():
            return np.zeros(features.shape[1])
    return solved / width


def fit_law(state: Array, wrench: Array, sd: Array) -> SparseLaw:
    """Fit wrenches (n, 3) with standard deviations (n, 3) at states (n, 6); the threshold of each output by BIC."""
    features = library(state)
    chosen = np.zeros((features.shape[1], 3))
    left = np.empty(3)
    for k in range(3):
        tried = [np.zeros(features.shape[1])]
        tried += [thresholded(features, wrench[:, k], 1.0 / sd[:, k], each) for each in THRESHOLDS]
        worth = [_bic(wrench[:, k] - features @ each, int(np.count_nonzero(each))) for each in tried]
        chosen[:, k] = tried[int(np.argmin(worth))]
        left[k] = float(np.std(wrench[:, k] - features @ chosen[:, k]))
    return SparseLaw(chosen, left)


def _bic(left: Array, count: int) -> float:
    return len(left) * float(np.log(np.mean(left**2) + 1e-30)) + count * float(np.log(len(left)))


def sindy(given: Given) -> Claim:
    """Claim where the law predicts more than it leaves unexplained, and predict with it."""
    started = time.process_time()
    if given.open.sum() < 2 * len(NAMES):
        note = f"expected at least {2 * len(NAMES)} samples to regress on, got {given.open.sum()}: nothing is claimed"
        return Claim("SINDy", (), notes=(note,), seconds=time.process_time() - started)
    law = fit_law(given.samples.state[given.open], given.wrench[given.open], given.sd[given.open])
    spread = np.hypot(law.left, given.sd)
    sure = np.any(np.abs(law.predict(given.samples.state)) > SURE * spread, axis=1)
    heldout = heldout_error(given, law.predict)
    spent = time.process_time() - started
    return Claim("SINDy", given.samples.intervals(sure & given.samples.moving), {}, heldout, spent)
