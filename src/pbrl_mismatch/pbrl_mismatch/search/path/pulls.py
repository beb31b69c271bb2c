"""Where something may pull at a body: points on the residual wrench's line of action, and the place they are drawn to.

A force f with moment tau about the centre of mass acts along the line of points p with p x f = tau. A catch holds a
point of that line near where it is now; a cord holds it from a place further along the force. One way through a catch
leaves open which point of the line it holds. The one that is at one place at two moments, with two headings, is told:
pairs of moments are drawn too, as a minimal sample of what the motion says (Fischler and Bolles 1981).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.residual import ResidualWrench
from pbrl_mismatch.data.track import Track

Array = NDArray[np.float64]

SHARE = 0.7
"""Of the draws that are placed so; the others stay as the prior has them."""
BESIDE = 0.4
"""A catch is passed within about so long of where it pulls [s]."""
TAUT = 0.15
"""About how much a cord is stretched [m]."""
TWICE = 0.8
"""Of the draws of a catch that are placed so many lie where one point was at two moments."""
TURNED = 0.05
"""Two moments tell a point where the body has turned in between by more [rad]."""
SPREAD = 0.15
"""Scatter of the line of action, of half the footprint's extent."""


def with_pulls(
    rng: np.random.Generator,
    draws: Array,
    place: tuple[int, int],
    point: tuple[int, int] | None,
    cord: int | None,
    track: Track,
    residual: ResidualWrench,
) -> Array:
    """Return draws (n, K) most of whose places and points lie where the residual wrench pulls.

    Args:
        rng: source of randomness.
        draws: of a prior.
        place: columns of the place in the world that a point of the body is drawn to.
        point: columns of that point in the body's frame; None: it is the frame's origin.
        cord: column of the logarithm of a cord's slack length; None: a catch.
        track: with the outline.
        residual: what a model lacks.
    """
    strength = np.minimum(residual.significance, 30.0) ** 2
    if not np.isfinite(strength).all() or strength.sum() <= 0.0:
        return draws
    out, count = draws.copy(), int(SHARE * len(draws))
    rows = rng.choice(len(strength), size=count, p=strength / strength.sum())
    angle = residual.state[rows, 2]
    c, s = np.cos(angle), np.sin(angle)
    force, torque = residual.world[rows, :2], residual.world[rows, 2]
    size = np.maximum(np.hypot(*force.T), 1e-9)
    along = force / size[:, None]
    com, half = track.body[1:3], 0.5 * np.ptp(track.outline, axis=0)
    reach = float(np.hypot(*half))
    # Points of the line, in world axes from the centre of mass; moments that no point of the body has are cut.
    offset = np.clip(torque / size, -reach, reach) + SPREAD * reach * rng.standard_normal(count)
    shift = rng.uniform(-reach, reach, count)
    arm = np.column_stack([along[:, 1], -along[:, 0]]) * offset[:, None] + along * shift[:, None]
    body = np.column_stack([c * arm[:, 0] + s * arm[:, 1], -s * arm[:, 0] + c * arm[:, 1]]) + com
    middle = track.outline.min(axis=0) + half
    body = np.clip(body, middle - half, middle + half) if point is not None else np.zeros_like(body)
    if cord is None:
        beside = np.clip(rows + np.round(BESIDE / track.dt * rng.standard_normal(count)), 0, len(track.clock) - 1)
        if point is not None:
            other = rng.choice(len(strength), size=count, p=strength / strength.sum())
            twice, told = at_both(residual.state[rows], residual.state[other])
            told &= (np.abs(twice + com - middle) <= half).all(axis=1) & (rng.random(count) < TWICE)
            body[told], beside[told] = twice[told] + com, rows[told]
        there = _place(residual.state[beside.astype(np.int64)], body - com)
    else:
        length = np.exp(draws[:count, cord])
        stretch = TAUT * rng.random(count)
        there = _place(residual.state[rows], body - com) + along * (length + stretch)[:, None]
    out[:count, place] = there
    if point is not None:
        out[:count, point] = body
    return out


def at_both(one: Array, other: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the points (n, 2) of the body from its centre of mass that are at one place in two states (n, 6).

    Where the body has not turned in between there is none, which is told beside (n,).
    """
    rotations = np.exp(1j * one[:, 2]) - np.exp(1j * other[:, 2])
    told = np.abs(rotations) > TURNED
    way = (other[:, :2] - one[:, :2]) @ np.array([1.0, 1j])
    found = np.where(told, way / np.where(told, rotations, 1.0), 0.0)
    return np.column_stack([found.real, found.imag]), told


def _place(state: Array, arm: Array) -> Array:
    """Return where points (n, 2) of the body from its centre of mass are in the world, for states (n, 6)."""
    c, s = np.cos(state[:, 2]), np.sin(state[:, 2])
    turned = np.column_stack([c * arm[:, 0] - s * arm[:, 1], s * arm[:, 0] + c * arm[:, 1]])
    return state[:, :2] + turned
