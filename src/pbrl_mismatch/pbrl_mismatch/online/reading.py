"""How a published posterior is read by the test: a few Gaussians over the parameters of the effects kernel.

What is published are draws of the world model's parameters, whose wheel limits its friction along each axis alone. A
tyre on a floor limits both together (an ellipse); which of the two is true is no mismatch. So a posterior is read in
both ways, and, where its draws fall into groups, group by group. Something is left out only if every reading fails.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.effects.effect import Parameter
from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.search.hypothesis import Hypothesis
from pbrl_model.parameters import ANGLES, POSITIVE
from pbrl_model.posterior import Posterior
from pbrl_model.symmetry import THETA_PERIOD, circular_mean, wrap

Array = NDArray[np.float64]

ROUNDS = 12
"""Of Lloyd's algorithm; the groups need not be the best ones."""
APART = 0.12
"""Two groups of draws are two where the variance within them is less than this share of all; halves of a Gaussian
leave 0.36, of an even spread 0.25."""
LEAST_SHARE = 0.05
"""Of the draws: a smaller group is left out."""
LEAST_FRICTION = 1e-3
"""A coefficient of friction below this is none."""
FLOORS = {
    "mass": 0.05,
    "wheel_x": 0.02,
    "wheel_y": 0.02,
    "wheel_theta": 0.03,
    "mu_x": 0.2,
    "mu_y": 0.2,
    "mu_ground": 0.2,
    "hinge_x": 0.01,
    "hinge_y": 0.01,
    "hinge_radius": 0.02,
}
"""What is the same model: standard deviations that are added to the posterior's, of logarithms where they are taken."""
WIDEST = 1.0
"""A standard deviation of a logarithm beyond this says no more than that nothing is known."""
INERTIA, DELAY = 0.1, 0.005
"""Standard deviations of what the world model does not learn: log of the inertia over its nominal one, delay [s]."""


@dataclass(frozen=True)
class Reading:
    """One way to read a posterior.

    Attributes:
        hypothesis: free columns and what is fixed; its priors are not correlated.
        mean: (K,) coordinates.
        covariance: (K, K).
        draws: (n, K) those that are read so.
    """

    hypothesis: Hypothesis
    mean: Array
    covariance: Array
    draws: Array


def readings_of(posterior: Posterior) -> tuple[Reading, ...]:
    """Return every reading of the posterior of one object, the likeliest group first."""
    canonical = posterior.canonical()
    values = _coordinates(canonical)
    floor = np.array([FLOORS[name] for name in canonical.names])
    slippery = "mu_x" in canonical.names and "wheel_x" in canonical.names
    out = []
    for group in _groups(values):
        covariance = np.cov(values[group].T, ddof=0).reshape(len(floor), len(floor)) + np.diag(floor**2)
        covariance = _bounded(covariance, canonical.names)
        out += [_reading(canonical, values[group], covariance, cone) for cone in ((0.0, 1.0) if slippery else (0.0,))]
    return tuple(out)


def _coordinates(posterior: Posterior) -> Array:
    """Return (n, K) draws, positive ones as logarithms, turns of wheels near to their mean."""
    out = np.array(posterior.flat, dtype=float)
    for k, name in enumerate(posterior.names):
        if name in POSITIVE:
            out[:, k] = np.log(np.maximum(out[:, k], LEAST_FRICTION))
        elif name in ANGLES:
            middle = circular_mean(out[:, k], THETA_PERIOD)
            out[:, k] = middle + wrap(out[:, k] - middle, THETA_PERIOD)
    return out


def _groups(values: Array) -> list[NDArray[np.int64]]:
    """Return rows of each group of draws, the larger first; one group where there is no gap between two."""
    everything = np.arange(len(values))
    spread = values.std(axis=0)
    scaled = (values - values.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)
    _, _, axes = np.linalg.svd(scaled, full_matrices=False)
    along = scaled @ axes[0]
    centres = scaled[[int(np.argmin(along)), int(np.argmax(along))]]
    owner = np.zeros(len(values), dtype=np.int64)
    for _ in range(ROUNDS):
        owner = np.argmin(((scaled[:, None] - centres) ** 2).sum(axis=2), axis=1)
        if np.bincount(owner, minlength=2).min() < LEAST_SHARE * len(values):
            return [everything]
        centres = np.stack([scaled[owner == k].mean(axis=0) for k in (0, 1)])
    between = scaled @ (centres[1] - centres[0])
    within = np.mean([between[owner == k].var() for k in (0, 1)])
    if within > APART * between.var():
        return [everything]
    return sorted((np.flatnonzero(owner == k) for k in (0, 1)), key=len, reverse=True)


def _bounded(covariance: Array, names: tuple[str, ...]) -> Array:
    """Shrink rows of logarithms about which next to nothing is known."""
    sd = np.sqrt(np.diag(covariance))
    factor = np.array([min(1.0, WIDEST / s) if name in POSITIVE else 1.0 for name, s in zip(names, sd, strict=True)])
    return covariance * np.outer(factor, factor)


def _reading(posterior: Posterior, values: Array, covariance: Array, cone: float) -> Reading:
    mean = values.mean(axis=0)
    base = neutral_row()
    base[: posterior.rows().shape[1]] = posterior.rows()[0]
    base[COLUMN["cone"]] = cone
    parameters = [
        Parameter(name, math.exp(value) if name in POSITIVE else float(value), float(spread), positive=name in POSITIVE)
        for name, value, spread in zip(posterior.names, mean, np.sqrt(np.diag(covariance)), strict=True)
    ]
    hinged = "hinge_x" in posterior.names
    extra = [Parameter("delay", 0.0, DELAY)]
    if not hinged:
        extra.append(Parameter("inertia_factor", 1.0, INERTIA, positive=True))
    hypothesis = Hypothesis((), f"{posterior.model_class}, {'ellipse' if cone else 'box'}", (*parameters, *extra), base)
    size, known = len(parameters) + len(extra), len(parameters)
    whole = np.zeros((size, size))
    whole[:known, :known] = covariance
    whole[range(known, size), range(known, size)] = [each.spread**2 for each in extra]
    draws = np.concatenate([values, np.tile(hypothesis.mean[known:], (len(values), 1))], axis=1)
    return Reading(hypothesis, hypothesis.mean, whole, draws)
