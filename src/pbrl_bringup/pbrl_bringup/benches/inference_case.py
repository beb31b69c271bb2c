"""What is known of the wheel with two modes (`test/data/wheel_evidence`), for our bench and for the peers' program."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LOG_EVIDENCE = 6307.80
TRUTH = np.array([18.0, 0.22, -0.08, 0.40, 0.04, 0.45, 0.0])
SD = np.array([0.0027, 0.000058, 0.000085, 0.00028, 0.000082, 0.00033, 0.0177])
"""Posterior standard deviations in one mode."""
WHEEL_THETA = 3
BETWEEN_MODES = TRUTH[WHEEL_THETA] - np.pi / 4
"""[rad] the second mode's wheel is turned back by a quarter: its angle is below this."""


def second_share(theta: Array, weights: Array | None = None) -> float:
    """Return the share of the weight (n,) of draws (n, 7) that is in the second mode."""
    return float(np.average(theta[:, WHEEL_THETA] < BETWEEN_MODES, weights=weights))
