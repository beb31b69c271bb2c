"""Kinodynamic RRT (LaValle and Kuffner 2001; thesis 6.2.1): draw controls, simulate them, grow a tree of what they do.

The tree is OMPL's `control.RRT`; its edges are the world model's compiled kernel, so wheels that roll one way, feet
that slide and hinges are in every one of them. Where a control leads is not known until it is simulated. That serves
any physics and any goal, and is paid for with detours: it is the baseline of the policies that replaced it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from ompl import base as ob
from ompl import control as oc

from pbrl_control.planar import Array
from pbrl_model.rollout import com_to_origin, origin_to_com
from pbrl_planner.errors import PlannerError
from pbrl_planner.kinodynamic.braking import brake
from pbrl_planner.kinodynamic.dynamics import PushDynamics, wrapped
from pbrl_planner.kinodynamic.plan import KinodynamicPlan, KinodynamicResult
from pbrl_planner.kinodynamic.problem import PushProblem
from pbrl_planner.kinodynamic.settings import KinodynamicSettings
from pbrl_planner.kinodynamic.space import bounds, read_state, state_space, write_state
from pbrl_planner.ompl_session import Budget, seeded

UNREACHED = 1.0  # distance to a goal of which no more is known than that this is not it
REACHED = 1e-9  # distance below which a goal counts as reached
BLOCKED = 1e-3  # [m] from its start, turns included, that an object that got no farther is said to be blocked


def plan_push(problem: PushProblem, *, seed: int, settings: KinodynamicSettings | None = None) -> KinodynamicResult:
    """Find wrenches, each held for a while, that bring an object to its goal without touching anything.

    The same problem, seed and settings give the same plan, to the bit, unless the time limit is hit.

    Args:
        problem: what is asked.
        seed: of OMPL's generators, above zero.
        settings: of steps, limits and patience.

    Raises:
        PlannerError: the seed is not above zero, the object is faster at the start than it may be, or the goal changes
            its mind. What the goal's callable raises comes through.
    """
    settings = settings or KinodynamicSettings()
    with seeded(seed):
        return _Search(problem, settings).run()


class _Search:
    """One search: what OMPL calls, and what these calls share."""

    def __init__(self, problem: PushProblem, settings: KinodynamicSettings) -> None:
        self.goal = problem.goal
        self._dynamics = PushDynamics(problem, settings)
        self._budget = Budget(settings.iterations, settings.time_limit)
        self._state, self._wrench = np.empty(6), np.zeros(3)
        axes = zip(self._dynamics.axes.tolist(), self._dynamics.limits.tolist(), strict=True)
        self._axes: list[tuple[int, float]] = list(axes)
        self._states, self._farthest = 1, 0.0
        self.target: Array | None = None
        if self.goal.pose is not None:
            pose = origin_to_com(self.goal.pose, problem.model.com)
            self.target = np.array([pose[0], pose[1], wrapped(pose[2]), 0.0, 0.0, 0.0])

    def run(self) -> KinodynamicResult:
        """Search, and put what was found into words."""
        start = self._dynamics.start
        braking = self._at_goal(start)
        if braking is not None:
            return self._result(self._plan(np.zeros((0, 3)), np.zeros(0, dtype=np.int64), braking))
        if not start[3:].any() and self._dynamics.is_stuck():
            x, y, torque = self._dynamics.problem.limits.array
            reason = f"no motion: forces up to ({x:g}, {y:g}) N and {torque:g} N m do not move the object"
            return self._result(None, reason)
        setup = self._setup()
        setup.solve(self._budget.condition())
        if not setup.haveExactSolutionPath():
            return self._result(None, self._why())
        path = setup.getSolutionPath()
        wrenches = np.array([self._read_control(control).copy() for control in path.getControls()])
        step = self._dynamics.settings.control_step
        counts = np.array([round(duration / step) for duration in path.getControlDurations()], dtype=np.int64)
        braking = self._at_goal(self._dynamics.trace(wrenches, counts)[-1])
        if braking is None:  # the replay ends in the same state to the bit
            raise PlannerError("goal: expected one answer for one pose, got yes in the search and no in its replay")
        return self._result(self._plan(wrenches, counts, braking))

    def propagate(self, state: ob.State, control: oc.Control, _: float, result: ob.State) -> None:
        """Simulate one control step; NaN says that it led into something or was too fast."""
        read_state(state, self._state)
        after = self._dynamics.step(self._state, self._read_control(control))
        if after is None:
            result[0].setX(math.nan)
        else:
            write_state(result, after)

    def distance(self, state: ob.State) -> float:
        """Return how far a state is from the goal; 0: it is there, and can come to rest there."""
        self._states += 1
        read_state(state, self._state)
        self._farthest = max(self._farthest, self._away(self._dynamics.start))
        if self._at_goal(self._state) is not None:
            return 0.0
        return UNREACHED if self.target is None else max(self._away(self.target), 2.0 * REACHED)

    def _away(self, other: Array) -> float:
        """Return how far the state at hand is from another, velocities left out [m]."""
        x, y, theta = (self._state - other)[:3].tolist()
        return math.hypot(x, y, self._dynamics.gyration * math.remainder(theta, 2.0 * math.pi))

    def _read_control(self, control: oc.Control) -> Array:
        """Return the wrench (3,) of OMPL's control; overwritten by the next call."""
        for k, (axis, limit) in enumerate(self._axes):
            self._wrench[axis] = limit * control[k]
        return self._wrench

    def _at_goal(self, state: Array) -> Array | None:
        """Return the wrenches (n, 3) that bring a state that meets the goal to rest at it; None where it does not."""
        reached, pose_of = self.goal.reached, self._dynamics.pose
        if not reached(pose_of(state)):
            return None
        if not self._dynamics.settings.come_to_rest:
            return np.zeros((0, 3))
        found = brake(self._dynamics, state)
        if found is None or not (len(found[0]) == 0 or reached(pose_of(found[1]))):
            return None
        return found[0]

    def _plan(self, wrenches: Array, counts: NDArray[np.int64], braking: Array) -> KinodynamicPlan:
        """Return the plan of wrenches (n, 3) held for counts (n,) of control steps, and the braking after them."""
        wrenches = np.vstack((wrenches, braking))
        counts = np.concatenate((counts, np.ones(len(braking), dtype=np.int64)))
        states = self._dynamics.trace(wrenches, counts)
        settings = self._dynamics.settings
        return KinodynamicPlan(
            wrenches,
            np.asarray(counts * settings.control_step, dtype=float),
            settings.dt * np.arange(len(states), dtype=float),
            states,
            com_to_origin(states[:, :3], self._dynamics.problem.model.com),
            self._dynamics.cost(wrenches, counts, states),
        )

    def _result(self, plan: KinodynamicPlan | None, reason: str = "") -> KinodynamicResult:
        budget = self._budget
        return KinodynamicResult(plan, reason, budget.elapsed, budget.used, self._dynamics.propagations, self._states)

    def _why(self) -> str:
        settings = self._dynamics.settings
        effort = f"in {settings.time_limit:g} s" if self._budget.timed_out else f"with {settings.iterations} iterations"
        if self._farthest < BLOCKED:
            return f"no plan found {effort}: each control tried leads into something or is too fast at once"
        return f"no plan found {effort}; there may be one: allow more, or try another seed"

    def _setup(self) -> oc.SimpleSetup:
        settings = self._dynamics.settings
        space = state_space(self._dynamics)
        controls = oc.RealVectorControlSpace(space, len(self._axes))
        controls.setBounds(bounds([(-1.0, 1.0)] * len(self._axes)))
        setup = oc.SimpleSetup(controls)
        information = setup.getSpaceInformation()
        information.setPropagationStepSize(settings.control_step)
        information.setMinMaxControlDuration(settings.shortest, settings.longest)
        setup.setStatePropagator(self.propagate)
        setup.setStateValidityChecker(lambda state: not math.isnan(state[0].getX()))
        first = space.allocState()
        write_state(first, self._dynamics.start)
        setup.setStartState(first)
        setup.setGoal(_PushGoal(information, self))
        planner = oc.RRT(information)
        planner.setGoalBias(0.0 if self.target is None else settings.goal_bias)
        setup.setPlanner(planner)
        return setup


class _PushGoal(ob.GoalSampleableRegion):
    """Tells OMPL which states are good enough, and draws the goal's pose at rest."""

    def __init__(self, information: ob.SpaceInformation, search: _Search) -> None:
        super().__init__(information)
        self._search = search
        self.setThreshold(REACHED)

    def distanceGoal(self, state: ob.State) -> float:  # noqa: N802  the name is OMPL's
        """Return 0 where the goal is met, else how far away it is as far as that is known."""
        return self._search.distance(state)

    def sampleGoal(self, state: ob.State) -> None:  # noqa: N802  the name is OMPL's
        """Write the goal's pose, at rest."""
        assert self._search.target is not None, "without a pose there are no samples"
        write_state(state, self._search.target)

    def maxSampleCount(self) -> int:  # noqa: N802  the name is OMPL's
        """Return that there is one sample, if there is a pose."""
        return 0 if self._search.target is None else 1
