"""Doors that are pulled in a few lines: the truth of the tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.joint.pull import Hinge, Pull

Array = NDArray[np.float64]

RADIUS = 0.4


def pulled(force: Array, angle: Array) -> Pull:
    """Return a door opened once, at times faster, with a known force along its path."""
    hinge = Hinge(np.zeros(2), RADIUS, np.array([0.002, 0.002, 0.002]), 0.001, 0.0, 1.0)
    count = len(angle)
    time = np.cumsum(0.03 + 0.02 * np.sin(0.2 * np.arange(count)))
    speed = RADIUS * np.gradient(angle, time)
    travelled = angle - angle[0]
    zeros = np.zeros(count)
    return Pull("door", hinge, angle, force, zeros, speed, np.ones(count), time, travelled, zeros.astype(np.int64))


def opened(degrees: float = 80.0, step: float = 0.5) -> Array:
    return np.radians(np.arange(0.0, degrees, step))


def texture(rng: np.random.Generator, angle: Array, strength: float = 0.2, length: float = 3.0) -> Array:
    """Draw roughness that is forgotten over `length` [degrees], by the Cholesky factor of its covariance."""
    away = np.abs(angle[:, None] - angle[None]) / np.radians(length)
    covariance = strength**2 * np.exp(-away) + 1e-9 * np.eye(len(angle))
    drawn: Array = np.linalg.cholesky(covariance) @ rng.standard_normal(len(angle))
    return drawn


def noise(rng: np.random.Generator, angle: Array, sensor: float = 0.1) -> Array:
    return texture(rng, angle) + sensor * rng.standard_normal(len(angle))


def bump(angle: Array, at: float, width: float) -> Array:
    """Return a catch of one newton at `at` [degrees]."""
    shape: Array = np.exp(-0.5 * ((np.degrees(angle) - at) / width) ** 2)
    return shape
