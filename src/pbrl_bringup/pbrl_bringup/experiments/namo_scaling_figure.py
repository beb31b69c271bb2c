"""Time to plan over the number of obstacles, beside one room: its regions, and how what is moved first is moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import matplotlib
import numpy as np
import shapely
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch, Polygon, Rectangle
from matplotlib.path import Path as Outline

from pbrl_bringup.experiments.figures import canvas, save
from pbrl_control.planar import Array, compose, inverse
from pbrl_namo.manipulation.plan import Estimate, ManipulationPlan
from pbrl_namo.manipulation.plane_kernel import moved
from pbrl_namo.planner import NamoPlan
from pbrl_namo.scene import NamoScene

MARKS = {"a move": ("o", "#0b3c8c"), "cut off": ("s", "#c0392b"), "no move works": ("^", "#e08a00")}
"""Marker and colour of what a plan answers."""
MOVED, HERE, THERE = "#e08a00", "#0b3c8c", "#1e7d32"
"""Colours of what is moved, of the robot where it starts, and of the goal."""
PALETTE = "tab20"
AROUND = 0.8
"""Floor that is shown around a manipulation [m]."""
GHOSTS = 4
"""Outlines along each motion of what is moved."""
TICKS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
SPREAD = 0.02
"""Rooms of one size are drawn side by side, so far from each other in log10 of obstacles."""


class Planned(Protocol):
    """What is drawn of one room."""

    @property
    def count(self) -> int:
        """Of movable obstacles."""

    @property
    def process(self) -> float:
        """Time on the processor [s]."""

    @property
    def answer(self) -> str:
        """One of `MARKS`."""


@dataclass(frozen=True)
class Fit:
    """A power law through the medians of the sizes.

    Attributes:
        sizes: numbers of obstacles.
        medians: of the planning time of each [s].
        exponent: of obstacles.
        factor: seconds of one obstacle [s].
    """

    sizes: tuple[int, ...]
    medians: tuple[float, ...]
    exponent: float
    factor: float

    def at(self, count: Array) -> Array:
        """Return the seconds (n,) for numbers of obstacles (n,)."""
        return self.factor * count**self.exponent


def draw(found: Sequence[Planned], fit: Fit, scene: NamoScene, made: NamoPlan, out: Path) -> Path:
    """Draw times and a room into a folder as `figure.png`.

    Args:
        found: all rooms.
        fit: to their times.
        scene: of the room that is drawn.
        made: plan in it.
        out: folder.
    """
    figure, panels = canvas(3, width=18.0, height=6.6)
    times(panels[0], found, fit)
    room(panels[1], scene, made)
    panels[1].set_title(_counted(scene, made), fontsize=10, loc="left")
    if made.chosen is not None and made.chosen.plan is not None:
        plan = made.chosen.plan
        low, high = _around(scene, plan)
        panels[1].add_patch(
            Rectangle((float(low[0]), float(low[1])), *(high - low), fill=False, ec="black", lw=1.2, zorder=8)
        )
        room(panels[2], scene, made)
        panels[2].set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        panels[2].set_title(_told(made.chosen, plan), fontsize=10, loc="left")
    else:
        panels[2].set_axis_off()
    marks = [*_marks(), *_marks_of_motion()]
    figure.legend(handles=marks, loc="outside lower center", ncols=len(marks), frameon=False, fontsize=9)
    return save(figure, out)


def times(axes: Axes, found: Sequence[Planned], fit: Fit) -> None:
    """Draw the time of every room over its number of obstacles, medians and fit, both axes logarithmic."""
    for answer, (marker, colour) in MARKS.items():
        own = [each for each in found if each.answer == answer]
        if own:
            x = [each.count * 10 ** (SPREAD * _place(found, each)) for each in own]
            axes.plot(x, [each.process for each in own], marker, color=colour, ms=4, alpha=0.6, label=answer)
    line = np.geomspace(min(fit.sizes) / 1.2, max(fit.sizes) * 1.2, 50)
    axes.plot(
        line, fit.at(line), color="black", lw=1.3, label=f"{fit.factor:.3f} s · n$^{{{fit.exponent:.2f}}}$, of medians"
    )
    axes.plot(fit.sizes, fit.medians, "_", color="black", ms=22, mew=2.0, label="median")
    axes.set(xscale="log", yscale="log", xlabel="movable obstacles n", ylabel="belief and plan, on the processor [s]")
    axes.set_xticks(fit.sizes, [str(size) for size in fit.sizes])
    axes.minorticks_off()
    low, high = (edge([each.process for each in found]) for edge in (min, max))
    ticks = [tick for tick in TICKS if low / 2.0 <= tick <= 2.0 * high]
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, loc="upper left", fontsize=9)
    axes.set_title("Time until the next manipulation is chosen, random offices", fontsize=10, loc="left")


def _place(found: Sequence[Planned], each: Planned) -> float:
    """Return how far to the side a room is drawn, its size's middle being 0."""
    own = [other for other in found if other.count == each.count]
    return (next(k for k, other in enumerate(own) if other is each) - 0.5 * (len(own) - 1)) / max(len(own), 1) * 6.0


def room(axes: Axes, scene: NamoScene, made: NamoPlan) -> None:
    """Draw a room: regions coloured, the opening that was chosen, and how its obstacle is to be moved."""
    axes.add_patch(_patch(scene.room, fc="#f4f4f4", ec="#444", lw=1.5))
    colours = matplotlib.colormaps[PALETTE]
    for number, region in enumerate(made.free.regions):
        axes.add_patch(_patch(region, fc=colours(number % 20), ec="none", alpha=0.45))
    for fixed in scene.fixed.values():
        axes.add_patch(_patch(fixed, fc="#555", ec="#333", lw=0.5))
    if made.chosen is not None:
        for number in (made.chosen.opening.start, made.chosen.opening.end):
            region = made.free.regions[number]
            axes.add_patch(_patch(region, fc="none", ec=colours(number % 20), lw=2.0))
            middle = region.point_on_surface()
            axes.text(middle.x, middle.y, str(number), fontsize=11, ha="center", va="center", clip_on=True, zorder=9)
    for outline in scene.outlines.values():
        axes.add_patch(_patch(outline, fc="white", ec="#666", lw=0.8))
    robot = Polygon(scene.robot.at(scene.start), closed=True, fc=HERE, ec="black", lw=0.8, zorder=6)
    axes.add_patch(robot)
    ahead = scene.start[:2] + 0.4 * np.array([np.cos(scene.start[2]), np.sin(scene.start[2])])
    axes.plot(*np.vstack((scene.start[:2], ahead)).T, color="white", lw=1.5, zorder=7)
    axes.plot(*scene.goal[:2], "*", color=THERE, ms=17, mec="black", zorder=7)
    if made.chosen is not None and made.chosen.plan is not None:
        _manipulation(axes, scene, made.chosen.plan)
    low, high = np.reshape(scene.room.bounds, (2, 2))
    axes.set(xlim=(low[0] - 0.2, high[0] + 0.2), ylim=(low[1] - 0.2, high[1] + 0.2), aspect="equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


def _manipulation(axes: Axes, scene: NamoScene, plan: ManipulationPlan) -> None:
    """Draw what is moved, along its way, the robot as it grasps, and where the way leads that is opened."""
    poses = way_of(plan, scene.poses[plan.object])
    thing = scene.movable[plan.object]
    for shade, pose in zip(np.linspace(0.3, 0.9, len(poses)), poses, strict=True):
        axes.add_patch(_patch(thing.at(pose), fc=MOVED, ec="black", lw=0.9, alpha=float(shade), zorder=4))
    axes.plot(*poses[:, :2].T, color="black", lw=1.4, zorder=5)
    axes.plot(*poses[-1, :2], "o", color="black", ms=4, zorder=5)
    for end, style in ((plan.stand, "--"), (_end_of_base(plan, poses), ":")):
        axes.add_patch(Polygon(scene.robot.at(end), closed=True, fill=False, ec=HERE, lw=1.4, ls=style, zorder=6))


def _end_of_base(plan: ManipulationPlan, poses: Array) -> Array:
    """Return where the base (3,) is when the thing has come to the end, still gripped."""
    return compose(poses[-1], compose(inverse(poses[0]), plan.stand))


def _around(scene: NamoScene, plan: ManipulationPlan) -> tuple[Array, Array]:
    """Return the corners (2,) of a square around all of a manipulation [m]."""
    poses = way_of(plan, scene.poses[plan.object])
    shapes = [scene.movable[plan.object].at(pose) for pose in poses[[0, -1]]]
    shapes += [shapely.Polygon(scene.robot.at(base)) for base in (plan.stand, _end_of_base(plan, poses))]
    low, high = np.reshape(shapely.total_bounds(shapes), (2, 2))
    middle, half = 0.5 * (low + high), 0.5 * float((high - low).max()) + AROUND
    return middle - half, middle + half


def way_of(plan: ManipulationPlan, pose: Array) -> Array:
    """Return poses (n, 3) of what is moved, from where it stands (3,) to the end [m, rad]."""
    poses, here = [np.array(pose, dtype=float)], np.array(pose, dtype=float)
    for motion in plan.motions:
        for share in np.linspace(0.0, motion.duration, GHOSTS)[1:]:
            there = np.empty(3)
            moved(here, np.asarray(motion.twist, dtype=float), float(share), there)
            poses.append(there)
        here = poses[-1]
    return np.array([compose(each, np.zeros(3)) for each in poses])


def length_of(scene: NamoScene, plan: ManipulationPlan) -> float:
    """Return how far the corners of what is moved go at most, along a straight line from start to end [m]."""
    corners = [
        shapely.get_coordinates(scene.movable[plan.object].at(pose)) for pose in (scene.poses[plan.object], plan.end)
    ]
    return float(np.hypot(*(corners[1] - corners[0]).T).max())


def _counted(scene: NamoScene, made: NamoPlan) -> str:
    """Say what is in a room."""
    return f"{len(scene.movable)} obstacles, {len(made.free.regions)} regions in colours, {len(made.openings)} openings"


def _told(chosen: Estimate, plan: ManipulationPlan) -> str:
    """Say what is to be moved."""
    then = " and ".join(name.replace("_", " ") for name in chosen.opening.then)
    after = f" ({then} after it)" if then else ""
    return (
        f"{plan.object.replace('_', ' ')} is moved first{after}, to open region {chosen.opening.end} from "
        f"{chosen.opening.start}:\nlikely to work with {chosen.probability:.2f}, {plan.expected_force:.0f} N expected"
    )


def _marks() -> list[Artist]:
    return [
        Patch(fc=HERE, ec="black", label="robot"),
        Line2D([], [], color=THERE, marker="*", ms=13, mec="black", ls="", label="goal"),
        Patch(fc="white", ec="#666", label="obstacle"),
        Patch(fc="#555", ec="#333", label="fixed"),
    ]


def _marks_of_motion() -> list[Artist]:
    return [
        Patch(fc=MOVED, ec="black", alpha=0.85, label="moved, darker as it goes"),
        Patch(fc="none", ec=HERE, ls="--", label="robot as it grasps"),
        Patch(fc="none", ec=HERE, ls=":", label="robot at the end"),
    ]


def _patch(shape: shapely.Polygon, **look: Any) -> PathPatch:
    """Return a polygon, holes and all, to be drawn."""
    rings = [np.asarray(ring.coords)[:, :2] for ring in (shape.exterior, *shape.interiors)]
    return PathPatch(Outline.make_compound_path(*[Outline(ring, closed=True) for ring in rings]), **look)
