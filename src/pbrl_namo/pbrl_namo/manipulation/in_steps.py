"""What is expected of an opening that takes several manipulations of its thing, one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pbrl_control.planar import Array
from pbrl_namo.manipulation.aims import OpenWay
from pbrl_namo.manipulation.best_plan import best_plan
from pbrl_namo.manipulation.cost import reward
from pbrl_namo.manipulation.effort_kernel import FORCE, SUM, TIME, TORQUE
from pbrl_namo.manipulation.plan import Estimate
from pbrl_namo.manipulation.policies import Commands
from pbrl_namo.manipulation.settings import ManipulationSettings
from pbrl_namo.manipulation.steps import Step, StepSearch
from pbrl_namo.manipulation.study import Study
from pbrl_namo.manipulation.ways_to_move import WaysToMove
from pbrl_namo.manipulation.yard import Yard
from pbrl_namo.regions.free_space import FreeSpace
from pbrl_namo.regions.openings import Opening

Flags = NDArray[np.bool_]


def estimate_in_steps(
    yard: Yard,
    free: FreeSpace,
    opening: Opening,
    study: Study,
    target: Array,
    settings: ManipulationSettings,
    been: Sequence[Array] = (),
) -> Estimate | None:
    """Return what is expected of an opening in steps that suit what its thing most likely is; None where none do.

    Args:
        yard: the scene, prepared.
        free: its free space.
        opening: one of theirs.
        study: of the opening's object.
        target: (2,) in `world`, to which a way is to be open [m].
        settings: of Monte-Carlo manipulation.
        been: poses (3,) to which the thing is not brought back [m, rad].
    """
    aim = OpenWay(yard.scene.movable[opening.object], target, yard.scene.goal[None, :2], free.radius)
    steps = StepSearch(yard, free, opening, study, aim, settings, been).find()
    return estimate_of(opening, steps, study, target, settings) if steps else None


def estimate_of(
    opening: Opening, steps: tuple[Step, ...], study: Study, target: Array, settings: ManipulationSettings
) -> Estimate | None:
    """Return what is expected of steps of an opening's object in all its worlds; None where they work in none."""
    worlds, works, rewards = study.worlds, np.ones(len(study.worlds), dtype=bool), np.zeros(len(study.worlds))
    first: tuple[WaysToMove, Array] | None = None
    for step in steps:
        commands = Commands.given(step.twist[None], worlds, settings)
        ways = WaysToMove.of([(0, (0,), (step.way,))], commands, [step.grasp], settings)
        taken = ways.efforts(worlds, [step.grasp], settings.constraints.torque_arm)
        works &= np.nan_to_num(taken[:, 0, SUM], nan=np.inf) <= settings.constraints.grip_force
        rewards += reward(taken[:, 0, TIME], taken[:, 0, FORCE], taken[:, 0, TORQUE], settings.cost)
        first = first or (ways, taken)
    if first is None or not works.any():
        return None
    plan = best_plan(
        [steps[0].grasp],
        steps[0].pose,
        opening.object,
        target,
        worlds,
        *first,
        rewards[:, None],
        works[:, None],
        settings,
    )
    best = np.where(works, rewards, -settings.cost.alpha)
    return Estimate(opening, float(works.mean()), float(best.mean()), replace(plan, more=len(steps) - 1))
