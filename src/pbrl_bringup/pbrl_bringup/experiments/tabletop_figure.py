"""Figures of the tabletop: costs over time, what a run did to each item, film strips, displacement models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon, Rectangle

from pbrl_bringup.experiments.figures import canvas, save
from pbrl_bringup.tabletop.pictures import Pictures
from pbrl_bringup.tabletop.tidy import Outcome
from pbrl_control.planar import Array, placed
from pbrl_planner.tabletop import Desk, Item

COLOURS = ("#3a7bd9", "#d98b3a", "#5aa469", "#a05aa4", "#c2185b", "#7a7a3a")
MOST_OUTLINES = 25
"""Of one item; a run of many pushes would be black."""


def draw_layouts(axes: Axes, desk: Desk, layouts: Sequence[Array]) -> Axes:
    """Draw a table with the outlines that each item went through, the last one filled."""
    low, high = desk.table.low, desk.table.high
    length, width = high - low
    axes.add_patch(Rectangle((low[0], low[1]), length, width, fc="#fafafa", ec="#444", lw=1.5))
    for item, pose in desk.obstacles:
        axes.add_patch(Polygon(outline(item, pose), closed=True, fc="#777", ec="#444"))
    for k, item in enumerate(desk.items):
        colour, poses = COLOURS[k % len(COLOURS)], [layout[k] for layout in layouts]
        changed = [poses[0], *(b for a, b in pairwise(poses) if not np.allclose(a, b, atol=1e-3))]
        every = max(len(changed) // MOST_OUTLINES, 1)
        for number, pose in enumerate(changed[::every]):
            faint = 0.25 + 0.5 * number * every / len(changed)
            axes.add_patch(Polygon(outline(item, pose), closed=True, fc="none", ec=colour, lw=0.8, alpha=faint))
        axes.add_patch(Polygon(outline(item, poses[0]), closed=True, fc="none", ec=colour, lw=1.5, ls=":"))
        axes.add_patch(Polygon(outline(item, poses[-1]), closed=True, fc=f"{colour}66", ec=colour, lw=2.0))
        axes.text(poses[-1][0], poses[-1][1], item.name, ha="center", va="center", fontsize=7)
    axes.set_xlim(low[0] - 0.03, high[0] + 0.03)
    axes.set_ylim(low[1] - 0.03, high[1] + 0.03)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    return axes


def outline(item: Item, pose: Array) -> Array:
    """Return the corners (4, 2) of an item at a pose (3,) [m]."""
    return placed(item.half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), pose)


def draw_run(desk: Desk, layouts: Sequence[Array], pictures: Pictures, outcome: Outcome, out: Path) -> None:
    """Draw what a run did, and its film strip, into `run.png` and `film.png`."""
    figure, (axes,) = canvas(1, width=8.0, height=5.4)
    draw_layouts(axes, desk, layouts)
    axes.set_title(
        f"{outcome.pushes} pushes, {outcome.replans} times planned anew; cost {outcome.first_cost:.2f} to "
        f"{outcome.cost:.2f}: {outcome.ending.lower()}\ndotted: at the start; filled: in the end",
        fontsize=9,
    )
    save(figure, out, "run")
    strip = pictures.strip()
    columns = min(len(strip), 3)
    rows = -(-len(strip) // columns)
    figure, _ = canvas(0, width=3.7 * columns, height=2.5 * rows + 0.4)
    figure.suptitle("seen from across the table, the arm behind it: x grows to the left", fontsize=10)
    for number, (pushes, image) in enumerate(strip):
        panel = figure.add_subplot(rows, columns, number + 1)
        panel.imshow(image)
        panel.set_axis_off()
        panel.set_title("at the start" if not pushes else f"after {pushes} pushes", fontsize=9)
    save(figure, out, "film")


def draw_costs(starts: Sequence[Mapping[str, Any]], best: float, thesis: float, out: Path) -> None:
    """Draw times and costs of searches from all starts into `figure.png`."""
    figure, (left, right) = canvas(2, width=10.0, height=4.2)
    labels = ("without\ndescent", "with", "ours")
    values = [[each["nearly"][k] for each in starts] for k in range(3)]
    left.boxplot([[each for each in column if np.isfinite(each)] for column in values], tick_labels=labels)
    for k, column in enumerate(values):
        missed = sum(not np.isfinite(each) for each in column)
        left.annotate(f"{missed} not" if missed else "", (k + 1, 1.0), xycoords=("data", "axes fraction"), ha="center")
    left.axhline(thesis, color="#c2185b", ls="--", lw=1.0)
    left.text(3.45, thesis, "the thesis, with descent", color="#c2185b", ha="right", va="bottom", fontsize=8)
    left.set_yscale("log")
    left.set_ylabel("time until the table is nearly laid [s]")
    costs = [[each[name] for each in starts] for name in ("first", "without", "with_descent", "cost")]
    right.boxplot(costs, tick_labels=("start", "without\ndescent", "with", "ours,\nin the end"))
    right.axhline(best, color="#5aa469", ls="--", lw=1.0)
    right.text(0.6, best, "best layout known, pushes or not", color="#5aa469", va="bottom", fontsize=8)
    right.set_ylabel("objective")
    figure.suptitle(f"Laying a table from {len(starts)} random starts", fontsize=11)
    save(figure, out)
