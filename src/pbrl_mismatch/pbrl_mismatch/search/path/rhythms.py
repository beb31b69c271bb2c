"""What may push in a rhythm: frequencies at which the wrench that a model lacks is strong, with their phases."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.residual import ResidualWrench

Array = NDArray[np.float64]

SHARE = 0.7
"""Of the draws that are placed so; the others stay as the prior has them."""
BAND = (0.05, 4.0)
"""Frequencies that are looked at [Hz]."""
FINENESS = 6
"""So many frequencies in the width of a line, which is one over the recording's length."""
LINES = 5
"""So many of the strongest lines are drawn from."""
SCATTER = 0.15
"""Of a drawn frequency, of a line's width."""
THINNED = 5
"""Every so many steps of the residual are enough."""


def with_rhythms(
    rng: np.random.Generator, draws: Array, frequency: int, phase: int, residual: ResidualWrench, gyration: float
) -> Array:
    """Return draws (n, K) most of whose rhythms are lines of the residual wrench's spectrum (Lomb 1976).

    Args:
        rng: source of randomness.
        draws: of a prior.
        frequency: column of the frequency's logarithm.
        phase: column of the phase at time zero [rad].
        residual: what a model lacks.
        gyration: radius that makes a force of a torque [m].
    """
    time = residual.time[::THINNED]
    scale = np.array([1.0, 1.0, 1.0 / gyration])
    variance = np.einsum("tii,i->t", residual.covariance[::THINNED], scale**2)
    weight = 1.0 / np.maximum(variance, 1e-12)
    wrench = residual.world[::THINNED] * scale
    wrench = (wrench - np.average(wrench, axis=0, weights=weight)) * weight[:, None] / weight.sum()
    width = 1.0 / max(float(time[-1] - time[0]), 1.0)
    tried = np.arange(BAND[0], BAND[1], width / FINENESS)
    seen = np.exp(-2j * np.pi * tried[:, None] * time) @ wrench
    power = np.sum(np.abs(seen) ** 2, axis=1)
    if not np.isfinite(power).all() or power.max() <= 0.0:
        return draws
    lines = np.flatnonzero((power[1:-1] >= power[:-2]) & (power[1:-1] >= power[2:])) + 1
    lines = lines[np.argsort(-power[lines], kind="stable")][:LINES]
    if not len(lines):
        return draws
    count = int(SHARE * len(draws))
    chosen = rng.choice(lines, size=count, p=power[lines] / power[lines].sum())
    off = SCATTER * width * rng.standard_normal(count)
    # One phase for all components, the signs of their strengths are free; it is kept in the middle of the recording.
    common = 0.5 * np.angle(np.sum(seen[chosen] ** 2, axis=1)) + 0.5 * np.pi
    out = draws.copy()
    out[:count, frequency] = np.log(tried[chosen] + off)
    out[:count, phase] = np.angle(np.exp(1j * (common - 2.0 * np.pi * off * 0.5 * (time[0] + time[-1]))))
    return out
