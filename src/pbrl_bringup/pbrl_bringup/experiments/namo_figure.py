"""A film strip of a run among movable obstacles: the room from above at each step of the executive that matters."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from itertools import compress, pairwise
from pathlib import Path
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from pbrl_bringup.experiments.figures import FIGURE, canvas, save
from pbrl_bringup.namo_run import Moment, NamoOutcome
from pbrl_control.navigation.footprint import KRANG_STOWED
from pbrl_control.planar import Array, placed

COLOURS = ("#d98b3a", "#3a7bd9", "#5aa469", "#a05aa4")
SHOWN = {
    "Planning": "plans",
    "ClearObstacle": "moves the {}",
    "UpdateModel": "is surprised, learns the {}",
    "AskMismatch": "asks what is left out",
    "Release": "lets go",
    "DriveToGoal": "drives to the goal",
    "Done": "at the goal",
    "Failed": "gives up",
}
"""States that have a picture, and what is written over it."""
MOST, COLUMNS = 12, 3
INSTANT = 0.05
"""[s] within which two pictures show the same: the first is kept, which says why."""
SAID = ("AskMismatch", "Failed")
"""States with a picture for what is written below it."""
CONCEALED, FAINT = "#c2185b", "#c2185b18"
WIDE, LINES = 150, 2
"""Letters of a line above all pictures, and lines that what became of the run may take there."""
MOVED = 0.02
"""[m] and [rad] together from which on a thing is drawn where it was before."""


def draw(
    run: NamoOutcome,
    out: Path,
    concealed: Sequence[Array] = (),
    name: str = FIGURE,
    braked: Mapping[str, Sequence[Sequence[float]]] = MappingProxyType({}),
    cords: Mapping[str, Array] = MappingProxyType({}),
) -> Path:
    """Draw a run into a folder as `figure.png`.

    Args:
        run: to be drawn.
        out: the folder.
        concealed: (k, 2) corners of what only the simulator knows [m].
        name: of the file, without its ending.
        braked: (x, y) of the casters of each thing that are locked, in its own frame [m].
        cords: (2, 2) where each thing has a cord tied to it, in its frame, and where that is hooked, in `world` [m].
    """
    shown = [each for each in run.moments if each.state in SHOWN]
    later = [now.state in SAID or now.time > before.time + INSTANT for before, now in pairwise(shown)]
    moments = list(compress(shown, [True, *later]))
    if len(moments) > MOST:  # the beginning and the end say most
        moments = [*moments[: MOST // 2], *moments[-(MOST - MOST // 2) :]]
    rows = -(-len(moments) // COLUMNS)
    figure, _ = canvas(0, width=11.0, height=2.3 * rows)
    for k, moment in enumerate(moments):
        axes = figure.add_subplot(rows, COLUMNS, k + 1)
        _picture(axes, moment, k + 1, run)
        if k:
            _where_it_was(axes, moments[k - 1], moment, run)
        for thing, casters in braked.items():
            x, y = placed(np.array(casters), np.array(moment.poses[thing])).T
            axes.plot(x, y, ls="", marker="o", color=CONCEALED, ms=3.5)
        for shape in concealed:
            axes.add_patch(Polygon(shape, closed=True, fc=FAINT, ec=CONCEALED, lw=1.2, ls="--"))
        for thing, (tied, hook) in cords.items():
            x, y = np.array([hook, placed(tied, np.array(moment.poses[thing]))]).T
            axes.plot(x, y, color=CONCEALED, lw=1.2, marker="o", ms=3.0, markevery=[0])
    _note(figure, run, bool(concealed or braked or cords))
    return save(figure, out, name)


def _picture(axes: Axes, moment: Moment, number: int, run: NamoOutcome) -> None:
    corners = np.array(run.room)
    axes.add_patch(Polygon(corners, closed=True, fc="#fafafa", ec="#444", lw=1.5))
    for k, (name, pose) in enumerate(moment.poses.items()):
        outline = placed(np.array(run.outlines[name]), np.array(pose))
        axes.add_patch(Polygon(outline, closed=True, fc=COLOURS[k % len(COLOURS)], ec="#333", alpha=0.75))
    robot = KRANG_STOWED.at(np.array(moment.base))
    axes.add_patch(Polygon(robot, closed=True, fc="#555", ec="#111"))
    x, y, heading = moment.base
    axes.plot([x, x + 0.45 * np.cos(heading)], [y, y + 0.45 * np.sin(heading)], color="white", lw=1.5)
    axes.plot(*run.goal, marker="x", color="#c0392b", ms=8, mew=2)
    low, high = corners.min(axis=0) - 0.1, corners.max(axis=0) + 0.1
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_title(
        f"{number}. {moment.time:.0f} s: {SHOWN[moment.state].format(moment.object.replace('_', ' '))}", fontsize=9
    )
    axes.set_xlabel(_short(moment.sentence), fontsize=7)


def _where_it_was(axes: Axes, before: Moment, now: Moment, run: NamoOutcome) -> None:
    """Draw where a thing stood in the picture before, if it has been moved since."""
    for name, pose in before.poses.items():
        if math.dist(pose, now.poses[name]) > MOVED:
            was = placed(np.array(run.outlines[name]), np.array(pose))
            axes.add_patch(Polygon(was, closed=True, fc="none", ec="#888", lw=0.8, ls=":"))


def _short(sentence: str, most: int = 62) -> str:
    return sentence if len(sentence) <= most else f"{sentence[: most - 3]}..."


def _note(figure: Figure, run: NamoOutcome, hidden: bool) -> None:
    planned, updates = run.rows["overall planning time [s]"], run.rows["calls to UpdateModel"]
    became = f"{run.seconds:.0f} s simulated, {planned:.2f} s of planning, {updates:.0f} model updates: {run.sentence}"
    figure.suptitle(
        textwrap.fill(became, WIDE, max_lines=LINES, placeholder="...")
        + ("\n(red: locked casters and what else nobody told the robot; dotted: where it was)" if hidden else ""),
        fontsize=10,
    )
