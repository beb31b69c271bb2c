"""Figures 36 to 38 again: each way from above with the wrenches at the grips, then forces and workspace over time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from pbrl_bringup.experiments.body_jacobian_trials import Held
from pbrl_bringup.experiments.figures import save
from pbrl_control.planar import compose, placed, rotation

Array = NDArray[np.float64]
Drawn = Mapping[tuple[str, str], Held]

FX, FY, TAU = "#d62728", "#2ca02c", "#1f4fd0"
"""Of the wrench's parts, as in the thesis."""
FORESEEN, BASE, OUTLINE = "#e08a00", "#555555", "#9a9a9a"
COLOURS = {
    "unknown": "#b0309a",
    "unsteered": "#e08a00",
    "waypoint": "#7a5a3a",
    "program": "#5aa0c8",
    "ours": "#0b3c8c",
}
NAMES = {
    "unknown": "constraint not known",
    "unsteered": "known, no steering (42–44)",
    "waypoint": "known, thesis's steering (45, 46)",
    "program": "known, program without steering",
    "ours": "known, program looking ahead (ours)",
}
TITLES = {
    "cart": (
        "Cart whose right wheels (black) do not swivel, asked to go straight ahead (figure 36)",
        "thesis: without considering constraints, large gripper forces from trajectory deviation",
    ),
    "table": (
        "Table on swivelling casters, carried aslant of a base that cannot go sideways (figures 37, 38)",
        "thesis: without steering the arms drift out of the reachable workspace, with it they stay in its middle",
    ),
}
VIEWS = ("unknown", "unsteered", "waypoint", "ours")
SIZE = (15.0, 13.0)
MOMENTS = 5
FORCE_SCALE, TORQUE_SCALE = 100.0, 10.0
"""So many N are drawn 0.3 m long, so many N m as a quarter of a circle."""
LENGTH, RADIUS = 0.3, 0.1
ARROW: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "units": "inches", "width": 0.022}
MARGIN = 0.15
"""Free floor around what is drawn [m]."""


def draw(held: Drawn, out: Path) -> Path:
    """Draw what became of both objects into `out`.

    Args:
        held: by object and way; what is not there is left out.
        out: folder.
    """
    subjects = [subject for subject in TITLES if any(name == subject for name, _ in held)]
    figure = Figure(figsize=(SIZE[0], SIZE[1] / 2 * len(subjects)), layout="constrained")
    FigureCanvasAgg(figure)
    parts = figure.subfigures(len(subjects), 1, hspace=0.04, squeeze=False)[:, 0]
    for subject, part in zip(subjects, parts, strict=True):
        own = {way: each for (name, way), each in held.items() if name == subject and len(each.time)}
        title, claim = TITLES[subject]
        part.suptitle(f"{title}\n{claim}\n", fontsize=11, x=0.01, ha="left")
        views = [way for way in VIEWS if way in own]
        grid = part.add_gridspec(2, 2 * max(len(views), 1), height_ratios=(1.9, 1.0))
        panels = [part.add_subplot(grid[0, 2 * k : 2 * k + 2]) for k in range(len(views))]
        for axes, way in zip(panels, views, strict=True):
            view(axes, own[way], "abcd"[VIEWS.index(way)], _name(subject, way))
        _frame(panels, [own[way] for way in views])
        strips = part.add_subplot(grid[1, : len(views)]), part.add_subplot(grid[1, len(views) :])
        forces(strips[0], own, subject)
        margins(strips[1], own)
        part.legend(
            *strips[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False, fontsize=9
        )
    figure.legend(handles=_marks(), loc="outside upper center", ncols=4, frameon=False, fontsize=9)
    return save(figure, out)


def _frame(panels: list[Axes], held: list[Held]) -> None:
    """Show what all of them need, alike."""
    spots = np.vstack([np.vstack([_corners(each), each.base[:, :2], each.path[:, :2]]) for each in held])
    low, high = spots.min(axis=0) - MARGIN, spots.max(axis=0) + MARGIN
    for axes in panels:
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")


def _corners(held: Held) -> Array:
    return np.vstack([placed(held.outline, pose) for pose in (*held.object[[0, -1]], held.path[-1])])


def _name(subject: str, way: str) -> str:
    """Say what is known of a subject, and how it is moved; of the table there is no constraint to be known."""
    return "nothing known" if (subject, way) == ("table", "unknown") else NAMES[way]


def view(axes: Axes, held: Held, letter: str, name: str) -> None:
    """Draw one way from above: outlines darker as time goes on, wrenches at the grips, paths of object and base."""
    outline, ends = held.outline, len(held.time) - 1
    moments = np.linspace(0, ends, MOMENTS).round().astype(int)
    axes.add_patch(Polygon(placed(outline, held.path[-1]), fill=False, ec=FORESEEN, lw=1.6, ls=(0, (4, 3)), zorder=3))
    axes.plot(*held.path[:, :2].T, color=FORESEEN, ls=(0, (4, 3)), lw=1.6, zorder=3)
    for shade, k in zip(np.linspace(0.25, 1.0, MOMENTS), moments, strict=True):
        axes.add_patch(Polygon(placed(outline, held.object[k]), fill=False, ec=OUTLINE, lw=1.4, alpha=float(shade)))
        _robot(axes, held.base[k], float(shade))
    _grips(axes, held, moments)
    for where in held.holding:
        wheel = placed(where + np.array([[-0.06, 0.0], [0.06, 0.0]]), held.object[-1])
        axes.plot(*wheel.T, color="black", lw=4, solid_capstyle="butt")
    axes.plot(*held.object[:, :2].T, color="black", lw=1.2)
    axes.plot(*held.base[:, :2].T, color=BASE, lw=1.2, ls=":")
    away, turned = held.off(held.path[-1])
    ended = "ends" if held.phase == "done" else f"gives up at {100 * held.progress:.0f} %,"
    where = f"{ended} {100 * away:.0f} cm, {math.degrees(turned):.0f}° from where foreseen"
    axes.set_title(
        f"{letter}  {name}\n{where}\n"
        f"at most {held.force.max():.0f} N; workspace margin {100 * held.margin.min():.0f} cm",
        fontsize=9.5,
        loc="left",
    )
    axes.set_xlabel("x [m]", fontsize=8)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)


def _robot(axes: Axes, pose: Array, shade: float) -> None:
    """Draw the base as an arrowhead."""
    axes.add_patch(
        Polygon(placed(np.array([[0.18, 0.0], [-0.12, 0.12], [-0.12, -0.12]]), pose), fc=BASE, lw=0, alpha=0.6 * shade)
    )


def _grips(axes: Axes, held: Held, moments: Array) -> None:
    """Draw what each grip exerts on the object at moments (m,): fx red, fy green along its axes, torque blue."""
    places, ways = [], []
    for k in moments:
        ahead, left = rotation(float(held.object[k, 2])).T
        for gripper, (fx, fy, tau) in zip(held.plates[k], held.wrench[k], strict=True):
            at = compose(held.base[k], gripper)[:2]
            places.append(at)
            ways.append(LENGTH / FORCE_SCALE * np.array([fx * ahead, fy * left]))
            span = np.linspace(0.0, 0.5 * math.pi * tau / TORQUE_SCALE, 30)
            ring = at + RADIUS * (np.cos(span)[:, None] * ahead + np.sin(span)[:, None] * left)
            axes.plot(*ring.T, color=TAU, lw=1.8, zorder=5)
    spots, arrows = np.array(places), np.array(ways)
    axes.plot(*spots.T, "o", color="black", ms=2.5, zorder=6)
    for part, colour in enumerate((FX, FY)):
        axes.quiver(*spots.T, *arrows[:, part].T, color=colour, zorder=5, **ARROW)


def forces(axes: Axes, held: Mapping[str, Held], subject: str) -> None:
    """Draw the larger force of both grips over time, what is expected, and where it would have been stopped."""
    for way, each in held.items():
        axes.plot(each.time, each.force.max(axis=1), color=COLOURS[way], lw=1.4, label=_name(subject, way))
        if math.isfinite(each.stopped):
            axes.plot(each.stopped, each.limit, "X", color=COLOURS[way], ms=9, mec="white", zorder=5)
    if "ours" in held:
        ours = held["ours"]
        axes.plot(ours.time, ours.expected.max(axis=1), color="black", lw=1.0, ls=":", label="expected (ours)")
        axes.axhline(ours.limit, color="black", lw=1.0, ls="--", label="the robot stops there (x); here it went on")
    axes.set_ylim(0.0)
    _time_axes(axes, "larger grip force [N]")


def margins(axes: Axes, held: Mapping[str, Held]) -> None:
    """Draw how far grippers are inside of their workspace over time."""
    for way, each in held.items():
        axes.plot(each.time, 100.0 * each.margin, color=COLOURS[way], lw=1.4)
        if each.phase != "done":
            axes.plot(each.time[-1], 100.0 * each.margin[-1], "s", color=COLOURS[way], ms=5)
    low = min(axes.get_ylim()[0], -5.0)
    axes.axhspan(low, 0.0, color="#c0392b", alpha=0.12, lw=0)
    axes.text(0.99, 0.02, "outside of the workspace", transform=axes.transAxes, fontsize=8, ha="right", va="bottom")
    axes.set_ylim(low)
    _time_axes(axes, "workspace margin [cm]")


def _time_axes(axes: Axes, what: str) -> None:
    axes.set_xlabel("time since it set out [s]", fontsize=8)
    axes.set_ylabel(what, fontsize=8)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)


def _marks() -> list[Line2D]:
    return [
        Line2D([], [], color=OUTLINE, label="object, darker as time goes on"),
        Line2D([], [], color="black", lw=1.2, label="path of its middle"),
        Line2D([], [], color=FORESEEN, ls=(0, (4, 3)), label="foreseen by the controller"),
        Line2D([], [], color=BASE, marker=">", ls=":", label="robot's base"),
        Line2D([], [], color=FX, label=f"fx of a grip, 0.3 m are {FORCE_SCALE:.0f} N"),
        Line2D([], [], color=FY, label="fy, in the object's axes"),
        Line2D([], [], color=TAU, label=f"torque, a quarter circle is {TORQUE_SCALE:.0f} N m"),
    ]
