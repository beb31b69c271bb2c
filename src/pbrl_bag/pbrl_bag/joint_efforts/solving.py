"""From torques at the joints to the wrench at the tip: J^T w = tau, in the least squares that knows its own error.

J^T is seldom square and at times singular: a stretched arm feels nothing along itself, and one of four joints cannot
tell every force from every torque. What a hand could exert at all enters as a prior, so that the pseudo-inverse stays
bounded, and a direction that the joints do not tell has a covariance that says so:

    w = C J Sigma^-1 tau,    C = (J Sigma^-1 J^T + P^-1)^-1.
"""

from __future__ import annotations

import numpy as np

from pbrl_bag.types import Array

PLAUSIBLE = np.array([200.0, 200.0, 200.0, 40.0, 40.0, 40.0])
"""Standard deviation of what a hand exerts [N, N m] before the joints have told anything."""
UNTOLD = 0.5
"""A direction of which the joints leave more than this share of `PLAUSIBLE` open is one that they do not tell."""


def tip_wrenches(jacobians: Array, torques: Array, noise: Array, *, point: bool = False) -> tuple[Array, Array]:
    """Return wrenches (n, 6) [N, N m] and their covariances (n, 6, 6), in the axes of the tip.

    Args:
        jacobians: (n, 6, k) of the tip, see `Arm.jacobians`.
        torques: (n, k) that the wrench makes at the joints [N m].
        noise: (k,) standard deviation of each [N m].
        point: the hand exerts a force only; torques and their covariance are then NaN.
    """
    rows = 3 if point else 6
    scale = PLAUSIBLE[:rows]
    seen = np.swapaxes(jacobians[:, :rows], 1, 2) * scale / noise[:, None]
    left = np.linalg.inv(np.swapaxes(seen, 1, 2) @ seen + np.eye(rows))
    mean = np.einsum("nij,nkj,nk->ni", left, seen, torques / noise) * scale
    wrench, covariance = np.full((len(torques), 6), np.nan), np.full((len(torques), 6, 6), np.nan)
    wrench[:, :rows], covariance[:, :rows, :rows] = mean, left * scale[:, None] * scale
    return wrench, covariance


def untold(covariances: Array) -> list[tuple[float, Array]]:
    """Return the directions that the joints do not tell: share of samples, and (6,) unit direction at the worst.

    Directions are over `PLAUSIBLE`, so that forces and torques compare; one that comes and goes is found by its place
    in the order of size.

    Args:
        covariances: (n, 6, 6), NaN where no torque is asked for.
    """
    rows = 3 if np.isnan(covariances).any() else 6
    scale = PLAUSIBLE[:rows]
    values, vectors = np.linalg.eigh(covariances[:, :rows, :rows] / (scale[:, None] * scale))
    found = []
    for k in reversed(range(rows)):
        share = float((values[:, k] > UNTOLD**2).mean()) if len(values) else 0.0
        if share > 0.0:
            direction = np.zeros(6)
            direction[:rows] = vectors[int(np.argmax(values[:, k])), :, k]
            found.append((share, direction))
    return found
