"""A drive from above: the map, the way of the base coloured by time, people's ways, and where and why it stood."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import Polygon

from pbrl_bringup.cart.outcome import CartOutcome, Trace
from pbrl_bringup.experiments.figures import canvas, save
from pbrl_control.cart import DriveStatus
from pbrl_control.planar import rotation
from pr2_cart_sim.maps import OCCUPIED, UNKNOWN, load_map
from pr2_cart_sim.scene import OfficeScene

STOPS = {
    str(DriveStatus.BLOCKED): ("stands before something", "#c0392b"),
    str(DriveStatus.WAITING): ("waits for senses", "#8e44ad"),
    "planning": ("has no plan", "#e67e22"),
}
"""What is marked."""
SHOWN = 12.0
"""Between two outlines of robot and cart [s]."""
ROBOT = 0.334 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])


def draw(scene: OfficeScene, legs: Sequence[CartOutcome], out: Path) -> Path:
    """Draw legs through one office into a folder as `figure.png`."""
    figure, (axes,) = canvas(1, width=11.0, height=9.0)
    draw_floor(axes, scene)
    cart = np.array(scene.bodies[scene.robot.holds or "cart"].footprint)
    clock = 0.0
    total = max(sum(leg.seconds for leg in legs), 1.0)
    lines = None
    for leg in legs:
        draw_people(axes, leg.trace)
        lines = draw_way(axes, leg.trace, clock, total) or lines
        draw_bodies(axes, leg.trace, cart)
        axes.plot(*leg.goal[:2], marker="x", color="#111", ms=9, mew=2)
        clock += leg.seconds
    draw_stops(axes, legs)
    if lines is not None:
        figure.colorbar(lines, ax=axes, label="time [s]", shrink=0.6)
    touches, reached = sum(len(leg.score.contacts) for leg in legs), sum(leg.reached for leg in legs)
    axes.set_title(f"{len(legs)} legs, {clock:.0f} s simulated, {reached} goals reached, {touches} contacts")
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    return save(figure, out)


def draw_floor(axes: Axes, scene: OfficeScene) -> None:
    """Draw the map, and what stands around that is not in it."""
    if scene.map is not None:
        grid = load_map(Path(scene.map))
        shade = np.full(grid.cells.shape, 1.0)
        shade[grid.cells == OCCUPIED], shade[grid.cells == UNKNOWN] = 0.25, 0.8
        (left, bottom), (right, top) = grid.outline[0], grid.outline[2]
        axes.imshow(shade, cmap="gray", vmin=0, vmax=1, origin="lower", extent=(left, right, bottom, top))
    for body in scene.clutter.values():
        x, y, heading = body.pose
        corners = np.array(body.footprint) @ rotation(heading).T + [x, y]
        axes.add_patch(Polygon(corners, closed=True, fc="#c8b89a", ec="#86754f", lw=0.8))


def draw_people(axes: Axes, trace: Sequence[Trace]) -> None:
    """Draw where people walked."""
    for name in trace[0].people if trace else ():
        way = np.array([each.people[name] for each in trace])
        axes.plot(*way.T, color="#7f8c8d", lw=0.7, alpha=0.5, zorder=1)


def draw_way(axes: Axes, trace: Sequence[Trace], clock: float, total: float) -> LineCollection | None:
    """Draw the base's way, coloured by the time since the first leg began; return the lines."""
    if len(trace) < 2:
        return None
    way = np.array([each.base[:2] for each in trace])
    lines = LineCollection(list(np.stack((way[:-1], way[1:]), axis=1)), cmap="viridis", lw=2.0, zorder=3)
    lines.set_array(np.array([clock + each.time for each in trace[:-1]]))
    lines.set_clim(0.0, total)
    axes.add_collection(lines)
    return lines


def draw_bodies(axes: Axes, trace: Sequence[Trace], cart: np.ndarray) -> None:
    """Draw outlines of robot and cart every few seconds."""
    last = -SHOWN
    for each in trace:
        if each.time - last < SHOWN:
            continue
        last = each.time
        for outline, pose, colour in ((ROBOT, each.base, "#34495e"), (cart, each.cart, "#27ae60")):
            corners = outline @ rotation(pose[2]).T + np.array(pose[:2])
            axes.add_patch(Polygon(corners, closed=True, fill=False, ec=colour, lw=0.8, alpha=0.8, zorder=2))


def draw_stops(axes: Axes, legs: Sequence[CartOutcome]) -> None:
    """Mark where it stood, and why."""
    for status, (words, colour) in STOPS.items():
        places = [each.base[:2] for leg in legs for each in leg.trace if each.status == status and each.time > 0.5]
        if places:
            x, y = np.array(places).T
            axes.scatter(x, y, s=30, color=colour, alpha=0.35, label=words, zorder=4)
    touches = [
        min(leg.trace, key=lambda each: abs(each.time - touch.time)).base[:2]
        for leg in legs
        for touch in leg.score.contacts
        if leg.trace
    ]
    if touches:
        x, y = np.array(touches).T
        axes.scatter(x, y, s=120, marker="*", color="#ff0000", label="contact", zorder=5)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper right", fontsize=8)
