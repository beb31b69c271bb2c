"""Turns about chosen points from above, the centres that were found, and how far turns can go."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from pbrl_bringup.experiments.body_jacobian_trials import Held
from pbrl_bringup.experiments.figures import save
from pbrl_control.planar import compose, placed

Array = NDArray[np.float64]
Reaches = Mapping[tuple[str, str], tuple[float, float]]

CHOSEN, FOUND, BASE, TABLE, ALONE = "#c0392b", "#1f5fd0", "#555555", "#2a9d3a", "#9db8dd"
TITLE = "A table, held by both arms, is turned about points of choice by a base that cannot go sideways"
SHADES = ("#1f5fd0", "#e08a00", "#2a9d3a", "#b0309a", "#7a5a3a", "#111111")
SIZE, COLUMNS = (13.5, 13.8), 3
HEAD = np.array([[0.18, 0.0], [-0.12, 0.12], [-0.12, -0.12]])
"""Arrowhead that stands for the base [m]."""
MOMENTS = 4
MARGIN = 0.12
"""Free floor around what is drawn [m]."""


class Pivoted(Protocol):
    """A point that something turns about."""

    @property
    def name(self) -> str:
        """As people say it."""
        ...

    @property
    def point(self) -> tuple[float, float]:
        """In the object's frame [m]."""
        ...


class Turn(Protocol):
    """What is drawn of a turn; for the fields see `articulation.Turned`."""

    @property
    def pivot(self) -> Pivoted:
        """The chosen point."""
        ...

    @property
    def way(self) -> str:
        """Left or right."""
        ...

    @property
    def held(self) -> Held:
        """What was kept."""
        ...

    @property
    def angle(self) -> float:
        """That was reached [rad]."""
        ...

    @property
    def wander(self) -> float:
        """Farthest that the chosen point got from its place [m]."""
        ...

    @property
    def driven(self) -> float:
        """Way of the base [m]."""
        ...

    @property
    def spun(self) -> float:
        """What the base turned in all [rad]."""
        ...

    @property
    def centres(self) -> Array:
        """Found, one for each angle [m]."""
        ...

    @property
    def off(self) -> Array:
        """Distance of each from the chosen point [m]."""
        ...

    @property
    def last_off(self) -> float:
        """That of the last one [m]."""
        ...


def draw(turned: Sequence[Turn], reaches: Reaches, angles: Sequence[float], out: Path) -> Path:
    """Draw turns and reaches into `out`.

    Args:
        turned: turns, both ways of a point one after the other.
        reaches: angle [rad] with arms alone and with the base, by point and way.
        angles: at which centres were found [deg].
        out: folder.
    """
    shown = {each.pivot.name: each for each in reversed(turned)}
    views = [shown[name] for name in dict.fromkeys(each.pivot.name for each in turned)]
    rows = math.ceil(len(views) / COLUMNS)
    figure = Figure(figsize=(SIZE[0], SIZE[1] * (rows + 0.8) / 2.8), layout="constrained")
    FigureCanvasAgg(figure)
    above, below = figure.subfigures(2, 1, height_ratios=(rows, 0.8), squeeze=False)[:, 0]
    above.suptitle(TITLE, fontsize=11, x=0.01, ha="left")
    low, high = _extent(views)
    for k, each in enumerate(views):
        axes = above.add_subplot(rows, COLUMNS, k + 1)
        view(axes, each, "abcdefghij"[k])
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    centres(below.add_subplot(1, 2, 1), turned, angles)
    extents(below.add_subplot(1, 2, 2), turned, reaches)
    figure.legend(handles=_marks(), loc="outside lower center", ncols=6, frameon=False, fontsize=9)
    return save(figure, out)


def _extent(views: Sequence[Turn]) -> tuple[Array, Array]:
    """Return the corners (2,) of what all views show alike [m]."""
    spots = [np.zeros((1, 2))]
    for each in views:
        held, k = each.held, len(each.held.time) // 2
        for pose in held.object[[0, k, -1]] if k else ():
            spots.append(placed(held.outline, pose))
        for pose in held.base[[0, k, -1]] if k else ():
            spots.append(placed(HEAD, pose))
    every = np.vstack(spots)
    return every.min(axis=0) - MARGIN, every.max(axis=0) + MARGIN


def view(axes: Axes, turned: Turn, letter: str) -> None:
    """Draw one turn from above: table and base darker as time goes on, the chosen and the found centre."""
    held = turned.held
    if len(held.time):
        angle = np.abs(np.unwrap(held.object[:, 2]) - held.object[0, 2])
        wanted = np.linspace(0.0, angle.max(), MOMENTS)
        moments = [int(np.argmax(angle >= each - 1e-12)) for each in wanted]
        for shade, k in zip(np.linspace(0.25, 1.0, MOMENTS), moments, strict=True):
            corners = placed(held.outline, held.object[k])
            axes.add_patch(Polygon(corners, fill=False, ec=TABLE, lw=1.6, alpha=float(shade)))
            _robot(axes, held, k, float(shade))
        axes.plot(*held.base[:, :2].T, color=BASE, lw=1.0, ls=":")
        for where in held.holding:
            axes.plot(*placed(where[None], held.object[-1]).T, "s", color="black", ms=6, zorder=4)
        chosen = compose(held.object[0], np.array([*turned.pivot.point, 0.0]))[:2]
        known = turned.centres[np.isfinite(turned.centres).all(axis=1)]
        if len(known):
            axes.plot(*placed(known[-1:], held.object[0]).T, "o", mfc="none", mec=FOUND, mew=1.8, ms=11, zorder=6)
        axes.plot(*chosen, "x", color=CHOSEN, ms=9, mew=2.2, zorder=7)
    margin, most = 100 * held.margin.min(initial=math.inf), held.force.max(initial=0.0)
    lines = (
        f"{letter}  about {turned.pivot.name}, to the {turned.way}",
        f"turned {math.degrees(turned.angle):.0f}°; at most {most:.0f} N; workspace margin {margin:.0f} cm",
        f"centre {100 * turned.last_off:.1f} cm off; the point strayed {100 * turned.wander:.1f} cm",
        f"base went {turned.driven:.2f} m and turned {math.degrees(turned.spun):.0f}°",
    )
    axes.set_title("\n".join(lines), fontsize=9, loc="left")
    axes.set_xlabel("x [m]", fontsize=8)
    axes.set_ylabel("y [m]", fontsize=8)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)


def _robot(axes: Axes, held: Held, k: int, shade: float) -> None:
    """Draw the base as an arrowhead, and a line to each gripper's plates."""
    pose = held.base[k]
    axes.add_patch(Polygon(placed(HEAD, pose), fc=BASE, lw=0, alpha=0.7 * shade))
    for gripper in held.plates[k]:
        at = compose(pose, gripper)[:2]
        axes.plot(*np.array([pose[:2], at]).T, color=BASE, lw=1.0, alpha=0.7 * shade)
        axes.plot(*at, "o", color="black", ms=3, alpha=shade)


def centres(axes: Axes, turned: Sequence[Turn], angles: Sequence[float]) -> None:
    """Draw how far the found centre is from the chosen one against the angle turned by then."""
    names = list(dict.fromkeys(each.pivot.name for each in turned))
    for each in turned:
        left = each.way == "left"
        axes.plot(
            angles,
            100.0 * each.off,
            color=SHADES[names.index(each.pivot.name) % len(SHADES)],
            marker="o" if left else "s",
            mfc=None if left else "white",
            ls="-" if left else "--",
            ms=4.5,
            lw=1.3,
            label=f"about {each.pivot.name}" if each is _first(turned, each) else None,
        )
    axes.set_xticks(list(angles), [f"{each:.0f}°" for each in angles])
    axes.set_ylim(0.0)
    axes.set_xlabel("turned by then (full: to the left, hollow: to the right)", fontsize=9)
    axes.set_ylabel("found centre from the chosen one [cm]", fontsize=9)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=8, frameon=False)


def _first(turned: Sequence[Turn], one: Turn) -> Turn:
    return next(each for each in turned if each.pivot.name == one.pivot.name)


def extents(axes: Axes, turned: Sequence[Turn], reaches: Reaches) -> None:
    """Draw how far turns go: arms alone and with the base, by kinematics; and what was done in Bullet."""
    names = list(dict.fromkeys(name for name, _ in reaches))
    for (name, way), (alone, base) in reaches.items():
        sign, row = (1.0 if way == "left" else -1.0), names.index(name)
        axes.barh(row, sign * math.degrees(base), height=0.7, color=ALONE)
        axes.barh(row, sign * math.degrees(alone), height=0.4, color=FOUND)
    for each in turned:
        sign = 1.0 if each.way == "left" else -1.0
        axes.plot(sign * math.degrees(each.angle), names.index(each.pivot.name), "k|", ms=16, mew=2.5)
    axes.set_yticks(range(len(names)), [f"about {name}" for name in names], fontsize=9)
    axes.invert_yaxis()
    axes.axvline(0.0, color="black", lw=0.6)
    axes.set_xlabel(
        "angle [deg], left turns to the right: arms alone (dark), with the base (light), done (|)", fontsize=9
    )
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)


def _marks() -> list[Line2D]:
    return [
        Line2D([], [], color=TABLE, label="table, darker as time goes on"),
        Line2D([], [], color=BASE, marker=">", ls=":", label="robot's base, and its path"),
        Line2D([], [], color="black", marker="o", ms=4, ls="", label="grips"),
        Line2D([], [], color=CHOSEN, marker="x", mew=2, ls="", label="chosen centre"),
        Line2D([], [], mfc="none", mec=FOUND, mew=1.8, marker="o", ms=10, ls="", label="centre found from true poses"),
        Line2D([], [], color="black", marker="s", ls="", label="locked caster"),
    ]
