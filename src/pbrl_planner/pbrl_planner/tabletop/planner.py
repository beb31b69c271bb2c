"""Task-space RRT (thesis 3.1.3, figure 3): a tree of layouts, grown by pushes towards what an objective likes.

The tree holds only layouts that pushes can reach, so its best one is always a plan: stop whenever you like. Three
things make it grow: random layouts (`epsilon`), the best layout that DIRECTGD knows (by RRT-Connect), and, at the end,
the objective itself, push by push from the best layout in the tree. Where items stand in each other's way the tree is
deadlocked (thesis 3.2): each item alone is then brought to its place in a good layout, and who stands there steps
aside.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from pbrl_control.planar import Array
from pbrl_planner.errors import PlannerError
from pbrl_planner.tabletop.carry_kernel import carry
from pbrl_planner.tabletop.carrying import exchanged, in_the_way, steps_aside
from pbrl_planner.tabletop.descent import descend
from pbrl_planner.tabletop.desk import Desk
from pbrl_planner.tabletop.displacement import ForwardModel
from pbrl_planner.tabletop.objective import Objective
from pbrl_planner.tabletop.plan import Step, TabletopPlan
from pbrl_planner.tabletop.primitives import Push, pushes_of
from pbrl_planner.tabletop.settings import TabletopSettings
from pbrl_planner.tabletop.shorten import shortened
from pbrl_planner.tabletop.tree_kernel import PushTables, Tree, apart, connect, grow, push_fault

GREEDY_STEPS = 50
"""Of a connection before it is looked how good what it found is."""
WORTH = 1e-6
"""By which the objective has to fall to count as better."""
GOALS = 12
"""Good layouts that are kept to be gone for."""
THERE = 0.02
"""An item so near to its place [m] is there; the objective does the rest."""
CARRIED = 6000
"""Poses of one item that are looked at on its way."""
ASIDE = 20
"""Places that are drawn for an item that is in the way."""
PASSES = 3
"""Over all items, to bring each to its place."""


def push_tables(desk: Desk, model: ForwardModel, pushes: tuple[Push, ...], settings: TabletopSettings) -> PushTables:
    """Lay out what pushes do to the items of a desk.

    Raises:
        PlannerError: the model cannot say, see `ForwardModel`.
    """
    found = [model.displacements(item, pushes) for item in desk.items]
    spread = np.array([each.spread for each in found])
    # How far a corner may be from where it is expected: the middle's spread and the angle's, on the item's radius.
    radius = np.linalg.norm(desk.halves, axis=1)[:, None]
    doubt = np.sqrt(spread[..., 0] ** 2 + spread[..., 1] ** 2 + (radius * spread[..., 2]) ** 2)
    paths = [[push.path(item, desk.effector, settings.approach).ravel() for push in pushes] for item in desk.items]
    return PushTables(
        np.array([each.mean for each in found]),
        settings.margin + settings.sureness * doubt,
        np.array(paths),
        desk.effector + settings.margin,
        max(settings.travels) + 2.0 * (desk.effector + settings.approach + settings.margin),
        desk.halves,
        desk.fixed,
        desk.table.low,
        desk.table.high,
        desk.annulus,
    )


class TabletopPlanner:
    """One search, that can be gone on with.

    Args:
        objective: what is to become small; its desk is planned on.
        model: what pushes do.
        start: (n, 3) layout.
        seed: of the random layouts. The same seed gives the same tree after the same number of steps.
        settings: see there.

    Raises:
        PlannerError: the start overlaps or leaves the table, the objective is not finite there, or the model cannot
            say what the pushes do.
    """

    def __init__(
        self,
        objective: Objective,
        model: ForwardModel,
        start: Array,
        *,
        seed: int,
        settings: TabletopSettings | None = None,
    ) -> None:
        self.objective, self.settings = objective, settings or TabletopSettings()
        self.desk = objective.desk
        self.start = self.desk.layout(start)
        fault = self.desk.fault(self.start, -self.settings.touching)
        if fault:
            raise PlannerError(f"start: {fault}; move it, or leave it out")
        self.pushes = pushes_of(self.settings.travels)
        self._spread = np.array([model.displacements(item, self.pushes).spread for item in self.desk.items])
        self.tables = push_tables(self.desk, model, self.pushes, self.settings)
        self._rng = np.random.default_rng(seed)
        nodes, items, kinds = self.settings.nodes, len(self.desk.items), len(self.pushes)
        self.tree = Tree(
            np.empty((nodes, items, 3)),
            np.full(nodes, -1, dtype=np.int64),
            np.full(nodes, -1, dtype=np.int64),
            np.zeros((nodes, items * kinds), dtype=np.uint8),
            np.zeros(nodes, dtype=np.uint8),
            np.zeros(nodes, dtype=np.int64),
        )
        self.tree.layouts[0] = self.start
        self.count, self._valued = 1, 1
        self.first_cost = objective(self.start)
        self.best, self.best_cost, self._least = 0, self.first_cost, self.first_cost
        self.goal, self.goal_cost = self.start, np.inf
        self._goals: list[tuple[float, Array]] = []
        self._enough = -np.inf
        self.seconds = 0.0
        self.history = [(0.0, self.first_cost)]

    def improve(self, seconds: float, enough: float = -np.inf) -> bool:
        """Go on searching for some time, until a cost is reached, or until the tree is full.

        Args:
            seconds: from now on.
            enough: the cost at which to stop.

        Returns:
            Whether it is reached.
        """
        begun, before = time.perf_counter(), self.seconds
        self._enough = enough
        for _ in self._rounds():
            self.seconds = before + time.perf_counter() - begun
            self._take_stock()
            if self.best_cost <= enough or self.seconds - before >= seconds or self.count >= self.settings.nodes:
                break
        return self.best_cost <= enough

    def plan(self) -> TabletopPlan:
        """Return the pushes to the best layout so far."""
        row, sequence = self.best, []
        while row > 0:
            sequence.append(int(self.tree.via[row]))
            row = int(self.tree.parent[row])
        order = np.array(sequence[::-1], dtype=np.int64)
        if self.settings.shorten:
            order = shortened(self.start, order, self.tables, self.objective, self.settings.push_cost)
        layouts, steps = [self.start], []
        for via in order:
            item, kind = divmod(int(via), len(self.pushes))
            there, pose = layouts[-1].copy(), np.empty(3)
            push_fault(layouts[-1], item, kind, self.tables, pose)
            there[item] = pose
            layouts.append(there)
            steps.append(Step(item, self.pushes[kind], self._spread[item, kind]))
        return TabletopPlan(
            tuple(steps),
            np.array(layouts),
            self.objective(layouts[-1]),
            self.first_cost,
            self.seconds,
            self.count,
            float(self.goal_cost),
            tuple(self.history),
        )

    def _rounds(self) -> Iterator[None]:
        """Grow the tree; between two rounds the caller looks at the clock."""
        while True:
            if self.settings.descent:
                self._look_for_goal()
                yield
            greedy = int(self._rng.binomial(self.settings.every, 1.0 - self.settings.epsilon))
            goal = self.goal if self.settings.descent else self.tree.layouts[self.best].copy()
            self.tree.stuck[: self.count] = 0
            while greedy > 0:
                steps = min(greedy, GREEDY_STEPS)
                self.count = connect(self.tree, self.count, goal, self.settings.orientation, steps, self.tables)
                greedy -= steps
                yield
            if self.settings.climb:
                self._descend_by_pushes(self.best)
                yield
            if self.settings.carry and self._goals:
                self._descend_by_pushes(self._carry_to(self._goals[int(self._rng.integers(len(self._goals)))][1]))
                yield
            for _ in range(0, self.settings.every, GREEDY_STEPS):
                samples = self._random_layouts(int(self._rng.binomial(GREEDY_STEPS, self.settings.epsilon)))
                self.count = grow(self.tree, self.count, samples, self.settings.orientation, self.tables)
                yield

    def _look_for_goal(self) -> None:
        """Descend the objective from the best layout of the tree, and from others."""
        starts = [self.tree.layouts[self.best]]
        for k in range(1, self.settings.descents):
            if k % 2:
                starts.append(self.tree.layouts[int(self._rng.integers(self.count))])
            else:
                free = self._free_layout()
                starts += [] if free is None else [free]
        for start in starts:
            layout, cost = descend(self.objective, start, self.settings.margin, self.settings.orientation)
            if cost < self.goal_cost - WORTH:
                self.goal, self.goal_cost = layout, cost
            self._goals = sorted([*self._goals, (cost, layout)], key=lambda each: each[0])[:GOALS]

    def _free_layout(self) -> Array | None:
        """Return a random layout that is free of collision; None where twenty draws a thing found none."""
        layout = np.full_like(self.start, 1e6)
        for k in range(len(layout)):
            for draw in self._random_layouts(20)[:, k]:
                layout[k] = draw
                if not self.desk.fault_of(layout, k, self.settings.margin):
                    break
            else:
                return None
        return layout

    def _random_layouts(self, count: int) -> Array:
        """Draw layouts (count, n, 3), each item anywhere on the table."""
        low, high = np.append(self.desk.table.low, -np.pi), np.append(self.desk.table.high, np.pi)
        return self._rng.uniform(low, high, (count, len(self.desk.items), 3))

    def _carry_to(self, goal: Array) -> int:
        """Bring one item after the other to its place in a layout, from the best one; return the last row."""
        row, settings = self.best, self.settings
        goal = exchanged(self.objective, self.tree.layouts[row], goal)
        for _ in range(PASSES):
            missing = 0
            for item in self._rng.permutation(len(goal)).tolist():
                row = self._carried(row, item, goal[item])
                layout = self.tree.layouts[row]
                if apart(layout[item], goal[item], settings.orientation) <= THERE**2:
                    continue
                missing += 1
                for other in in_the_way(self.desk, layout, item, goal[item], settings.margin):
                    places = self._random_layouts(ASIDE)[:, other]
                    free = steps_aside(self.desk, layout, other, places, (item, goal[item]), settings.margin)
                    row = row if free is None else self._carried(row, other, free)
            if not missing or self.count >= settings.nodes:
                break
        return row

    def _carried(self, row: int, item: int, place: Array) -> int:
        """Add the pushes that bring an item from a row to a place, or nearer to it; return the last row."""
        via = np.empty(CARRIED, dtype=np.int64)
        layout, kinds = self.tree.layouts[row], len(self.pushes)
        length = carry(layout, item, place, self.settings.orientation, THERE, CARRIED, self.tables, via)
        for kind in via[:length].tolist():
            if self.count >= self.settings.nodes:
                break
            there = self.tree.layouts[row].copy()
            push_fault(self.tree.layouts[row], item, kind, self.tables, there[item])
            row = self._add(row, item * kinds + kind, there)
        return row

    def _add(self, row: int, via: int, layout: Array) -> int:
        """Add a layout that a push leads to; return its row."""
        new = self.count
        self.tree.layouts[new], self.tree.parent[new], self.tree.via[new] = layout, row, via
        self.tree.depth[new] = self.tree.depth[row] + 1
        self.tree.tried[new], self.tree.tried[row, via] = 0, 1
        self.count += 1
        return new

    def _descend_by_pushes(self, row: int) -> None:
        """Add the push from a layout that makes the objective smallest, and again, as long as one does."""
        self._take_stock()
        items, kinds = self.tables.clearance.shape
        new, cost = np.empty(3), self.objective(self.tree.layouts[row])
        while self.count < self.settings.nodes:
            layout = self.tree.layouts[row]
            found, via = [], []
            for code in range(items * kinds):
                item, kind = divmod(code, kinds)
                if push_fault(layout, item, kind, self.tables, new) == 0:
                    there = layout.copy()
                    there[item] = new
                    found.append(there)
                    via.append(code)
            if not found:
                return
            costs = self.objective.many(np.array(found))
            k = int(np.argmin(costs))
            if costs[k] >= cost - self.settings.push_cost - WORTH:
                return
            row, cost = self._add(row, via[k], found[k]), float(costs[k])
            self._take_stock()

    def _take_stock(self) -> None:
        """Value the layouts that are new, and note the best; what is better than enough counts no more than enough."""
        if self._valued == self.count:
            return
        costs = self.objective.many(self.tree.layouts[self._valued : self.count])
        whole = costs + self.settings.push_cost * self.tree.depth[self._valued : self.count]
        if (costs <= self._enough).any() and self.best_cost > self._enough:
            whole, self._least = np.where(costs <= self._enough, whole, np.inf), np.inf
        k = int(np.argmin(whole))
        if whole[k] < self._least - WORTH:
            self.best, self.best_cost, self._least = self._valued + k, float(costs[k]), float(whole[k])
            self.history.append((self.seconds, self.best_cost))
        self._valued = self.count


def plan_tidying(
    objective: Objective,
    model: ForwardModel,
    start: Array,
    *,
    seed: int,
    settings: TabletopSettings | None = None,
    enough: float = -np.inf,
) -> TabletopPlan:
    """Search until a cost is reached or the time of the settings is over; see `TabletopPlanner`."""
    settings = settings or TabletopSettings()
    search = TabletopPlanner(objective, model, start, seed=seed, settings=settings)
    search.improve(settings.time_limit, enough)
    return search.plan()
