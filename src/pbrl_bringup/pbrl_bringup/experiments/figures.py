"""What the figures of experiments share: a canvas without a screen, and one look."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

FIGURE = "figure"
DPI = 130


def canvas(panels: int = 1, width: float = 9.0, height: float = 4.5) -> tuple[Figure, list[Axes]]:
    """Return a figure [inch] with panels side by side, drawn without a screen."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = [figure.add_subplot(1, panels, panel + 1) for panel in range(panels)]
    for each in axes:
        each.spines[["top", "right"]].set_visible(False)
    return figure, axes


def save(figure: Figure, out: Path, name: str = FIGURE) -> Path:
    """Write the figure into a folder as a PNG file of a name; the same figure gives the same bytes."""
    path = out / f"{name}.png"
    with matplotlib.rc_context({"savefig.dpi": DPI}):
        figure.savefig(path, metadata={"Software": None})
    return path


def band(axes: Axes, x: NDArray, values: NDArray, label: str, colour: str) -> None:
    """Draw medians over x with the middle half and the whole range of values (x, repetitions) shaded.

    Args:
        axes: to draw on.
        x: (m,).
        values: (m, repetitions).
        label: for the legend.
        colour: of line and shade.
    """
    low, first, middle, third, high = np.quantile(values, [0.0, 0.25, 0.5, 0.75, 1.0], axis=1)
    axes.fill_between(x, low, high, color=colour, alpha=0.12, linewidth=0.0)
    axes.fill_between(x, first, third, color=colour, alpha=0.3, linewidth=0.0)
    axes.plot(x, middle, color=colour, marker="o", markersize=3.5, label=label)
