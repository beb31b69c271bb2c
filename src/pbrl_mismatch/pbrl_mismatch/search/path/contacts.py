"""Where something may have touched a body: the residual wrench's line of action, met with the footprint's outline.

A force f with moment tau about the centre of mass acts along the line of points p with p x f = tau. A contact pushes
inwards, so it is where that line enters the footprint.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.residual import ResidualWrench
from pbrl_mismatch.data.track import Track

Array = NDArray[np.float64]

SURE = 2.0
"""A residual of so many standard deviations may be a contact."""
MOST_TIMES = 400
FREE = 0.3
"""A touch begins where for so long there was none [s]."""
SCATTER = 0.02
"""Draws lie so far from where the line says [m]."""


def contact_points(track: Track, residual: ResidualWrench, *, met: bool = False) -> tuple[Array, Array]:
    """Return places in world (n, 2) [m] where something may have touched, and outward normals (n, 2).

    Args:
        track: with the outline.
        residual: what a model lacks.
        met: half of the places are where a touch begins: what is pushed along from there was nowhere else before.
    """
    size = np.hypot(residual.world[:, 0], residual.world[:, 1])
    touched = (residual.significance > SURE) & (size > 0.2 * size.max())
    rows = np.flatnonzero(touched)
    rows = rows[:: max(1, len(rows) // MOST_TIMES)]
    if met and len(rows):
        before = np.concatenate([[0], np.cumsum(touched)])
        since = np.maximum(np.arange(len(touched)) - round(FREE / track.dt), 0)
        begins = np.flatnonzero(touched & (before[:-1] - before[since] == 0))
        rows = np.concatenate([rows, np.resize(begins, len(rows))])
    places, normals = [], []
    com, body = track.body[1:3], residual.body
    for t in rows:
        fx, fy, tau = body[t]
        inward = np.array([fx, fy]) / np.hypot(fx, fy)
        found = _entry(track.outline - com, inward, tau / np.hypot(fx, fy))
        if found is None:
            continue
        c, s = np.cos(residual.state[t, 2]), np.sin(residual.state[t, 2])
        turn = np.array([[c, -s], [s, c]])
        places.append(residual.state[t, :2] + turn @ found)
        normals.append(-turn @ inward)
    if not places:
        return np.empty((0, 2)), np.empty((0, 2))
    return np.array(places), np.array(normals)


def _entry(outline: Array, inward: Array, offset: float) -> Array | None:
    """Return where the line {p : p x inward = offset} enters a polygon, or the corner nearest to it where it misses."""
    ends = np.roll(outline, -1, axis=0)
    first = outline[:, 0] * inward[1] - outline[:, 1] * inward[0] - offset
    last = ends[:, 0] * inward[1] - ends[:, 1] * inward[0] - offset
    crossed = first * last < 0.0
    if not crossed.any():
        return outline[int(np.argmin(np.abs(first)))]
    share = first[crossed] / (first[crossed] - last[crossed])
    points = outline[crossed] + share[:, None] * (ends[crossed] - outline[crossed])
    return points[int(np.argmin(points @ inward))]


def with_contacts(
    rng: np.random.Generator, draws: Array, columns: tuple[int, int, int], places: Array, normals: Array
) -> Array:
    """Put discs where something may have touched into two thirds of the draws (n, K); radii as logarithms stay.

    Args:
        rng: which places, and how far from them.
        draws: coordinates.
        columns: of x, y and of the logarithm of the radius.
        places: (m, 2) see `contact_points`.
        normals: (m, 2).
    """
    out = draws.copy()
    if len(places) == 0:
        return out
    chosen = rng.integers(0, len(places), len(out))
    centre = places[chosen] + np.exp(out[:, columns[2]])[:, None] * normals[chosen]
    centre += SCATTER * rng.standard_normal(centre.shape)
    moved = np.arange(len(out)) % 3 > 0
    for k in range(2):
        out[moved, columns[k]] = centre[moved, k]
    return out
