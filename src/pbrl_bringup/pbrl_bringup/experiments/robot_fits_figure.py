"""Figure 30 again: six panels of recorded (green) and predicted (blue) motion, the learned wheel on the body."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from pbrl_bringup.experiments.figures import save
from pbrl_bringup.experiments.robot_fits_trials import EndError, Overlay, Trial
from pbrl_control.planar import placed

Array = NDArray[np.float64]
Drawn = Mapping[tuple[str, str], tuple[Trial, Overlay]]

RECORDED, PREDICTED, THESIS, TRUTH = "#2a9d3a", "#1f5fd0", "#e08a00", "#c0392b"
SIZE = (13.5, 9.6)
"""Of the figure [inch]."""
MOMENTS = 6
"""Outlines drawn of each motion, from its start to its end."""
MARGIN = 0.12
"""Free floor [m] around what is recorded; a prediction that leaves it is cut off."""
WHEEL = 0.24
"""Length [m] of the line that stands for a wheel, along which it rolls."""
PANELS = (
    ("a", "locked table", "windowed", "expected"),
    ("b", "locked table", "one_step", "learned"),
    ("c", "locked table", "windowed", "learned"),
    ("d", "unlocked table", "windowed", "learned"),
    ("e", "cart", "windowed", "expected"),
    ("f", "cart", "windowed", "learned"),
)
"""Letter as printed, case, loss, and which of the two predictions of a trial is drawn."""


def draw(drawn: Drawn, out: Path) -> Path:
    """Draw the six panels into `out`.

    Args:
        drawn: trial and overlay by case and loss.
        out: folder.
    """
    figure = Figure(figsize=SIZE, layout="constrained")
    FigureCanvasAgg(figure)
    for number, (letter, case, loss, which) in enumerate(PANELS, start=1):
        trial, overlay = drawn[case, loss]
        axis = figure.add_subplot(2, len(PANELS) // 2, number)
        panel(axis, overlay, learned=which == "learned")
        how = ending(getattr(trial, which)[0])
        if which == "learned" and loss == "windowed":
            thesis, path = drawn[case, "integrated"]
            _outline(axis, placed(path.outline, path.learned[-1]), THESIS, 1.0, "--")
            how += f" (integrated loss: {ending(thesis.learned[0]).removeprefix('ends ')})\n{elsewhere(trial, thesis)}"
        axis.set_title(f"{letter})  {title(case, loss, which)}\n{how}", fontsize=10)
    marks = [
        Line2D([], [], color=RECORDED, label="recorded in Bullet"),
        Line2D([], [], color=PREDICTED, label="predicted open loop from the recorded forces"),
        Line2D([], [], color=THESIS, linestyle="--", label="where the integrated loss (39) ends"),
        Line2D([], [], color=PREDICTED, linewidth=4, label="learned wheel, along which it rolls (dot: its place)"),
        Line2D([], [], color=TRUTH, marker="x", linestyle="", label="really locked or fixed (not told)"),
    ]
    figure.legend(handles=marks, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return save(figure, out)


def title(case: str, loss: str, which: str) -> str:
    """Say what a panel shows."""
    if which == "expected":
        return f"{case}: expected, nothing learned"
    names = {"one_step": "one-step loss (26)", "integrated": "integrated loss (39)", "windowed": "windowed loss"}
    return f"{case}: learned with the {names[loss]}"


def ending(error: EndError) -> str:
    """Say how far off a prediction ends."""
    return f"ends {100 * error.position:.0f} cm and {math.degrees(error.yaw):.0f}° off"


def elsewhere(ours: Trial, thesis: Trial) -> str:
    """Say how far off the corners end in the held-out push."""
    here, there = (100 * trial.learned[1].corners for trial in (ours, thesis))
    return f"held-out push: corners {here:.0f} cm off (integrated loss: {there:.0f} cm)"


def panel(axes: Axes, overlay: Overlay, *, learned: bool) -> None:
    """Draw one motion and its prediction, darker as time goes on."""
    path = overlay.learned if learned else overlay.expected
    moments = np.linspace(0, len(path) - 1, MOMENTS).round().astype(int)
    corners = [placed(overlay.outline, pose) for pose in overlay.recorded[moments]]
    for shade, moment in zip(np.linspace(0.2, 0.7, MOMENTS), moments, strict=True):
        last = moment == moments[-1]
        for poses, colour in ((overlay.recorded, RECORDED), (path, PREDICTED)):
            _outline(
                axes, placed(overlay.outline, poses[moment]), colour, 1.0 if last else shade, width=2.4 if last else 1.0
            )
    axes.plot(*overlay.recorded[:, :2].T, color=RECORDED, linewidth=0.8)
    axes.plot(*path[:, :2].T, color=PREDICTED, linewidth=0.8)
    if len(overlay.holding):
        axes.plot(*placed(overlay.holding, overlay.recorded[-1]).T, "x", color=TRUTH, markersize=8, zorder=5)
    if learned:
        _wheel(axes, overlay.wheel, path[-1])
    low, high = np.concatenate(corners).min(axis=0) - MARGIN, np.concatenate(corners).max(axis=0) + MARGIN
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="x [m]", ylabel="y [m]")


def _outline(axes: Axes, corners: Array, colour: str, shade: float, style: str = "-", width: float = 1.4) -> None:
    axes.add_patch(Polygon(corners, fill=False, edgecolor=colour, alpha=float(shade), linestyle=style, linewidth=width))


def _wheel(axes: Axes, wheel: tuple[float, float, float], pose: Array) -> None:
    """Draw the wheel on the body where the prediction ends."""
    x, y, theta = wheel
    place, half = np.array([x, y]), WHEEL / 2 * np.array([math.cos(theta), math.sin(theta)])
    axes.plot(
        *placed(np.stack([place - half, place + half]), pose).T,
        color=PREDICTED,
        linewidth=4,
        solid_capstyle="round",
        zorder=4,
    )
    axes.plot(*placed(place[None], pose).T, "o", color="white", markeredgecolor=PREDICTED, zorder=6)
