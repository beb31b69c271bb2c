"""The Gaussian at the top of any log density: damped Newton by differences, from several starts at once.

Differences are taken along the axes of the Gaussian that is guessed, over one of its standard deviations and not an
infinitesimal step: a ridge that is a thousand times longer than wide is seen along and across alike, and a density that
is rough on a smaller scale (bodies that stick and slip) still has a shape on that one, which is what a sampler needs.
The axes stay the first guess's for that reason: drawn after the curvature they would shrink into the roughness.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LogDensity = Callable[[Array], Array]

LEAST, MOST = 1e-4, 0.7
"""Axes are never taken shorter or longer than these shares of the scale."""
STEEPEST = 30.0
"""A density that falls further than this within one difference counts as having fallen so far [nat]."""
FLATTEST, SHARPEST = 0.1, 4.0
"""Bounds of a curvature in units of the axis it is taken along."""
LONGEST = 5.0
"""No step is longer than so many axes."""
SHARES = np.array([1.0, 0.5, 0.2, 0.05])
"""Of a step that are tried."""
ARRIVED = 0.05
"""A climb that promises less than this is over [nat]."""
SAME = 1.0
"""Tops nearer than this in their own standard deviations are one."""


@dataclass(frozen=True)
class Tops:
    """Where climbs ended, best first, each once.

    Attributes:
        position: (M, D).
        log_density: (M,).
        covariance: (M, D, D) of the Gaussian that fits there.
    """

    position: Array
    log_density: Array
    covariance: Array


def climb(log_density: LogDensity, start: Array, covariance: Array, scale: Array, *, iterations: int = 6) -> Tops:
    """Climb from every start and fit a Gaussian there.

    Args:
        log_density: (P, D) -> (P,), -inf where the density is zero.
        start: (M, D) of positive density.
        covariance: (M, D, D) first guess of the Gaussians.
        scale: (D,) how far apart values are that are surely different, such as the prior's spread.
        iterations: at most so many.
    """
    position, axes = start.copy(), principal_axes(covariance, scale)
    every = np.arange(len(position))
    for k in range(iterations + 1):
        value, slope, bend = differences(log_density, position, axes)
        values, vectors = np.linalg.eigh(-bend)
        bounded = np.clip(np.abs(values), FLATTEST, SHARPEST)
        along = np.einsum("mij,mi->mj", vectors, slope)
        step = np.einsum("mij,mj->mi", vectors, along / bounded)
        promised = 0.5 * np.sum(along**2 / bounded, axis=1)
        turned = axes @ vectors
        covariance = (turned / bounded[:, None, :]) @ np.swapaxes(turned, -1, -2)
        if k == iterations or np.all(promised < ARRIVED):
            break
        step *= np.minimum(1.0, LONGEST / np.maximum(np.linalg.norm(step, axis=1), 1e-12))[:, None]
        move = np.einsum("mij,mj->mi", axes, step)
        trials = position[:, None] + SHARES[:, None] * move[:, None]
        found = _finite(log_density(trials.reshape(-1, start.shape[1]))).reshape(trials.shape[:2])
        best = np.argmax(found, axis=1)
        gained = found[every, best] > value
        if not np.any(gained):
            break
        position = np.where(gained[:, None], trials[every, best], position)
    return _once(position, value, covariance)


def principal_axes(covariance: Array, scale: Array) -> Array:
    """Return (M, D, D) whose columns are the axes of ellipsoids, none shorter or longer than shares of the scale."""
    outer = np.outer(scale, scale)
    values, vectors = np.linalg.eigh(covariance / outer)
    return scale[:, None] * vectors * np.clip(np.sqrt(np.maximum(values, 0.0)), LEAST, MOST)[:, None, :]


def differences(log_density: LogDensity, position: Array, axes: Array) -> tuple[Array, Array, Array]:
    """Return value (M,), slope (M, D) and second derivatives (M, D, D), in units of the axes (M, D, D)."""
    count, d = position.shape
    row, column = np.triu_indices(d, 1)
    unit = np.eye(d)
    moves = np.concatenate([np.zeros((1, d)), unit, -unit, unit[row] + unit[column]])
    points = position[:, None] + np.einsum("mij,qj->mqi", axes, moves)
    values = _finite(log_density(points.reshape(-1, d))).reshape(count, -1)
    middle = values[:, :1]
    values = np.maximum(values, middle - STEEPEST)
    plus, minus, both = values[:, 1 : d + 1], values[:, d + 1 : 2 * d + 1], values[:, 2 * d + 1 :]
    bend = np.zeros((count, d, d))
    bend[:, np.arange(d), np.arange(d)] = plus + minus - 2.0 * middle
    # One corner alone is off by the third order, which does not matter for a shape.
    bend[:, row, column] = bend[:, column, row] = both - plus[:, row] - plus[:, column] + middle
    return middle[:, 0], 0.5 * (plus - minus), bend


def _finite(values: Array) -> Array:
    return np.where(np.isfinite(values), values, -1e300)


def _once(position: Array, value: Array, covariance: Array) -> Tops:
    """Keep the best of tops that are one."""
    kept: list[int] = []
    for row in np.argsort(-value, kind="stable"):
        offset = position[kept] - position[row]
        apart = np.einsum("mi,mij,mj->m", offset, np.linalg.inv(covariance[kept]), offset)
        if np.all(apart > SAME**2):
            kept.append(int(row))
    return Tops(position[kept], value[kept], covariance[kept])
