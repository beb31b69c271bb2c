"""OMPL's probabilistic roadmap over milestones that are told, in the exact free space (Kavraki et al. 1996).

OMPL draws no samples of its own here: it asks a sampler, and that hands out our milestones, grasps among them. Measured
with 80 obstacles, it takes 0.12 ms a milestone, as long as testing all edges at once in our own loop would.
"""

from __future__ import annotations

import numpy as np
import shapely
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from pbrl_control.planar import Array
from pbrl_namo.regions.free_space import FreeSpace, Indices


class _Handing(ob.ValidStateSampler):
    """Hands out points (n, 2) one after the other."""

    def __init__(self, information: ob.SpaceInformation, points: Array) -> None:
        super().__init__(information)
        self._points, self.next = points, 0

    def sample(self, state: ob.State) -> bool:
        """Set a state to the next point; say whether there was one."""
        if self.next >= len(self._points):
            return False
        state[0], state[1] = map(float, self._points[self.next])
        self.next += 1
        return True


class _InFreeSpace(ob.MotionValidator):
    """Tells OMPL which straight drives of the disc stay in the free space."""

    def __init__(self, information: ob.SpaceInformation, area: shapely.MultiPolygon) -> None:
        super().__init__(information)
        self._area = area

    def checkMotion(self, a: ob.State, b: ob.State) -> bool:  # noqa: N802  the name is OMPL's
        """Say whether the disc can drive straight between two states."""
        return bool(shapely.covers(self._area, shapely.linestrings([[a[0], a[1]], [b[0], b[1]]])))


def connect_milestones(free: FreeSpace, points: Array, order: Indices, neighbours: int) -> Indices:
    """Connect milestones to those near them.

    Args:
        free: the free space.
        points: milestones (n, 2) in it [m].
        order: (n,) in which they are put into the roadmap; each is connected to those there already.
        neighbours: how many of those each is tried with.

    Returns:
        Edges (m, 2) between milestones, each once, sorted.
    """
    if len(points) < 2:
        return np.zeros((0, 2), dtype=np.int64)
    level = ou.getLogLevel()
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    try:
        return _grow(free, points, order, neighbours)
    finally:
        ou.setLogLevel(level)


def _grow(free: FreeSpace, points: Array, order: Indices, neighbours: int) -> Indices:
    """Let OMPL's PRM take all milestones, and read its edges."""
    area = shapely.MultiPolygon(free.regions)
    shapely.prepare(area)
    space = ob.RealVectorStateSpace(2)
    bounds = ob.RealVectorBounds(2)
    for axis in range(2):
        bounds.setLow(axis, float(points[:, axis].min()))
        bounds.setHigh(axis, float(points[:, axis].max()))
    space.setBounds(bounds)
    setup = og.SimpleSetup(space)
    information = setup.getSpaceInformation()
    setup.setStateValidityChecker(lambda _: True)  # milestones are in the free space already
    information.setMotionValidator(_InFreeSpace(information, area))
    handing = _Handing(information, points[order])
    information.setValidStateSamplerAllocator(lambda _: handing)
    ends = [space.allocState(), space.allocState()]
    for state, point in zip(ends, points[:2], strict=True):  # nobody asks for a path, but OMPL wants to have ends
        state[0], state[1] = map(float, point)
    setup.setStartAndGoalStates(*ends)
    planner = og.PRM(information)
    planner.setMaxNearestNeighbors(neighbours)
    setup.setPlanner(planner)
    setup.setup()
    planner.growRoadmapPtc(ob.PlannerTerminationCondition(lambda: handing.next >= len(points)))
    return _edges(planner, information, points)


def _edges(planner: og.PRM, information: ob.SpaceInformation, points: Array) -> Indices:
    """Return the edges (m, 2) of a roadmap, by the numbers that its states have among our points (n, 2)."""
    data = ob.PlannerData(information)
    planner.getPlannerData(data)
    number = {point: index for index, point in enumerate(map(tuple, points.tolist()))}
    states = (data.getVertex(vertex).getState() for vertex in range(data.numVertices()))
    names = [number[state[0], state[1]] for state in states]
    pairs = [(names[vertex], names[other]) for vertex in range(len(names)) for other in data.getEdges(vertex)]
    return np.unique(np.sort(np.array(pairs, dtype=np.int64).reshape(-1, 2), axis=1), axis=0)
