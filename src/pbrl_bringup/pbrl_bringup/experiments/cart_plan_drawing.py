"""Robot and cart on a plan, from above, as in thesis figure 18: blue is the robot, green the cart, red the goal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from pbrl_bringup.experiments.cart_passages import Passage
from pbrl_control.planar import Array
from pbrl_planner.lattice import ArticulatedBody

COLOURS = {"robot": "#2c5fa8", "cart": "#2f9e5b", "arms": "#8a8f98"}
SWEPT = "#f3d9a4"
WALL = "#3b3f46"
GOAL = "#c0392b"
EVERY = 0.28
"""Between two outlines: how far the corner that moves most has gone [m]."""
ARROW = 0.45
"""[m]"""


@dataclass(frozen=True)
class Drawn:
    """What is shown: of which kind, in which passage, poses (n, 4), and the area that they sweep [m^2]."""

    kind: str
    passage: Passage
    poses: Array
    area: float


def draw_passage(axes: Axes, passage: Passage) -> None:
    """Draw walls, and the goal as an arrow."""
    shade = np.zeros((*passage.occupied.shape, 4))
    shade[passage.occupied] = [*(int(WALL[k : k + 2], 16) / 255 for k in (1, 3, 5)), 1.0]
    axes.imshow(shade, origin="lower", extent=passage.extent, interpolation="nearest", zorder=1)
    x, y, heading, _ = passage.goal
    ahead = ARROW * np.array([np.cos(heading), np.sin(heading)])
    axes.annotate(
        "",
        xy=(x + ahead[0], y + ahead[1]),
        xytext=(x, y),
        arrowprops={"color": GOAL, "width": 2.5, "headwidth": 9},
        zorder=6,
    )
    axes.set_aspect("equal")


def draw_sweep(axes: Axes, body: ArticulatedBody, poses: Array) -> None:
    """Draw what is swept along poses (n, 4), and outlines of robot and cart on the way."""
    fine = body.between(poses, 0.02)
    rings = body.outlines(fine)
    swept = shapely.union_all([shapely.polygons(each) for each in rings.values()])
    for part in shapely.get_parts(swept):
        axes.add_patch(Polygon(np.array(part.exterior.coords), closed=True, fc=SWEPT, ec="#b98b2f", lw=0.8, zorder=2))
        for hole in part.interiors:
            axes.add_patch(Polygon(np.array(hole.coords), closed=True, fc="white", ec="#b98b2f", lw=0.8, zorder=2))
    chosen = spaced(np.concatenate(list(rings.values()), axis=1), EVERY)
    for name, each in rings.items():
        for k in chosen:
            last = k in (0, len(fine) - 1)
            axes.add_patch(
                Polygon(
                    each[k],
                    closed=True,
                    fill=False,
                    ec=COLOURS[name],
                    lw=1.8 if last else 0.7,
                    alpha=1.0 if last else 0.7,
                    zorder=5 if last else 4,
                )
            )
    axes.plot(*fine[:, :2].T, color="#111", lw=1.0, zorder=5)


def spaced(corners: Array, every: float) -> Sequence[int]:
    """Return the numbers of those of n sets of corners (n, k, 2) between which some corner has moved so far [m]."""
    moved = np.hypot(*np.diff(corners, axis=0).transpose(2, 0, 1)).max(axis=1)
    way = np.concatenate(([0.0], np.cumsum(moved)))
    steps = np.arange(0.0, way[-1], every)
    return sorted({*np.searchsorted(way, steps).tolist(), len(corners) - 1})


def crop(axes: Axes, places: Array, room: float) -> None:
    """Show what is about places (n, 2), and so much around [m]."""
    low, high = places.min(axis=0) - room, places.max(axis=0) + room
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.tick_params(labelsize=7)
