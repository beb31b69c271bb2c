"""Where a floor may hold feet back: the wrench that a model lacks, as the friction of floor tiles that feet stood on.

Each foot's friction is along its velocity and as its load, a wheel's along the way that it rolls; which of them stood
on which tile is known. What is left is a regression with coefficients that are not negative (Lawson and Hanson 1974),
and rectangles about the tiles that hold.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from shapely.geometry import MultiPoint

from pbrl_mismatch.data.residual import ResidualWrench
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.kernels.columns import COLUMN

Array = NDArray[np.float64]

TILE = 0.1
"""Side of a tile [m]."""
SLIDES = 0.01
"""Friction of a foot that is slower than this is not known [m/s]."""
EVERY = 12
"""So many steps of the residual make one equation: it is smooth over as many."""
CALM = 1.0
"""Ridge on the tiles' friction, in standard deviations of a prior of a tenth."""
SUREST = 1e-3
"""A wrench is known no better than this [N, N m]."""
SHARE, SCATTER, STRETCHED = 0.7, 0.06, 0.15
"""Of the draws that are placed so; how far middles are moved [m], and sides and angles stretched and turned."""
LEVELS = (0.2, 0.7)
"""Of the strongest tile's friction: what holds more belongs to a region, drawn anew for each."""
WIDER = 0.03
"""Least half of a region's side [m]."""


def tile_friction(track: Track, residual: ResidualWrench, weight: float, row: Array) -> tuple[Array, Array]:
    """Return middles of tiles (n, 2) that feet slid over [m], and the friction coefficient of each (n,).

    Args:
        track: with the feet.
        residual: what a model lacks, of a model as it was believed to be.
        weight: of the body [N].
        row: (WIDTH,) of that model, for its wheel.
    """
    rows = np.arange(0, len(residual.time), EVERY)
    x, y, turn, vx, vy, omega = residual.state[rows].T
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    wheel, rolls = _rolling(row)
    points = np.vstack([track.feet, wheel]) - track.body[1:3]
    rx, ry = c * points[:, 0] - s * points[:, 1], s * points[:, 0] + c * points[:, 1]
    ux, uy = vx[:, None] - omega[:, None] * ry, vy[:, None] + omega[:, None] * rx
    for k in range(len(track.feet), len(points)):
        ex, ey = (c * rolls[0] - s * rolls[1])[:, 0], (s * rolls[0] + c * rolls[1])[:, 0]
        way = ux[:, k] * ex + uy[:, k] * ey
        ux[:, k], uy[:, k] = way * ex, way * ey
    speed = np.hypot(ux, uy)
    load = weight / len(track.feet) * (speed > SLIDES) / np.maximum(speed, SLIDES)
    push = np.stack([-ux * load, -uy * load, -(rx * uy - ry * ux) * load], -1)
    place = np.stack([x[:, None] + rx, y[:, None] + ry], -1)
    tiles, owner = np.unique(np.floor(place / TILE).astype(np.int64).reshape(-1, 2), axis=0, return_inverse=True)
    owner = owner.reshape(place.shape[:2])
    matrix = np.zeros((len(rows), 3, len(tiles)))
    for k in range(len(points)):
        np.add.at(matrix, (np.arange(len(rows))[:, None], np.arange(3), owner[:, k, None]), push[:, k])
    unsure, turned = np.linalg.eigh(residual.covariance[rows])
    whiten = np.swapaxes(turned, -1, -2) / np.maximum(np.sqrt(np.maximum(unsure, 0.0)), SUREST)[..., None]
    matrix = (whiten @ matrix).reshape(-1, len(tiles))
    target = (whiten @ residual.world[rows][..., None]).reshape(-1)
    ridge = CALM * 10.0 * np.eye(len(tiles))
    found, _ = nnls(np.vstack([matrix, ridge]), np.concatenate([target, np.zeros(len(tiles))]))
    middles = (tiles + 0.5) * TILE
    return np.asarray(middles, dtype=np.float64), np.asarray(found, dtype=np.float64)


def _rolling(row: Array) -> tuple[Array, Array]:
    """Return the place (1, 2) of a model's wheel [m], or none, and the way that it rolls (2,), in the body's frame."""
    along, across = row[COLUMN["mu_x"]], row[COLUMN["mu_y"]]
    if across <= 0.0 or along <= 0.0:  # none, or one that does not roll
        return np.empty((0, 2)), np.zeros(2)
    angle = row[COLUMN["wheel_theta"]] + (0.0 if along < across else 0.5 * math.pi)
    return row[[COLUMN["wheel_x"], COLUMN["wheel_y"]]][None], np.array([math.cos(angle), math.sin(angle)])


def with_regions(
    rng: np.random.Generator, draws: Array, columns: tuple[int, int, int, int, int], tiles: Array, friction: Array
) -> Array:
    """Put rectangles about tiles that hold into most of the draws (n, K); half sides are logarithms.

    Args:
        rng: which tiles, and how far off.
        draws: coordinates.
        columns: of x, y, the halves of length and width, and the angle.
        tiles: (m, 2) see `tile_friction`.
        friction: (m,).
    """
    out = draws.copy()
    if len(tiles) == 0 or friction.max() <= 0.0:
        return out
    for row in np.flatnonzero(rng.random(len(out)) < SHARE):
        held = friction > rng.uniform(*LEVELS) * friction.max()
        seed = rng.choice(np.flatnonzero(held), p=friction[held] / friction[held].sum())
        x, y, length, width, angle = _rectangle(tiles[_grown(tiles, held, int(seed))])
        moved = SCATTER * rng.standard_normal(2)
        stretch = STRETCHED * rng.standard_normal(3)
        out[row, list(columns)] = (
            x + moved[0],
            y + moved[1],
            math.log(length) + stretch[0],
            math.log(width) + stretch[1],
            angle + stretch[2],
        )
    return out


def _grown(tiles: Array, held: NDArray[np.bool_], seed: int) -> NDArray[np.int64]:
    """Return the tiles that hold and hang together with one of them, a gap of a tile allowed."""
    rest = set(np.flatnonzero(held).tolist()) - {seed}
    region, border = [seed], [seed]
    while border:
        here = tiles[border.pop()]
        near = [k for k in rest if np.max(np.abs(tiles[k] - here)) < 2.5 * TILE]
        rest.difference_update(near)
        region += near
        border += near
    return np.array(region)


def _rectangle(points: Array) -> tuple[float, float, float, float, float]:
    """Return the least rectangle about tiles: middle, half of length and width [m], angle within an eighth turn."""
    box = MultiPoint(points).buffer(0.5 * TILE).minimum_rotated_rectangle
    corners = np.array(box.exterior.coords)[:4]
    sides = np.diff(corners[:3], axis=0)
    first, second = np.hypot(*sides.T)
    angle = math.atan2(sides[0, 1], sides[0, 0])
    turns = round(angle / (0.5 * math.pi))
    length, width = (first, second) if turns % 2 == 0 else (second, first)
    middle = corners.mean(axis=0)
    halves = (max(0.5 * length, WIDER), max(0.5 * width, WIDER))
    return float(middle[0]), float(middle[1]), *halves, angle - turns * 0.5 * math.pi
