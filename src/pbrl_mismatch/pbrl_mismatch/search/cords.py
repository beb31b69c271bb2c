"""Coordinates in which a cord's ridge is straight.

While a cord is taut a recording says which way it pulls and how far it is stretched, d - L; how long it is shows only
in how the way turns. Anchor and length may therefore be anywhere along a line through the cord, together: a curve in
x, y and log L, which draws that move by differences of others do not follow, and a straight line in d - L, the anchor's
bearing and log L.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.track import Track
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.search.hypothesis import Hypothesis

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Cord:
    """One cord.

    Attributes:
        x, y: coordinates of its anchor [m].
        length: coordinate of the logarithm of its slack length.
        end: (2,) where its end on the body was, on average, while it was taut [m].
        bearing: of the anchor from there, from which others are told [rad].
    """

    x: int
    y: int
    length: int
    end: Array
    bearing: float

    def straightened(self, points: Array) -> Array:
        """Return points (n, K) with stretch [m] and bearing [rad] in the place of x and y."""
        out, away = points.copy(), points[:, [self.x, self.y]] - self.end
        turn = np.arctan2(away[:, 1], away[:, 0]) - self.bearing
        out[:, self.x] = np.hypot(*away.T) - np.exp(points[:, self.length])
        out[:, self.y] = (turn + np.pi) % (2.0 * np.pi) - np.pi
        return out

    def bent(self, points: Array) -> Array:
        """Return points (n, K) with x and y in the place of stretch and bearing."""
        out, turn = points.copy(), points[:, self.y] + self.bearing
        distance = self.distance(points)
        out[:, self.x] = self.end[0] + distance * np.cos(turn)
        out[:, self.y] = self.end[1] + distance * np.sin(turn)
        return out

    def distance(self, straight: Array) -> Array:
        """Return how far the anchor is from the end (n,) [m], of straightened points (n, K)."""
        return np.asarray(straight[:, self.x] + np.exp(straight[:, self.length]), dtype=np.float64)


def cords_of(hypothesis: Hypothesis, coordinates: Array, track: Track) -> tuple[Cord, ...]:
    """Return the cords of a hypothesis whose anchors and lengths are free, about its coordinates (K,)."""
    columns, row, found = hypothesis.columns, hypothesis.rows(coordinates[None])[0], []
    for effect in (EFFECTS[name] for name in hypothesis.effects):
        if effect.cord is None or not {*effect.pulls[:2], effect.cord} <= set(columns):
            continue
        anchor, at = (row[[COLUMN[name] for name in names]] for names in (effect.pulls[:2], effect.pulls[2:]))
        c, s, arm = np.cos(track.seen[:, 2]), np.sin(track.seen[:, 2]), at - track.body[1:3]
        ends = track.seen[:, :2] + np.stack([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]], -1)
        taut = np.hypot(*(ends - anchor).T) > row[COLUMN[effect.cord]]
        end = ends[taut].mean(axis=0) if taut.any() else ends.mean(axis=0)
        x, y = (columns.index(name) for name in effect.pulls[:2])
        bearing = float(np.arctan2(anchor[1] - end[1], anchor[0] - end[0]))
        found.append(Cord(x, y, columns.index(effect.cord), end, bearing))
    return tuple(found)


def straightened(cords: Sequence[Cord], points: Array) -> Array:
    """Return points (n, K) in coordinates in which no cord's ridge is bent."""
    for cord in cords:
        points = cord.straightened(points)
    return points


def bent(cords: Sequence[Cord], straight: Array) -> Array:
    """Return points (n, K) in a hypothesis's own coordinates."""
    for cord in cords:
        straight = cord.bent(straight)
    return straight


def log_volume(cords: Sequence[Cord], straight: Array) -> Array:
    """Return the log of the volume (n,) of a unit of volume at straightened points (n, K); -inf: there is none."""
    out = np.zeros(len(straight))
    with np.errstate(divide="ignore"):
        for cord in cords:
            out += np.log(np.maximum(cord.distance(straight), 0.0))
    return out
