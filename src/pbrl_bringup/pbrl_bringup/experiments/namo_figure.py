"""A film strip of a run among movable obstacles: the room from above at each step of the executive that matters."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from pbrl_bringup.experiments.figures import FIGURE, canvas, save
from pbrl_bringup.namo_run import Moment, NamoOutcome
from pbrl_control.navigation.footprint import KRANG_STOWED
from pbrl_control.planar import Array, rotation

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


def draw(run: NamoOutcome, out: Path, concealed: Sequence[Array] = (), name: str = FIGURE) -> Path:
    """Draw a run into a folder as `figure.png`.

    Args:
        run: to be drawn.
        out: the folder.
        concealed: (k, 2) corners of what only the simulator knows [m].
        name: of the file, without its ending.
    """
    moments = [each for each in run.moments if each.state in SHOWN]
    if len(moments) > MOST:  # the beginning and the end say most
        moments = [*moments[: MOST // 2], *moments[-(MOST - MOST // 2) :]]
    rows = -(-len(moments) // COLUMNS)
    figure, _ = canvas(0, width=11.0, height=2.3 * rows)
    for k, moment in enumerate(moments):
        axes = figure.add_subplot(rows, COLUMNS, k + 1)
        _picture(axes, moment, k + 1, run)
        for shape in concealed:
            axes.add_patch(Polygon(shape, closed=True, fc="none", ec="#c2185b", lw=1.2, ls="--"))
    _note(figure, run)
    return save(figure, out, name)


def _picture(axes: Axes, moment: Moment, number: int, run: NamoOutcome) -> None:
    corners = np.array(run.room)
    axes.add_patch(Polygon(corners, closed=True, fc="#fafafa", ec="#444", lw=1.5))
    for k, (name, pose) in enumerate(moment.poses.items()):
        turned = np.array(run.outlines[name]) @ rotation(pose[2]).T + np.array(pose[:2])
        axes.add_patch(Polygon(turned, closed=True, fc=COLOURS[k % len(COLOURS)], ec="#333", alpha=0.75))
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


def _short(sentence: str, most: int = 62) -> str:
    return sentence if len(sentence) <= most else f"{sentence[: most - 3]}..."


def _note(figure: Figure, run: NamoOutcome) -> None:
    planned, updates = run.rows["overall planning time [s]"], run.rows["calls to UpdateModel"]
    figure.suptitle(
        f"{run.seconds:.0f} s simulated, {planned:.2f} s of planning, {updates:.0f} model updates: {run.sentence}",
        fontsize=10,
    )
