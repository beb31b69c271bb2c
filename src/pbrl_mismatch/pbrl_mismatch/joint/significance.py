"""Is constant friction enough? A p-value by parametric bootstrap, whatever noise and texture the sensor and hinge have.

Under "nothing was left out" the force is constant friction, white noise, and a texture of any strength and of a length
up to six degrees: all are learned here, so that a rough hinge is no mismatch. The statistic is the largest gain in log
likelihood that one shape of the library brings over a grid of places, widths and noises; the same is done to recordings
drawn from the fitted null, and the p-value is the rank among them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.joint.laws import DEGREE, FRICTION, Law
from pbrl_mismatch.joint.pull import Pull
from pbrl_mismatch.joint.texture_kernel import whitened

Array = NDArray[np.float64]

DRAWN = 499
"""Recordings drawn from the null; the least p-value is one over one more."""
LENGTHS = (1.0, 3.0, 6.0)
"""Of the texture [degrees]; what is alike over more has to be explained by a law, see `evidence.TEXTURE_LENGTH`."""
NOISES = (0.02, 0.08, 0.3)
"""Of the sensor, as shares of the felt force's spread."""
TEXTURES = (0.05, 0.15, 0.4, 1.0, 2.5)
"""Of the texture, likewise."""
PLACES = 3
"""Every so many of the places that a law is searched from are in the grid."""
LEAST_NORM = 1e-6
"""Shapes that friction already has add nothing but rounding."""


def p_value(rng: np.random.Generator, pull: Pull, laws: Sequence[Law], drawn: int = DRAWN) -> float:
    """Return how often constant friction alone would look as unlike itself as the pull does.

    Args:
        rng: for the recordings that are drawn from the null.
        pull: what was felt.
        laws: whose shapes are held against it.
        drawn: recordings drawn.
    """
    spread = max(float(pull.force.std()), 1e-9)
    friction = FRICTION.shape(pull, np.empty(0))
    shapes = np.hstack([friction, templates(pull, laws)])
    grid = [
        (noise * spread, texture * spread, length * DEGREE)
        for noise, texture, length in product(NOISES, TEXTURES, LENGTHS)
    ]
    null, _ = likelihoods(pull.force[:, None], shapes, pull.step, grid)
    best = grid[int(np.argmax(null[:, 0]))]
    fitted = _friction_of(pull, friction, best)
    series = np.column_stack([pull.force, fitted[:, None] + _drawn(rng, pull, best, drawn)])
    null, gain = likelihoods(series, shapes, pull.step, grid)
    statistic = (null + gain).max(axis=0) - null.max(axis=0)
    # A tie counts against the mismatch.
    return float((1 + np.sum(statistic[1:] >= statistic[0])) / (drawn + 1))


def templates(pull: Pull, laws: Sequence[Law]) -> Array:
    """Return (n, m) shapes of laws at places along the way, each of norm one."""
    columns = []
    for law in laws:
        if law.multiplies:
            # What play does to constant friction.
            columns += [law.shape(pull, start) for start in law.starts(pull)[::PLACES]]
            continue
        starts = law.starts(pull)
        columns += [law.shape(pull, start) for start in (starts[::PLACES] if len(starts) > PLACES else starts)]
    found = np.hstack(columns) if columns else np.empty((len(pull), 0))
    norm = np.sqrt(np.sum(found**2, axis=0))
    return found[:, norm > LEAST_NORM] / norm[norm > LEAST_NORM]


def likelihoods(
    series: Array, shapes: Array, step: Array, grid: Sequence[tuple[float, float, float]]
) -> tuple[Array, Array]:
    """Return log likelihoods over a grid of noises: (g, s) of friction alone, and (g, s) the most one shape adds.

    Args:
        series: (n, s) forces.
        shapes: (n, 1 + m): friction first.
        step: (n,) way between cells [rad].
        grid: sensor noise, texture [N] and its length [rad].
    """
    null, gain = np.empty((len(grid), series.shape[1])), np.empty((len(grid), series.shape[1]))
    every = np.ascontiguousarray(np.hstack([shapes, series]))
    white, count = np.empty_like(every), shapes.shape[1]
    for row, (sensor, texture, length) in enumerate(grid):
        half = whitened(every, step, sensor, texture, length, white)
        friction = white[:, :1] / np.sqrt(np.sum(white[:, :1] ** 2))
        left = white - friction @ (friction.T @ white)
        felt, others = left[:, count:], left[:, 1:count]
        norm = np.sqrt(np.sum(others**2, axis=0))
        before = np.sqrt(np.sum(white[:, 1:count] ** 2, axis=0))
        kept = norm > LEAST_NORM * np.maximum(before, 1e-300)
        null[row] = -0.5 * np.sum(felt**2, axis=0) - half
        along = (others[:, kept] / norm[kept]).T @ felt
        gain[row] = 0.5 * np.max(along**2, axis=0, initial=0.0)
    return null, gain


def _friction_of(pull: Pull, friction: Array, noise: tuple[float, float, float]) -> Array:
    """Return (n,) the constant friction that fits best."""
    both = np.column_stack([friction, pull.force])
    white = np.empty_like(both)
    whitened(both, pull.step, *noise, white)
    return friction[:, 0] * float(white[:, 0] @ white[:, 1] / (white[:, 0] @ white[:, 0]))


def _drawn(rng: np.random.Generator, pull: Pull, noise: tuple[float, float, float], count: int) -> Array:
    """Draw (n, count) noise with texture along the way."""
    sensor, texture, length = noise
    out = np.empty((len(pull), count))
    state = np.zeros(count)
    for n, step in enumerate(pull.step.tolist()):
        kept = math.exp(-step / length)
        state = kept * state + texture * math.sqrt(1.0 - kept * kept) * rng.standard_normal(count)
        out[n] = state
    return out + sensor * rng.standard_normal(out.shape)
