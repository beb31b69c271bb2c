"""A doorway that only the articulated cart gets through, and the least widths of doorways and corners."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pbrl_bringup.experiments.cart_passages import BENT, STRAIGHT, Least, Passage
from pbrl_bringup.experiments.cart_plan_drawing import crop, draw_passage, draw_sweep
from pbrl_bringup.experiments.figures import save
from pbrl_planner.lattice import ArticulatedBody
from pbrl_planner.lattice.body import CART_WIDTH, PR2_HALF

STYLES = {BENT: ("#2f9e5b", "o"), STRAIGHT: ("#7b8087", "s")}


def draw(
    passed: Least, passage: Callable[[int], Passage], widths: Mapping[str, Mapping[str, Least]], out: Path
) -> Path:
    """Draw both into a folder as `figure.png`.

    Args:
        passed: the narrowest corridor before a doorway that the articulated cart gets through.
        passage: of a corridor's width [cells].
        widths: least ones by scene.
        out: the folder.
    """
    figure = Figure(figsize=(13.0, 5.6), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.0])
    if passed.cells is not None and passed.plan is not None:
        body, poses = ArticulatedBody.pr2_with_cart(), passed.plan.poses
        draw_passage(left, passage(passed.cells))
        draw_sweep(left, body, poses)
        corners = np.concatenate(list(body.outlines(poses).values()), axis=1)
        crop(left, corners.reshape(-1, 2), 0.35)
        left.set_title(
            f"A doorway 10 cm wider than the cart, off a corridor of {passed.width:.2f} m:\n"
            "passed with articulation; with the cart held straight there is proof that it cannot be",
            fontsize=9,
        )
        left.set_xlabel("x [m]")
        left.set_ylabel("y [m]")
    draw_widths(right, widths)
    return save(figure, out)


def draw_widths(axes: Axes, widths: Mapping[str, Mapping[str, Least]]) -> None:
    """Draw the least widths of each scene on a line."""
    names = list(widths)[::-1]
    for row, name in enumerate(names):
        pair = widths[name]
        axes.plot([100.0 * each.width for each in pair.values()], [row] * len(pair), color="#c9ccd1", lw=2.5, zorder=1)
        for kind, (colour, marker) in STYLES.items():
            axes.plot(
                100.0 * pair[kind].width, row, marker, color=colour, ms=8, zorder=3, label=kind if row == 0 else None
            )
            aside = -9 if kind == BENT else 9
            axes.annotate(
                f"{100.0 * pair[kind].width:.1f}",
                (100.0 * pair[kind].width, row),
                (aside, 0),
                textcoords="offset points",
                ha="right" if aside < 0 else "left",
                va="center",
                fontsize=8,
                color=colour,
            )
    for at, words in ((CART_WIDTH, "cart"), (2.0 * PR2_HALF, "robot")):
        axes.axvline(100.0 * at, color="#c0392b", lw=0.8, ls=":")
        axes.text(
            100.0 * at,
            0.03,
            words,
            color="#c0392b",
            fontsize=8,
            rotation=90,
            ha="right",
            va="bottom",
            transform=axes.get_xaxis_transform(),
        )
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.margins(x=0.12, y=0.05)
    axes.set_xlabel("least width [cm]")
    axes.set_title("Least widths: what is left of the mark is proved too narrow", fontsize=9)
    axes.grid(axis="x", color="#eeeeee", zorder=0)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=8, loc="lower right")
