"""The figure of the experiment `contact`: one case drawn like figure 46, and the errors of all cases."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray
from scipy.stats import gaussian_kde

from pbrl_bringup.experiments.contact_cases import LONG, SQUARE, WIDE, Case, footprint, rotation

Array = NDArray[np.float64]

HELD_COLOUR, PUSHED_COLOUR, WHEEL_COLOUR = "tab:orange", "tab:blue", "tab:red"
GRID = 120


def draw(
    path: Path, case: Case, pushes: int, wheels: Array, first: list[float], last: list[float], near: float
) -> None:
    """Write the figure.

    Args:
        path: PNG to write.
        case: to draw.
        pushes: how many of its two pushes were made.
        wheels: (n, 2) draws of its wheel's place in the long table's frame [m].
        first: distance of each case's wheel from the truth after the first push [m].
        last: the same in the end [m].
        near: what counts as found [m].
    """
    figure = Figure(figsize=(15.0, 5.2), layout="constrained")
    scene, table, errors = figure.subplots(1, 3, width_ratios=(1.1, 1.1, 1.0))
    draw_scene(scene, case, pushes)
    draw_wheel(table, case, wheels)
    draw_errors(errors, np.array(first), np.array(last), near)
    figure.savefig(path, dpi=120)


def draw_scene(axes: Axes, case: Case, pushes: int) -> Axes:
    """Draw both tables before and after, and the paths of their middles, in the long table's first frame."""
    steps = case.first_steps if pushes == 1 else len(case.held_path) - 1
    origin = case.pushed_path[0]
    held, pushed = (_seen_from(origin, path[: steps + 1]) for path in (case.held_path, case.pushed_path))
    for poses, outline, colour, name in (
        (held, footprint(SQUARE, SQUARE), HELD_COLOUR, "square table, held"),
        (pushed, footprint(LONG, WIDE), PUSHED_COLOUR, "long table, never touched by the robot"),
    ):
        _table(axes, poses[0], outline, edgecolor=colour, facecolor="none", linestyle="--")
        _table(axes, poses[-1], outline, edgecolor=colour, facecolor=colour, alpha=0.25)
        axes.plot(poses[:, 0], poses[:, 1], color=colour, linewidth=1.0, label=name)
    axes.plot([], [], "k--", label="start")
    axes.fill([], [], color="grey", alpha=0.4, label="end")
    axes.set(
        title=f"one case (seed {case.seed}), {pushes} push{'es' if pushes > 1 else ''}",
        xlabel="x [m]",
        ylabel="y [m]",
        aspect="equal",
    )
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15), fontsize=8, ncols=2)
    return axes


def draw_wheel(axes: Axes, case: Case, wheels: Array) -> Axes:
    """Draw the learned wheel with its 95 % region on the long table's outline, and the truth as a cross."""
    outline = footprint(LONG, WIDE)
    axes.add_patch(Polygon(outline, facecolor=PUSHED_COLOUR, alpha=0.15))
    axes.add_patch(Polygon(outline, facecolor="none", edgecolor=PUSHED_COLOUR))
    inset = axes.inset_axes((0.31, 0.36, 0.42, 0.42))
    middle = wheels.mean(axis=0)
    reach = max(0.03, 1.5 * float(np.abs(wheels - middle).max()))
    for each in (axes, inset):
        _region(each, wheels)
        each.fill([], [], color=WHEEL_COLOUR, alpha=0.3, label="95 % region")
        each.plot(*middle, "o", color=WHEEL_COLOUR, markersize=5, label="learned")
        each.plot(*case.truth.wheel, "kx", markersize=9, label="truth")
    inset.set(xlim=(middle[0] - reach, middle[0] + reach), ylim=(middle[1] - reach, middle[1] + reach), aspect="equal")
    inset.tick_params(labelsize=6)
    inset.set_title("enlarged", fontsize=7)
    axes.indicate_inset_zoom(inset, edgecolor="grey")
    error = 100.0 * float(np.hypot(*(middle - case.truth.wheel)))
    axes.set(
        title=f"learned wheel: {error:.1f} cm from the truth",
        xlabel="x in the table's frame [m]",
        ylabel="y in the table's frame [m]",
        aspect="equal",
        xlim=(-0.6 * LONG, 0.6 * LONG),
        ylim=(-0.8 * WIDE, 0.8 * WIDE),
    )
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15), fontsize=8, ncols=3)
    return axes


def draw_errors(axes: Axes, first: Array, last: Array, near: float) -> Axes:
    """Draw which share of the cases is within which distance, after one push and in the end."""
    share = 100.0 * np.arange(1, len(last) + 1) / len(last)
    for values, colour, line, name in (
        (first, "grey", "--", "after the first push"),
        (last, WHEEL_COLOUR, "-", "in the end (second push where needed)"),
    ):
        axes.step(100.0 * np.sort(values), share, where="post", label=name, color=colour, linestyle=line)
    axes.axvline(100.0 * near, color="k", linewidth=0.8)
    axes.axhline(90.0, color="k", linewidth=0.8, linestyle=":")
    axes.text(100.0 * near, 3.0, "goal: 90 % within 5 cm ", fontsize=8, horizontalalignment="right")
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set(
        title=f"{len(last)} cases; thesis: one, accuracy not given",
        xlabel="distance of the wheel from the truth [cm]",
        ylabel="cases within [%]",
        xlim=(0.1, max(10.0, 130.0 * float(max(first.max(), last.max())))),
        ylim=(0.0, 102.0),
    )
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15), fontsize=8)
    return axes


def _region(axes: Axes, wheels: Array) -> None:
    """Draw the 95 % highest-density region of draws (n, 2)."""
    density = gaussian_kde(wheels.T)
    low, high = wheels.min(axis=0), wheels.max(axis=0)
    margin = 0.3 * (high - low) + 1e-4
    x, y = (np.linspace(low[k] - margin[k], high[k] + margin[k], GRID) for k in (0, 1))
    values = density(np.stack(np.meshgrid(x, y), 0).reshape(2, -1)).reshape(GRID, GRID)
    level = float(np.quantile(density(wheels.T), 0.05))
    axes.contourf(x, y, values, levels=[level, values.max() + 1e-9], colors=[WHEEL_COLOUR], alpha=0.3)


def _seen_from(origin: Array, path: Array) -> Array:
    """Return poses (n, 3) in the frame of a pose (3,)."""
    out = path - origin
    out[:, :2] = out[:, :2] @ rotation(origin[2])
    return out


def _table(axes: Axes, pose: Array, outline: Array, **style: Any) -> None:
    axes.add_patch(Polygon(outline @ rotation(pose[2]).T + pose[:2], **style))
