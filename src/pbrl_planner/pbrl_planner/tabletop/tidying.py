"""Execution: look, push, look again; go on as planned where that still works, plan anew where it does not.

Pure: a layout goes in, what to do next comes out. No clock but the planner's, no robot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from pbrl_control.planar import Array
from pbrl_control.settings import Positive, Section
from pbrl_planner.tabletop.descent import near_best
from pbrl_planner.tabletop.desk import Desk
from pbrl_planner.tabletop.displacement import ForwardModel
from pbrl_planner.tabletop.objective import Objective
from pbrl_planner.tabletop.plan import TabletopPlan
from pbrl_planner.tabletop.planner import TabletopPlanner, push_tables
from pbrl_planner.tabletop.primitives import Push, displacement, pushes_of
from pbrl_planner.tabletop.settings import TabletopSettings
from pbrl_planner.tabletop.task import Ended, Ending, NextPush
from pbrl_planner.tabletop.tree_kernel import follow_what_is_free

CLOSEST = 0.001
"""[m] that the rest of a plan has to keep from everything to be gone on with."""


class TidyingSettings(Section):
    """When it is tidy enough, and how much may be spent.

    Attributes:
        enough: cost at which the objective counts as reached; NaN: one that is near the best that layouts can have
            (`descent.near_best`), which the first look waits for.
        slack: cost by which a plan is to be better than enough, and by which the rest of it may come out worse than
            enough, before it is planned anew.
        think: [s] for the first plan, and for each that follows.
        pushes: most that are made.
        stubborn: times that a plan may bring nothing, in a row, before it is given up.
    """

    enough: float = math.nan
    slack: Positive = 0.03
    think: Positive = 2.0
    pushes: int = 400
    stubborn: int = 3


class Tidying:
    """One task.

    Args:
        objective: what is to become small, on a desk.
        model: what pushes do; it goes on learning.
        seed: of the searches.
        settings: of the execution.
        planning: of the searches.

    Attributes:
        replans: searches after the first.
        pushes: made.
        plan: the last one.
        planning_seconds: of all searches.
        cost: of the layout that was seen last.
        enough: cost at which the objective counts as reached.
    """

    def __init__(
        self,
        objective: Objective,
        model: ForwardModel,
        *,
        seed: int,
        settings: TidyingSettings,
        planning: TabletopSettings | None = None,
    ) -> None:
        self.objective, self.model, self.settings = objective, model, settings
        self.planning = planning or TabletopSettings()
        self.kinds = pushes_of(self.planning.travels)
        self.replans, self.pushes, self.planning_seconds, self.cost = -1, 0, 0.0, np.inf
        self.enough = self.settings.enough
        self.plan: TabletopPlan | None = None
        self._seed, self._left, self._idle = seed, np.empty(0, dtype=np.int64), 0
        self._made: tuple[int, Push, Array] | None = None

    @property
    def desk(self) -> Desk:
        """Table, items and obstacles."""
        return self.objective.desk

    def next(self, poses: Mapping[str, Array]) -> NextPush | Ended:
        """Return what to do, now that the items are seen at poses (3,) by name.

        Raises:
            PlannerError: the objective or the model cannot say.
        """
        unseen = [name for name in self.desk.names if name not in poses]
        if unseen:
            return Ended(Ending.LOST, f"not seen: {', '.join(unseen)}; put it back on the table")
        layout = self.desk.layout(np.array([poses[name] for name in self.desk.names]))
        self._learn(layout)
        fault = self.desk.fault(layout, -self.planning.touching)
        if fault:
            return Ended(Ending.BLOCKED, f"{fault}; move it a little by hand")
        if math.isnan(self.enough):
            rng = np.random.default_rng(self._seed)
            self.enough = near_best(self.objective, rng, self.planning.margin, self.planning.orientation)
        self.cost = self.objective(layout)
        if self.cost <= self.enough:
            return Ended(Ending.TIDY, f"cost {self.cost:.3f}, {self.enough:.3f} is enough")
        if self.pushes >= self.settings.pushes:
            return Ended(Ending.SPENT, f"cost {self.cost:.3f} after {self.pushes} pushes")
        if not self._still_good(layout):
            self._replan(layout)
        if not len(self._left):
            return Ended(Ending.BEST, f"cost {self.cost:.3f}, {self.enough:.3f} was wanted")
        item, kind = divmod(int(self._left[0]), len(self.kinds))
        self._left = self._left[1:]
        self.pushes += 1
        push = self.kinds[kind]
        self._made = (item, push, layout[item])
        path = push.path_in_world(self.desk.items[item], layout[item], self.desk.effector, self.planning.approach)
        return NextPush(item, push, path)

    def _learn(self, layout: Array) -> None:
        """Take in what the last push did."""
        if self._made is not None:
            item, push, before = self._made
            self.model.update(self.desk.items[item].name, push, displacement(before, layout[item]))
        self._made = None

    def _still_good(self, layout: Array) -> bool:
        """Say whether the rest of the plan ends about as well as was planned, without what is no longer free in it."""
        if not len(self._left) or self.plan is None:
            return False
        # What was kept free around each push was for this: it may be used up by what came out otherwise.
        bare = self.planning.model_copy(update={"margin": CLOSEST, "sureness": 0.0})
        tables = push_tables(self.desk, self.model, self.kinds, bare)
        end, free = np.empty_like(layout), np.empty(len(self._left), dtype=np.uint8)
        follow_what_is_free(layout, self._left, free, tables, end)
        slack = self.settings.slack
        if not free.any() or self.objective(end) > max(self.plan.cost + slack, self.enough) + slack:
            return False
        self._left = self._left[free > 0]
        return True

    def _replan(self, layout: Array) -> None:
        self.replans += 1
        settings = self.settings
        best: TabletopPlan | None = None
        for _ in range(settings.stubborn):
            self._seed += 1
            search = TabletopPlanner(self.objective, self.model, layout, seed=self._seed, settings=self.planning)
            search.improve(settings.think, self.enough - settings.slack)
            best = search.plan()
            self.planning_seconds += search.seconds
            if best.steps:
                break
        assert best is not None
        self.plan = best
        self._left = np.array(
            [step.item * len(self.kinds) + self.kinds.index(step.push) for step in best.steps], dtype=np.int64
        )
