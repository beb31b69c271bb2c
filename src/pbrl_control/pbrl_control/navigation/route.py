"""A path of the base to a pose, by OMPL.

A differential base turns in place, so a path is a polyline: OMPL's RRT* (Karaman and Frazzoli 2011) plans
its corners in the plane, where the robot can turn all the way round, and its legs are checked as exact swept
polygons, so the robot passes gaps as wide as itself and not as wide as its turning circle. What RRT* leaves
crooked is straightened afterwards. A start or goal too close to something to turn there, as in front of a
table after a grasp, is left and reached straight, with as little turning on the spot as there is room for.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from pbrl_control.errors import ControlError
from pbrl_control.navigation.grid_route import grid_path
from pbrl_control.navigation.motion import MotionChecker
from pbrl_control.navigation.path import BasePath, Leg
from pbrl_control.planar import Array, wrap

SAMPLES = (600, 1200, 2400)  # of RRT*, in turns, until there is a path
STRAIGHTEN_STEP = 0.25  # [m] between the points that straightening may put corners at
CORNER_COST = 0.05  # [m] that a corner has to save to be worth the stop
EXIT_STEP, EXIT_MOST = 0.05, 1.5  # [m] straight ways out of where the robot cannot turn all the way round
EXIT_TURN = math.radians(10.0)  # between the headings at which such ways are looked for
REVERSE_MOST = 1.0  # [m] that the base drives backwards to spare two half turns
SAME = 1e-6  # [m]


@dataclass(frozen=True)
class RouteResult:
    """A path, or why there is none.

    Attributes:
        path: None where there is none.
        reason: one line; empty where there is a path.
        exhausted: a search used up its samples or its time: there may be a path, and looking was dear.
    """

    path: BasePath | None
    reason: str = ""
    exhausted: bool = False


def plan_route(
    checker: MotionChecker, start: Array, goal: Array, *, seed: int, time_limit: float = 5.0, narrow: bool = False
) -> RouteResult:
    """Find a short path of the base between two poses (3,) in `world` [m, rad].

    The start needs only to be free of collision; everything else keeps the checker's margin.

    Args:
        checker: robot, map and margin.
        start: where the base is.
        goal: where it is to be, reached exactly.
        seed: of OMPL's generator, positive. The same seed gives the same path, unless the time limit is hit.
        time_limit: [s] of the sampling.
        narrow: the room is full: look at every place and heading of a grid first (see `grid_path`), and only then
            at samples.

    Raises:
        ControlError: the seed or the time limit is not positive.
    """
    if seed <= 0 or not time_limit > 0.0:
        raise ControlError(f"route: expected a positive seed and time limit, got {seed} and {time_limit} s")
    start, goal = np.asarray(start, dtype=float), np.asarray(goal, dtype=float)
    fault = _pose_fault("start", start, checker.bare()) or _pose_fault("goal", goal, checker)
    if fault:
        return RouteResult(None, fault)
    direct = _direct(checker, start, goal)
    if direct is not None:
        return RouteResult(direct)
    if narrow:
        way = grid_path(checker, start, goal)
        if way is not None:
            return RouteResult(way)
    return _sampled(checker, start, goal, seed, time_limit)


def _sampled(checker: MotionChecker, start: Array, goal: Array, seed: int, time_limit: float) -> RouteResult:
    """Return a path whose corners are sampled where the robot can turn all the way round."""
    out, back = _stage(checker.bare(), checker, start), _stage(checker, checker, goal)
    for name, stage in (("start", out), ("goal", back)):
        if stage is None:
            return RouteResult(None, f"{name}: no room to turn there, nor within {EXIT_MOST} m of straight driving")
    assert out is not None and back is not None
    if not checker.connected(out[0], back[0]):
        return RouteResult(None, "no path: every gap between start and goal is narrower than the robot")
    corners = _corners(checker, out[0], back[0], seed, time_limit)
    if corners is None:
        reason = f"no path found with {sum(SAMPLES)} samples or in {time_limit} s"
        return RouteResult(None, reason, exhausted=True)
    legs = [Leg(a, b) for a, b in pairwise(corners)]
    legs = [Leg(start[:2], out[0], out[1] < 0.0), *legs, Leg(back[0], goal[:2], back[1] > 0.0)]
    return RouteResult(BasePath(start, goal, tuple(leg for leg in legs if leg.length > SAME)))


def _pose_fault(name: str, pose: Array, checker: MotionChecker) -> str:
    if pose.shape != (3,) or not np.isfinite(pose).all():
        return f"{name}: expected a finite pose (x, y, theta), got {pose}"
    fault = checker.pose_fault(pose)
    return f"{name}: the robot would be in {fault}" if fault else ""


def _direct(checker: MotionChecker, start: Array, goal: Array) -> BasePath | None:
    """Return the straight drive, backwards where that spares a lot of turning; None where it is not free."""
    a, b = start[:2], goal[:2]
    ways = [BasePath(start, goal, ())]
    if np.hypot(*(b - a)) > SAME:
        back = np.hypot(*(b - a)) <= REVERSE_MOST
        ways = [BasePath(start, goal, (Leg(a, b, reverse),)) for reverse in ((False, True) if back else (False,))]
    free = [way for way in ways if _direct_free(checker, way)]
    return min(free, key=lambda way: way.turning, default=None)


def _direct_free(checker: MotionChecker, path: BasePath) -> bool:
    """Say whether the turns at both ends and the leg between them are free."""
    heading = path.legs[0].heading if path.legs else float(path.goal[2])
    leaves = abs(wrap(heading - path.start[2])) < SAME
    arrives = abs(wrap(heading - path.goal[2])) < SAME
    tight = checker.bare() if leaves else checker
    if not all(tight.can_drive(leg.start, leg.end, reverse=leg.reverse) for leg in path.legs):
        return False
    turns = ((leaves, path.start[:2], path.start[2], heading), (arrives, path.goal[:2], heading, path.goal[2]))
    return all(
        spared or checker.can_turn(*point) or checker.can_swing(point, start, end)
        for spared, point, start, end in turns
    )


def _stage(driver: MotionChecker, turner: MotionChecker, pose: Array) -> tuple[Array, float] | None:
    """Return the nearest point (2,) straight ahead or behind where the robot can turn, and how far ahead it is [m].

    Where there is none on the pose's own line, the robot turns a little on the spot first (or last).
    """
    distances = np.arange(0.0, EXIT_MOST + 1e-9, EXIT_STEP)
    turns = np.arange(0.0, math.pi, EXIT_TURN)
    for turn in sorted([*-turns, *turns[1:]], key=abs):
        heading = float(pose[2] + turn)
        if turn != 0.0 and not driver.can_swing(pose[:2], float(pose[2]), heading):
            continue
        ahead = np.array([math.cos(heading), math.sin(heading)])
        for distance in sorted([*-distances, *distances[1:]], key=abs):
            point = pose[:2] + distance * ahead
            if turner.can_turn(*point) and driver.drive_fault(pose[:2], point, heading) == "":
                return point, float(distance)
    return None


def _corners(checker: MotionChecker, start: Array, goal: Array, seed: int, time_limit: float) -> list[Array] | None:
    """Return the corners of a short free polyline, ends included; None where none was found."""
    if np.hypot(*(goal - start)) <= SAME or checker.can_drive(start, goal):
        return [start, goal]
    corners = _sample(checker, start, goal, seed, time_limit)
    return None if corners is None else _straighten(checker, _straighten(checker, corners))


class _SweptPolygon(ob.MotionValidator):
    """Tells OMPL which straight drives are free, both ways: RRT* turns its edges round as it rewires its tree."""

    def __init__(self, information: ob.SpaceInformation, checker: MotionChecker) -> None:
        super().__init__(information)
        self._checker = checker

    def checkMotion(self, a: ob.State, b: ob.State) -> bool:  # noqa: N802  the name is OMPL's
        """Say whether the drives from state a to state b and back are free."""
        first, last = np.array([a[0], a[1]]), np.array([b[0], b[1]])
        return self._checker.can_drive(first, last) and self._checker.can_drive(last, first)


def _sample(checker: MotionChecker, start: Array, goal: Array, seed: int, time_limit: float) -> list[Array] | None:
    """Run RRT* until it has a path or has used up its samples."""
    level = ou.getLogLevel()
    ou.setLogLevel(ou.LogLevel.LOG_NONE)  # OMPL warns of a second seed; it does start anew from it
    try:
        ou.RNG.setSeed(seed)
        setup = _setup(checker, start, goal)
        end = time.monotonic() + time_limit
        for samples in SAMPLES:
            countdown = iter(range(samples))
            stop = ob.PlannerTerminationCondition(lambda left=countdown: next(left, None) is None)
            setup.solve(ob.plannerOrTerminationCondition(stop, ob.PlannerTerminationCondition(_past(end))))
            if setup.haveExactSolutionPath():
                return [np.array([state[0], state[1]]) for state in setup.getSolutionPath().getStates()]
            if time.monotonic() >= end:
                return None
        return None
    finally:
        ou.setLogLevel(level)


def _past(end: float) -> Callable[[], bool]:
    return lambda: time.monotonic() >= end


def _setup(checker: MotionChecker, start: Array, goal: Array) -> og.SimpleSetup:
    space = ob.RealVectorStateSpace(2)
    bounds = ob.RealVectorBounds(2)
    for axis, (low, high) in enumerate(np.reshape(checker.floor.room.bounds, (2, 2)).T):
        bounds.setLow(axis, float(low))
        bounds.setHigh(axis, float(high))
    space.setBounds(bounds)
    setup = og.SimpleSetup(space)
    information = setup.getSpaceInformation()
    setup.setStateValidityChecker(lambda state: checker.can_turn(state[0], state[1]))
    information.setMotionValidator(_SweptPolygon(information, checker))
    ends = []
    for point in (start, goal):
        state = space.allocState()
        state[0], state[1] = map(float, point)
        ends.append(state)
    setup.setStartAndGoalStates(*ends)
    setup.setOptimizationObjective(ob.PathLengthOptimizationObjective(information))
    setup.setPlanner(og.RRTstar(information))
    return setup


def _straighten(checker: MotionChecker, corners: list[Array]) -> list[Array]:
    """Return the shortest polyline over points of the given one, a corner costing a little."""
    points = [corners[0]]
    for a, b in pairwise(corners):
        shares = np.linspace(0.0, 1.0, max(int(np.ceil(np.hypot(*(b - a)) / STRAIGHTEN_STEP)), 1) + 1)[1:-1]
        points += [point for point in (a + share * (b - a) for share in shares) if checker.can_turn(*point)]
        points.append(b)
    cost, before = np.full(len(points), np.inf), np.zeros(len(points), dtype=int)
    cost[0] = 0.0
    for j in range(1, len(points)):
        for i in range(j):
            reached = cost[i] + CORNER_COST + float(np.hypot(*(points[j] - points[i])))
            if reached < cost[j] and checker.can_drive(points[i], points[j]):
                cost[j], before[j] = reached, i
    kept = [len(points) - 1]
    while kept[-1] != 0:
        kept.append(int(before[kept[-1]]))
    return [points[i] for i in reversed(kept)]
