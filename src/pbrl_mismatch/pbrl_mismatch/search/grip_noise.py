"""Noise of grippers' poses against contacts, which is like itself for a while.

It is that of means of poses, and stays like itself as exp(-|t - t'| / tau) does: taken for independent, its slow swings
would pass for a hold that gives way. tau has the largest restricted likelihood (Patterson and Thompson 1971), which
counts what the fit has used up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.grip import GripTrack

Array = NDArray[np.float64]

RANK = 1e-4
"""Directions of the places that are weaker than this share of the strongest are none."""
LEAST_FREE = 8
"""Numbers that the readings must have beyond what is learned of them, or their noise is not known."""
NOISELESS = 1e-12
"""Sum of squares that the richest law is taken to leave at least [m^2]."""
LASTS = (0.0, 0.15, 0.3, 0.45, 0.6, 0.9, 1.3, 2.0)
"""How long the noise may be like itself [s]; none: each reading's is its own."""


@dataclass(frozen=True)
class GripNoise:
    """Noise that is like itself for a while, and how likely it is.

    Attributes:
        kept: (N,) share of its last reading's noise that a reading has, 0 for the first of a grasp.
        likelihood: log of its restricted likelihood [nat], up to a common constant.
        rest: sum of squares that the richest law leaves, whitened [m^2].
        count: degrees of freedom of those.
    """

    kept: Array
    likelihood: float
    rest: float
    count: int

    def whitened(self, rows: Array) -> Array:
        """Return rows (2 N, ...) whose noise is independent."""
        return _whitened(self.kept, rows)


def grip_noise(grips: GripTrack, every: Array, seen: Array) -> GripNoise | None:
    """Find the noise beside the richest law (2 N, K) of what was seen (2 N,); None where too little is left to see."""
    own, size, _ = np.linalg.svd(every, full_matrices=False)
    own = own[:, size > RANK * size[0]]
    gap, same = np.abs(np.diff(grips.time)), np.diff(grips.grasp) == 0
    count = len(seen) - own.shape[1]
    if count < LEAST_FREE:
        return None

    def lasting(tau: float) -> GripNoise:
        kept = np.concatenate([[0.0], np.exp(-gap / tau) * same if tau > 0.0 else 0.0 * gap])
        basis, corner = np.linalg.qr(_whitened(kept, own))
        white = _whitened(kept, seen)
        left = white - basis @ (basis.T @ white)
        rest = max(float(left @ left), NOISELESS)
        # Both axes have the same correlation: the root of its determinant is one axis's whole.
        likelihood = -float(np.sum(np.log1p(-(kept**2)))) - float(np.sum(np.log(np.abs(np.diag(corner)))))
        return GripNoise(kept, likelihood - 0.5 * count * math.log(rest), rest, count)

    return max(map(lasting, LASTS), key=lambda each: each.likelihood)


def _whitened(kept: Array, rows: Array) -> Array:
    """Return rows (2 N, ...) less what they keep (N,) of those before, at one size."""
    pairs = rows.reshape(len(kept), -1)
    own = np.sqrt(1.0 - kept**2)
    white = (pairs - kept[:, None] * np.roll(pairs, 1, axis=0)) / own[:, None]
    return np.asarray(white.reshape(rows.shape), dtype=np.float64)
