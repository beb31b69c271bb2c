"""Moving a thing against others that stand in its way, where nothing helps that touches nothing.

A table behind a door stands before a chair, which nobody can get at but past the table. So the table is pushed on, and
the chair before it. What that takes, and where the chair then is, depends on the physics of both: each way is followed
in contact worlds (`contact_worlds`), drawn from what is believed of everything that may be touched, and what counts is
in how many of them the grips can do it and the goal can be driven to afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.planar import Array, compose
from pbrl_namo.errors import NamoError
from pbrl_namo.manipulation.contact_worlds import Carried, ContactWorlds
from pbrl_namo.manipulation.effort_kernel import SUM
from pbrl_namo.manipulation.grasps import Grasp, chosen
from pbrl_namo.manipulation.in_steps import estimate_of
from pbrl_namo.manipulation.plan import Estimate
from pbrl_namo.manipulation.policies import Commands, motions_of
from pbrl_namo.manipulation.rollout import Roller
from pbrl_namo.manipulation.settings import ManipulationSettings
from pbrl_namo.manipulation.steps import SHORT, Step
from pbrl_namo.manipulation.study import Study
from pbrl_namo.manipulation.ways_to_move import WaysToMove
from pbrl_namo.manipulation.yard import Yard
from pbrl_namo.regions.free_space import FreeSpace, free_space
from pbrl_namo.regions.openings import Opening

WORLDS, FEW = 8, 2
"""Contact worlds in which a way is followed that works in one of these few."""
GRASPS = 6
"""That are tried."""
LENGTHS = (0.0, 0.5, 1.0)
"""Shares of what is left of a motion once a way would be open with nothing else there: what is pushed has to go too."""
MOST, ALL = 40, 80
"""Ways that are followed, the shortest first: of one opening, and of all together."""
PUSHED = 3
"""Things that may be pushed: of a heap nobody knows how it goes on."""
SURE = 0.75
"""Share of the worlds from which on no further way is tried."""


@dataclass(frozen=True)
class Through:
    """One way, followed in all contact worlds.

    Attributes:
        step: of what is held.
        works: (w,) in which worlds the goal can be driven to then, and the grips had the force.
        force: greatest that others put on what is held, in those [N].
        pushed: what is not where it was, in one of them at least.
    """

    step: Step
    works: NDArray[np.bool_]
    force: float
    pushed: tuple[str, ...]


class PushingThrough:
    """Looks for a thing that opens the way if it is moved against others.

    Args:
        yard: the scene, prepared.
        free: its free space.
        study: makes a thing ready.
        settings: of Monte-Carlo manipulation.
    """

    def __init__(
        self, yard: Yard, free: FreeSpace, study: Callable[[str], Study], settings: ManipulationSettings
    ) -> None:
        self._yard, self._scene = yard, yard.scene
        self._free, self._study, self._settings = free, study, settings
        self._left = ALL

    def find(self, closers: Sequence[Opening], target: Array) -> Estimate | None:
        """Return what to expect of pushing something through; None where nothing helps.

        Now and then the best way touches nothing, because contact worlds have no margins: then it pushes nothing.

        Args:
            closers: openings from the robot's region that could not be made.
            target: (2,) in `world` to which a way is to be open [m].
        """
        found = (self._for(opening, target) for opening in closers if self._left > 0)
        return next((each for each in found if each is not None), None)

    def _for(self, opening: Opening, target: Array) -> Estimate | None:
        """Return the same for one opening."""
        name, scene, settings = opening.object, self._scene, self._settings
        study = self._study(name)
        mobile = [other for other in scene.movable if other != name and self._study(other).worlds.mobile() > 0.0]
        if not mobile or not study.worlds.mobile() > 0.0:
            return None
        grasps = self._grasps(opening, study)
        if not grasps:
            return None
        few, worlds = (
            ContactWorlds(
                scene, name, {other: _spread(self._study(other).worlds.models, count) for other in mobile}, settings
            )
            for count in (FEW, WORLDS)
        )
        best, limit = None, settings.constraints.grip_force
        for step in self._ways(opening, study, grasps, mobile, target):
            self._left -= 1
            spare = limit - self._own(study, step)
            if self._followed(few, name, mobile, step, target, spare) is None:
                continue
            through = self._followed(worlds, name, mobile, step, target, spare)
            if through is not None and (best is None or through.works.mean() > best.works.mean()):
                best = through
            if best is not None and best.works.mean() >= SURE:
                break
        if best is None:
            return None
        made = estimate_of(opening, (best.step,), study, target, settings)
        if made is None or made.plan is None:
            return None
        share = float(best.works.mean())
        plan = replace(
            made.plan,
            expected_force=made.plan.expected_force + best.force,
            highest_force=made.plan.highest_force + best.force,
            works=share * made.plan.works,
            pushes=best.pushed,
        )
        return replace(made, opening=replace(opening, then=()), probability=share * made.probability, plan=plan)

    def _grasps(self, opening: Opening, study: Study) -> tuple[Grasp, ...]:
        """Return a few grasps that the robot can take from where it is."""
        yard = self._yard
        others = yard.pieces.taken(np.flatnonzero(~yard.owned((opening.object,))))
        pose = np.array(self._scene.poses[opening.object], dtype=float)
        usable = study.stances.free(pose, self._free.regions[opening.start], others)
        few = self._settings.model_copy(update={"grasps": GRASPS})
        return study.stances.taken(chosen(study.stances.grasps, usable, few))

    def _ways(
        self, opening: Opening, study: Study, grasps: tuple[Grasp, ...], gone: Sequence[str], target: Array
    ) -> Iterator[Step]:
        """Yield motions that would open the way with other things gone, the shortest first, and how far each may go."""
        name, settings = opening.object, self._settings
        yard = Yard.of(self._scene.without(gone), self._free.radius, settings.cell)
        asked = Opening(opening.start, opening.end, name)
        freedom = study.worlds.only(study.worlds.typical()).freedoms[0]
        twists, usable = motions_of(freedom, [grasp.base for grasp in grasps], settings.radii)
        first = Roller(yard, asked, study.body, grasps, target, settings).roll(twists, usable)
        whole = Roller(yard, asked, study.body, grasps, None, settings).roll(twists, usable).went
        pose = np.array(self._scene.poses[name], dtype=float)
        found = [
            Step(pose, grasps[g], twists[c], float(first.went[c, g] + share * (whole[c, g] - first.went[c, g])))
            for c, g in zip(*np.nonzero(first.opened), strict=True)
            for share in LENGTHS
        ]
        yield from sorted((step for step in found if step.way > SHORT), key=lambda step: step.way)[
            : min(MOST, self._left)
        ]

    def _own(self, study: Study, step: Step) -> float:
        """Return the sum of the grips' forces that what is held most likely takes [N]; NaN: it would not obey."""
        usual = study.worlds.only(study.worlds.typical())
        ways = WaysToMove.of(
            [(0, (0,), (step.way,))],
            Commands.given(step.twist[None], usual, self._settings),
            [step.grasp],
            self._settings,
        )
        return float(ways.efforts(usual, [step.grasp], self._settings.constraints.torque_arm)[0, 0, SUM])

    def _followed(
        self, worlds: ContactWorlds, name: str, others: Sequence[str], step: Step, target: Array, limit: float
    ) -> Through | None:
        """Return what becomes of one way; others may resist up to a limit [N]; None where it works in no world."""
        if not limit > 0.0:
            return None
        motion = self._settings.motion
        fast = max(float(np.hypot(*step.twist[:2])) / motion.speed, abs(float(step.twist[2])) / motion.yaw_rate)
        try:
            carried = worlds.carry(step.grasp.base, [(step.twist / fast, step.way * fast)])
        except NamoError:  # some world ran away: things were pressed into each other
            return None
        works = carried.force <= limit
        for world in np.flatnonzero(works):
            works[world] = self._open(name, step, carried, int(world), target)
        if not works.any():
            return None
        pushed = [each for each in others if carried.moved(each, self._scene.poses[each])[works].any()]
        if len(pushed) > PUSHED:
            return None
        return Through(step, works, float(carried.force[works].max()), tuple(pushed))

    def _open(self, name: str, step: Step, carried: Carried, world: int, target: Array) -> bool:
        """Say whether the robot can back off, and drive to a point (2,) then, in one world."""
        poses = {each: found[world] for each, found in carried.poses.items()}
        scene = self._scene.moved({**poses, name: carried.end})
        robot = [compose(carried.end, np.array([*corner, 0.0]))[:2] for corner in step.grasp.covers[0]]
        if any(shapely.Polygon(robot).intersects(scene.outlines[each]) for each in poses):
            return False
        free = free_space(scene, self._free.radius)
        here = free.index(compose(carried.end, step.grasp.leave)[:2])
        return here is not None and here == free.index(target)


def _spread(models: Sequence[ObjectModel], count: int) -> tuple[ObjectModel, ...]:
    """Return some of a thing's worlds, in the middles of equal parts."""
    picked = ((np.arange(count) + 0.5) / count * len(models)).astype(int)
    return tuple(models[k] for k in picked)
