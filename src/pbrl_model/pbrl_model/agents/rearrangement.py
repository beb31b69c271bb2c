"""Bringing several bodies to their goals, one at a time: A* for each among the others, in an order that works.

A body whose goal cannot be reached waits until others have moved. Where none can go on, one that stands in the way is
put aside, to a place that is on nobody's way. What cannot be done ends with a sentence.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_model.agents.domain import ActionSet, Goal, Scene
from pbrl_model.agents.joint_posterior import space_among
from pbrl_model.agents.motions import expected_motions
from pbrl_model.agents.obstacles import Obstacles, obstacles_of, placed
from pbrl_model.agents.planning import Motions, Planner, SearchOptions
from pbrl_model.agents.plans import Plan
from pbrl_model.agents.pushes import fitted_actions, measure
from pbrl_model.agents.room import Push

Array = NDArray[np.float64]

MARGINS = (0.04, 0.02)  # [m] kept from things; the second where the first leaves no way
SLIP = 0.015  # [m] a body this far from where the plan has it is planned for anew
HEEL = 0.03  # [rad] likewise
AIM = 0.7  # of a goal's tolerances that plans aim at: what is seen is not quite what is
SURPRISE = 0.05  # [m] a push that ends this far from where it was expected, turns counted, is learned from
REVISIONS = 8  # of what is believed of one body, at most
MOST_PUSHES = 80  # of one body towards one goal
FLOOD = 4000  # nodes that are searched for a place to put a body aside
ASIDE = 0.12  # [m] how far such a place is off the way, and its tolerance


@dataclass(frozen=True)
class Skill:
    """What is believed of one body, as the planner takes it.

    Attributes:
        actions: its pushes.
        motions: what they are expected to do.
        spread: the most by which draws of the posterior differ about it [m].
    """

    actions: ActionSet
    motions: Motions
    spread: float


def skill_of(scene: Scene, index: int, rows: Array) -> Skill:
    """Make pushes for a body under its posterior (P, 12), and their expected motions."""
    actions = fitted_actions(scene.things[index], rows)
    motions, spread = expected_motions(scene.things[index], rows, actions)
    return Skill(actions, motions, float(np.median(spread)) if len(spread) else 0.0)


@dataclass
class Rearrangement:
    """What was done so far.

    Attributes:
        scene: the room.
        skills: by body.
        act: carries a push out, given body, wrench (3,) in world axes and duration [s]; returns it as it was seen.
        state: (K, 6) as last seen.
        revise: learns from a push of a body that surprised and returns what is then believed of it, None where it tells
            nothing; None: nothing is learned.
        options: of the search.
        plans: (name, status, pushes planned) of each plan that was carried out.
        notes: what went wrong, in sentences.
    """

    scene: Scene
    skills: list[Skill]
    act: Callable[[int, Array, float], Push]
    state: Array
    revise: Callable[[int, Push], Skill | None] | None = None
    options: SearchOptions = field(default_factory=lambda: SearchOptions(weight=2.5, budget=20_000))
    plans: list[tuple[str, str, int]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def run(self, rounds: int = 4) -> bool:
        """Bring every body with a goal there; return whether all are there, as far as is seen."""
        for _ in range(rounds):
            while self._one_more():
                pass
            if not self._left():
                return True
            if not self._clear_a_way():
                break
        self.notes += [f"{self.scene.names[index]}: its goal was not reached" for index in self._left()]
        return not self._left()

    def plan(self, index: int, goal: Goal, without: Sequence[int] = ()) -> Plan:
        """Plan for a body among the others as they stand, some of them taken away in thought."""
        skill = self.skills[index]
        for margin in MARGINS:
            space = space_among(self.scene, self.state, index, without, margin + 2.0 * skill.spread)
            found = Planner(self.scene.things[index], space, self.options).plan(
                self.state[index, :3], goal, skill.motions
            )
            if found.reaches:
                break
        return found

    def _goal(self, index: int) -> Goal:
        goal = self.scene.things[index].goal
        if goal is None:
            raise ValueError(f"{self.scene.names[index]} has no goal")
        return replace(
            goal,
            position_tolerance=AIM * goal.position_tolerance,
            heading_tolerance=AIM * goal.heading_tolerance,
        )

    def _left(self) -> list[int]:
        """Return the bodies that are not at their goals, the small ones first: they are the easier to move."""
        left = [
            index
            for index, thing in enumerate(self.scene.things)
            if thing.goal is not None and not thing.goal.reached(self.state[index, :3])
        ]
        return sorted(left, key=lambda index: self.scene.things[index].inertia_per_mass)

    def _one_more(self) -> bool:
        """Bring one body to its goal; return whether one got there."""
        for index in self._left():
            if not len(self.skills[index].actions):
                continue
            found = self.plan(index, self._goal(index))
            if found.reaches and self._carry_out(index, self._goal(index), found):
                return True
        return False

    def _carry_out(self, index: int, goal: Goal, plan: Plan) -> bool:
        """Carry a plan out, planning anew where the body is not where it should be; return whether it got there."""
        self.plans.append((self.scene.names[index], plan.status.value, len(plan.actions)))
        step, revisions = 0, 0
        for _ in range(MOST_PUSHES):
            if goal.reached(self.state[index, :3]):
                return True
            if step >= len(plan.actions) or self._off(index, plan.poses[step]):
                plan, step = self.plan(index, goal), 0
                if not plan.reaches or not len(plan.actions):
                    break
            actions, action = self.skills[index].actions, int(plan.actions[step])
            wrench = actions.in_world(action, float(self.state[index, 2]))
            push = self.act(index, wrench, float(actions.duration[action]))
            self.state, step = push.after, step + 1
            if self.revise is None or revisions == REVISIONS or not self._surprising(index, plan.poses[step]):
                continue
            skill, revisions = self.revise(index, push), revisions + 1
            if skill is not None:
                self.skills[index] = skill
                plan, step = self.plan(index, goal), 0
                if not plan.reaches or not len(plan.actions):
                    break
        return goal.reached(self.state[index, :3])

    def _surprising(self, index: int, expected: Array) -> bool:
        gap = self.state[index, :3] - expected
        gap[2] = (gap[2] + np.pi) % (2.0 * np.pi) - np.pi
        return bool(measure(gap) > SURPRISE)

    def _off(self, index: int, expected: Array) -> bool:
        gap = self.state[index, :3] - expected
        turn = (gap[2] + np.pi) % (2.0 * np.pi) - np.pi
        return bool(np.hypot(gap[0], gap[1]) > SLIP or abs(turn) > HEEL)

    def _clear_a_way(self) -> bool:
        """Put a body aside that alone keeps another from its goal; return whether one was."""
        for index in self._left():
            for other in self._suspects(index):
                way = self.plan(index, self._goal(index), without=(other,))
                if way.reaches and self._put_aside(other, index, way):
                    return True
        return False

    def _suspects(self, index: int) -> list[int]:
        """Return the bodies that may stand in another's way, nearest to its goal or to where it gets stuck first."""
        stuck = self.plan(index, self._goal(index)).poses[-1, :2]
        places = np.array([stuck, self._goal(index).pose[:2]])
        near = np.hypot(*np.moveaxis(self.state[:, None, :2] - places, -1, 0)).min(axis=1)
        return [int(k) for k in np.argsort(near) if k != index and len(self.skills[k].actions)]

    def _put_aside(self, other: int, index: int, way: Plan) -> bool:
        """Bring a body to the nearest place it can reach that is off another's way and off all goals."""
        kept = [placed(self.scene.things[index].footprint, pose) for pose in way.poses]
        for number, thing in enumerate(self.scene.things):
            if thing.goal is not None and number != other:
                kept.append(placed(thing.footprint, np.nan_to_num(thing.goal.pose)))
        taboo = obstacles_of(kept)
        skill, thing = self.skills[other], self.scene.things[other]
        space = space_among(self.scene, self.state, other, (), MARGINS[0] + 2.0 * skill.spread)
        reached = Planner(thing, space, self.options).flood(self.state[other, :3], skill.motions, FLOOD)
        for node in reached.nearest_first():
            pose = reached.poses[node]
            if off_way(thing.footprint, pose, taboo):
                goal = Goal(np.array([*pose[:2], np.nan]), ASIDE)
                if self._carry_out(other, goal, reached.plan(int(node))):
                    self.notes.append(f"{thing.name}: put aside for {self.scene.names[index]}")
                    return True
                return False
        return False


def off_way(footprint: Array, pose: Array, taboo: Obstacles) -> bool:
    """Tell whether a body at a pose stays `ASIDE` off obstacles, by circles: places aside need no exactness."""
    reach = float(np.hypot(*footprint.T).max()) + taboo.radii + ASIDE
    return bool((np.hypot(*(taboo.middles - pose[:2]).T) >= reach).all())
