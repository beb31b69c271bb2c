"""Turns from above, with articulation and without, and how much less is swept in each scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pbrl_bringup.experiments.cart_plan_drawing import Drawn, crop, draw_passage, draw_sweep
from pbrl_bringup.experiments.figures import save
from pbrl_planner.lattice import ArticulatedBody

ROOM = 0.35
"""Shown around what is swept [m]."""


def draw(turns: Mapping[str, Sequence[Drawn]], saved: Mapping[str, float], wanted: float, out: Path) -> Path:
    """Draw turns into a folder as `figure.png`.

    Args:
        turns: those of a scene that are drawn above each other, by the scene's name.
        saved: share of the swept area by scene, drawn as bars; also of scenes that are not drawn.
        wanted: share that is to be saved.
        out: the folder.
    """
    figure = Figure(figsize=(13.5, 8.2), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, len(turns) + 1, width_ratios=[*[1.0] * len(turns), 0.9])
    body = ArticulatedBody.pr2_with_cart()
    for column, (name, each) in enumerate(turns.items()):
        swept = np.concatenate([np.concatenate(list(body.outlines(one.poses).values()), axis=1) for one in each])
        for row, one in enumerate(each):
            axes = figure.add_subplot(grid[row, column])
            draw_passage(axes, one.passage)
            draw_sweep(axes, body, one.poses)
            crop(axes, swept.reshape(-1, 2), ROOM)
            axes.set_title(f"{name}\n{one.kind}: {one.area:.2f} m² swept", fontsize=9)
    draw_saved(figure.add_subplot(grid[:, -1]), saved, wanted)
    figure.suptitle(
        "A turn by 90 degrees: blue is the robot, green the cart, red the goal, shaded what both sweep", fontsize=11
    )
    return save(figure, out)


def draw_saved(axes: Axes, saved: Mapping[str, float], wanted: float) -> None:
    """Draw a bar for each scene."""
    names, values = list(saved)[::-1], [100.0 * value for value in saved.values()][::-1]
    bars = axes.barh(names, values, color=["#2f9e5b" if value >= 100.0 * wanted else "#b0b5bd" for value in values])
    axes.bar_label(bars, fmt="%.0f %%", padding=3, fontsize=9)
    axes.axvline(100.0 * wanted, color="#c0392b", lw=1.0, ls="--")
    axes.set_xlim(min(0.0, *values), max(60.0, *[1.15 * value for value in values]))
    axes.set_xlabel("swept area saved by articulation [%]")
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_yticks(range(len(names)), [name.replace(", ", ",\n") for name in names], fontsize=8)
