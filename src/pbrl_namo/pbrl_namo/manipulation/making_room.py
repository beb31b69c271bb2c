"""Moving one thing so that another can be moved: what is in the way of the robot or of what it holds.

Where nothing that closes the goal's region can be moved far enough, something beside it may be what is wrong: it takes
the place to stand, or what is moved runs into it. So it is asked how the goal could be opened with everything else gone
that can be taken hold of from where the robot is. What then covers the floor that this takes (thing, robot and arms,
from the first stand to the last) has to go first, one after the other: to any place where the rest is still possible.
Each time there is one thing less in the way, until the opening can be made.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
import shapely

from pbrl_control.planar import Array, compose
from pbrl_namo.manipulation.aims import OpenWay, OutOfTheWay
from pbrl_namo.manipulation.in_steps import estimate_of
from pbrl_namo.manipulation.plan import Estimate
from pbrl_namo.manipulation.settings import ManipulationSettings
from pbrl_namo.manipulation.stances import leave_point
from pbrl_namo.manipulation.steps import SAME_PLACE, SAME_TURN, Step, StepSearch
from pbrl_namo.manipulation.study import Study
from pbrl_namo.manipulation.yard import Yard
from pbrl_namo.regions.free_space import ARC, FreeSpace, free_space
from pbrl_namo.regions.openings import Opening
from pbrl_namo.regions.roadmap import Roadmap
from pbrl_namo.scene import NamoScene

NEAR = 2.5
"""[m] between a thing that closes a region and another that may be in its way."""
MOST = 2
"""Things that may have to be put out of the way for one opening."""
CLEAR = 0.05
"""[m] kept from the floor that steps take: what they keep themselves, and what they sweep between two looks."""
LOOKS = 8
"""Parts of a motion at the ends of which the floor is looked at that it takes."""


class RoomMaker:
    """Looks for something to move out of the way of something else.

    Args:
        yard: the scene, prepared.
        free: its free space.
        roadmap: over it.
        study: makes a thing ready.
        settings: of Monte-Carlo manipulation.
        been: poses (3,) by name, to which things are not brought back [m, rad].
    """

    def __init__(
        self,
        yard: Yard,
        free: FreeSpace,
        roadmap: Roadmap,
        study: Callable[[str], Study],
        settings: ManipulationSettings,
        been: Mapping[str, Sequence[Array]],
    ) -> None:
        self._been = been
        self._yard, self._free, self._roadmap, self._study = yard, free, roadmap, study
        self._settings, self._scene = settings, yard.scene

    def find(self, closers: Sequence[Opening], target: Array) -> Estimate | None:
        """Return what to expect of moving something out of the way; None where nothing helps.

        Args:
            closers: openings from the robot's region that could not be made, whether their things can be held or not.
            target: (2,) in `world` to which a way is to be open in the end [m].
        """
        for opening in closers:
            found = self._for(opening, target)
            if found is not None:
                return found
        return None

    def _for(self, opening: Opening, target: Array) -> Estimate | None:
        """Return the same for one opening."""
        name, scene = opening.object, self._scene
        outline = scene.outlines[name]
        others = [
            other
            for other in scene.movable
            if other != name
            and opening.start in self._roadmap.grasp_regions(other)
            and scene.outlines[other].distance(outline) < NEAR
        ]
        if not others or not self._study(name).worlds.mobile() > 0.0:
            return None
        gone = others
        while gone:
            steps = self._steps(opening, target, gone)
            if not steps:
                return None
            area = _taken(scene, name, steps)
            blocking = [other for other in gone if area.intersects(scene.outlines[other])]
            if len(blocking) == len(gone) or len(blocking) <= 1:
                break
            gone = blocking
        if not 0 < len(blocking) <= MOST:
            return None
        for first in blocking:
            if not self._study(first).worlds.mobile() > 0.0:
                continue
            rest = [other for other in blocking if other != first]
            found = self._away(opening, target, steps, area, first, rest)
            if found is not None:
                return found
        return None

    def _steps(self, opening: Opening, target: Array, gone: Collection[str]) -> tuple[Step, ...]:
        """Return the steps of an opening's thing with others gone."""
        scene = self._scene.without(gone)
        free = free_space(scene, self._free.radius)
        start = free.index(self._inside(opening.start))
        if start is None or free.index(target) == start:
            return ()
        name = opening.object
        yard = Yard.of(scene, free.radius, self._settings.cell)
        then = tuple(other for other in opening.then if other not in gone)
        aim = OpenWay(scene.movable[name], target, scene.goal[None, :2], free.radius)
        asked = Opening(start, start, name, then)
        return StepSearch(yard, free, asked, self._study(name), aim, self._settings, self._been.get(name, ())).find()

    def _away(
        self,
        opening: Opening,
        target: Array,
        steps: tuple[Step, ...],
        area: shapely.Geometry,
        first: str,
        rest: Sequence[str],
    ) -> Estimate | None:
        """Return what to expect of putting one thing out of the way of steps that others may still be in."""
        scene, radius = self._scene, self._free.radius
        thing, mover = scene.movable[first], scene.movable[opening.object]
        floor = self._floor([opening.object, first, *rest])
        through = self._floor([opening.object, first, *rest, *opening.then])

        before = self._been.get(first, ())

        def good(step: Step) -> bool:
            if any(_near(step.end, pose) for pose in before):
                return False
            put, here = thing.at(step.end).buffer(radius, quad_segs=ARC), step.leave
            for later in steps:
                left = floor.difference(shapely.union(put, mover.at(later.pose).buffer(radius, quad_segs=ARC)))
                if not _joined(left, here, leave_point(later.pose, later.grasp)):
                    return False
                here = later.leave
            left = through.difference(shapely.union(put, mover.at(steps[-1].end).buffer(radius, quad_segs=ARC)))
            return _joined(left, here, target)

        aim = OutOfTheWay(thing, area, scene.goal[None, :2], radius, good)
        moved = Opening(opening.start, opening.end, first, tuple(dict.fromkeys((*rest, opening.object, *opening.then))))
        search = StepSearch(self._yard, self._free, moved, self._study(first), aim, self._settings, before)
        found = search.find()
        made = estimate_of(moved, found, self._study(first), target, self._settings) if found else None
        if made is None or made.plan is None:
            return None
        return replace(made, plan=replace(made.plan, more=made.plan.more + len(rest) + len(steps), aside=True))

    def _floor(self, gone: Collection[str]) -> shapely.Geometry:
        """Return where the disc can be with some things gone."""
        return shapely.union_all(list(free_space(self._scene, self._free.radius, set(gone)).regions))

    def _inside(self, region: int) -> Array:
        """Return a point (2,) in a region [m]."""
        return shapely.get_coordinates(self._free.regions[region].point_on_surface())[0]


def _taken(scene: NamoScene, name: str, steps: Sequence[Step]) -> shapely.Geometry:
    """Return the floor that steps take: thing, robot and arms, from the stands before them to those after them."""
    covers = []
    for step in steps:
        for share in np.linspace(0.0, 1.0, LOOKS + 1):
            pose = step.at(float(share))
            covers.append(scene.movable[name].at(pose))
            for outline in step.grasp.covers:
                corners = np.array([compose(pose, np.array([*corner, 0.0]))[:2] for corner in outline])
                covers.append(shapely.Polygon(corners))
    return shapely.union_all(covers).buffer(CLEAR)


def _near(a: Array, b: Array) -> bool:
    """Say whether two poses (3,) of a thing are much the same."""
    turned = abs(math.remainder(float(a[2] - b[2]), math.tau))
    return bool(np.hypot(*(a[:2] - b[:2])) < SAME_PLACE and turned < SAME_TURN)


def _joined(floor: shapely.Geometry, a: Array, b: Array) -> bool:
    """Say whether two points (2,) are in the same part of a floor."""
    parts = shapely.get_parts(floor)
    return bool((shapely.intersects_xy(parts, *a) & shapely.intersects_xy(parts, *b)).any())
