"""The rival that learns the lacking wrench with a Gaussian process over the body's state.

Rasmussen and Williams, *Gaussian Processes for Machine Learning* (2006), chapter 2: squared exponentials, one length
each for velocities, places and heading, all hyperparameters by the marginal likelihood; the noise is what the smoother
says of the wrench, and more where that is too little.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from pbrl_bringup.rivals.claim import Claim, Given, heldout_error

Array = NDArray[np.float64]

STRIDE = 2
"""Every so many samples are learned from: the smoother's wrench remembers itself."""
SURE = 2.0
"""A wrench is claimed where its mean is so many standard deviations from nothing, in any component."""
GROUPS = ((0, 1), (2,), (3, 4), (5, 6))
"""Features that share a length: velocity, turn rate, place, heading."""
BOUNDS = ((-4.0, 4.0), *((-2.0, 3.5),) * len(GROUPS), (-4.0, 2.0))
"""Of the logarithms of signal over noise, of lengths in standard deviations, of added noise over the smoother's."""
ROUNDS = 40
"""Of the optimiser."""


def state_features(state: Array) -> Array:
    """Return (n, 7) velocity in the body's axes, turn rate, place, heading of states (n, 6)."""
    c, s = np.cos(state[:, 2]), np.sin(state[:, 2])
    along, aside = c * state[:, 3] + s * state[:, 4], -s * state[:, 3] + c * state[:, 4]
    return np.column_stack([along, aside, state[:, 5], state[:, 0], state[:, 1], c, s])


@dataclass(frozen=True)
class WrenchProcess:
    """Three outputs over one kernel.

    Attributes:
        inputs: (n, 7) standardised features.
        outputs: (n, 3) wrench over `scale`.
        noise: (n, 3) variances over the square of `scale`.
        middle: (7,) of the features.
        width: (7,) their standard deviations.
        scale: (3,) of the outputs.
        log: hyperparameters, see `BOUNDS`.
    """

    inputs: Array
    outputs: Array
    noise: Array
    middle: Array
    width: Array
    scale: Array
    log: Array

    def predict(self, state: Array) -> tuple[Array, Array]:
        """Return mean (m, 3) and standard deviation (m, 3) of the wrench at states (m, 6)."""
        across, signal = self._across(state), float(np.exp(2.0 * self.log[0]))
        sd = np.empty((len(state), 3))
        for k, factor in enumerate(self._factors):
            sd[:, k] = np.sqrt(np.maximum(signal - np.sum(across.T * cho_solve(factor, across.T), axis=0), 1e-12))
        return across @ self._weights * self.scale, sd * self.scale

    def mean(self, state: Array) -> Array:
        """Return the mean (m, 3) of the wrench at states (m, 6)."""
        return self._across(state) @ self._weights * self.scale

    def _across(self, state: Array) -> Array:
        """Return (m, n) covariances of the signal between states (m, 6) and what was learned from."""
        return kernel(self.log, (state_features(state) - self.middle) / self.width, self.inputs)

    @cached_property
    def _factors(self) -> list[tuple[Array, bool]]:
        own = kernel(self.log, self.inputs, self.inputs)
        return [cho_factor(own + np.diag(noise_of(self.log, self.noise[:, k])), lower=True) for k in range(3)]

    @cached_property
    def _weights(self) -> Array:
        """Return (n, 3) what the covariances are multiplied by for the mean."""
        return np.column_stack([cho_solve(factor, self.outputs[:, k]) for k, factor in enumerate(self._factors)])


def kernel(log: Array, one: Array, other: Array) -> Array:
    """Return (n, m) covariances between standardised features (n, 7) and (m, 7)."""
    lengths = np.ones(one.shape[1])
    for k, group in enumerate(GROUPS):
        lengths[list(group)] = np.exp(log[1 + k])
    a, b = one / lengths, other / lengths
    squares = np.sum(a**2, 1)[:, None] + np.sum(b**2, 1)[None] - 2.0 * a @ b.T
    return np.exp(2.0 * log[0] - 0.5 * np.maximum(squares, 0.0))


def noise_of(log: Array, told: Array) -> Array:
    """Return (n,) variances: what the smoother told, and as much again as the hyperparameter says."""
    return told * (1.0 + np.exp(2.0 * log[-1])) + 1e-9


def fit_process(state: Array, wrench: Array, sd: Array) -> WrenchProcess:
    """Fit to wrenches (n, 3) with standard deviations (n, 3) at states (n, 6), by the marginal likelihood."""
    features = state_features(state)
    middle, width = features.mean(axis=0), np.maximum(features.std(axis=0), 1e-6)
    inputs, scale = (features - middle) / width, np.maximum(sd.mean(axis=0), 1e-9)
    outputs, noise = wrench / scale, (sd / scale) ** 2

    def loss(log: Array) -> float:
        own, total = kernel(log, inputs, inputs), 0.0
        for k in range(3):
            matrix = own + np.diag(noise_of(log, noise[:, k]))
            factor, _ = cho_factor(matrix, lower=True)
            total += 0.5 * float(outputs[:, k] @ cho_solve((factor, True), outputs[:, k]))
            total += float(np.log(np.diag(factor)).sum())
        return total

    start = np.array([0.5, *([0.5] * len(GROUPS)), -1.0])
    found = minimize(loss, start, method="L-BFGS-B", bounds=BOUNDS, options={"maxiter": ROUNDS})
    return WrenchProcess(inputs, outputs, noise, middle, width, scale, np.asarray(found.x))


def gaussian_process(given: Given) -> Claim:
    """Claim where the process is sure that a wrench is lacking, and predict with its mean."""
    started = time.process_time()
    chosen = np.flatnonzero(given.open)[::STRIDE]
    if len(chosen) < 10:
        note = f"expected at least 10 samples to learn from, got {len(chosen)}: nothing is claimed"
        return Claim("Gaussian process", (), notes=(note,), seconds=time.process_time() - started)
    process = fit_process(given.samples.state[chosen], given.wrench[chosen], given.sd[chosen])
    mean, sd = process.predict(given.samples.state)
    sure = np.any(np.abs(mean) > SURE * sd, axis=1)
    heldout = heldout_error(given, process.mean)
    spent = time.process_time() - started
    return Claim("Gaussian process", given.samples.intervals(sure & given.samples.moving), {}, heldout, spent)
