"""A* over poses of one body, compiled: successors from tables of motions, collisions by separating axes.

A node is a cell of a grid over (x, y, theta) and holds the one continuous pose with which it was reached most cheaply.
A pose that meets the goal is a node of its own, so that a goal smaller than a cell is not missed. Arrays in, caller's
buffers out; `planning.py` makes them and says what the status codes mean.
"""

from __future__ import annotations

import heapq
import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

FOUND, EXHAUSTED, OUT_OF_BUDGET = range(3)
NONE = -1
TWO_PI = 2.0 * math.pi


@njit(**LEAF)
def separated(a: Array, count_a: int, b: Array, count_b: int, margin: float) -> bool:
    """Tell whether an edge of either convex polygon (k, 2) separates the two by `margin` [m] or more.

    Corners are counter-clockwise; two corners are a segment. Never true where the distance is below the margin; not
    always where it is above, corner to corner.
    """
    for side in range(2):
        p, count_p, q, count_q = (a, count_a, b, count_b) if side == 0 else (b, count_b, a, count_a)
        for i in range(count_p):
            j = i + 1 if i + 1 < count_p else 0
            nx, ny = p[j, 1] - p[i, 1], p[i, 0] - p[j, 0]
            least = math.inf
            for k in range(count_q):
                least = min(least, nx * (q[k, 0] - p[i, 0]) + ny * (q[k, 1] - p[i, 1]))
            if least >= margin * math.sqrt(nx * nx + ny * ny):
                return True
    return False


@njit(**LEAF)
def stands_free(
    x: float,
    y: float,
    theta: float,
    parts: Array,
    counts: Integers,
    radius: float,
    obstacles: Array,
    obstacle_counts: Integers,
    middles: Array,
    radii: Array,
    margin: float,
    scratch: Array,
) -> bool:
    """Tell whether a body at a pose keeps `margin` [m] from every obstacle.

    Args:
        x: [m].
        y: [m].
        theta: [rad].
        parts: (P, V, 2) convex pieces of the footprint about the centre of mass.
        counts: (P,) corners of each.
        radius: of the circle about the centre of mass that holds the footprint [m].
        obstacles: (O, W, 2) convex pieces in world.
        obstacle_counts: (O,) corners of each.
        middles: (O, 2) of circles that hold the obstacles.
        radii: (O,) of those circles.
        margin: [m].
        scratch: (P, V, 2).
    """
    c, s = math.cos(theta), math.sin(theta)
    placed = False
    for o in range(obstacle_counts.size):
        reach = radius + radii[o] + margin
        dx, dy = middles[o, 0] - x, middles[o, 1] - y
        if dx * dx + dy * dy > reach * reach:
            continue
        if not placed:
            for p in range(counts.size):
                for k in range(counts[p]):
                    scratch[p, k, 0] = x + c * parts[p, k, 0] - s * parts[p, k, 1]
                    scratch[p, k, 1] = y + s * parts[p, k, 0] + c * parts[p, k, 1]
            placed = True
        for p in range(counts.size):
            if not separated(scratch[p], counts[p], obstacles[o], obstacle_counts[o], margin):
                return False
    return True


@njit(**LEAF)
def sectors_in_contact(
    x: float, y: float, theta: float, rays: Array, reach: float, obstacles: Array, obstacle_counts: Integers
) -> int:
    """Return which sectors of a body's outline have an obstacle within reach, as bits (thesis section 5.2.1).

    Args:
        x: [m].
        y: [m].
        theta: [rad].
        rays: (sectors, tests, 4) origin on the outline and unit direction outwards, in the body's frame.
        reach: length of the rays [m], the collision radius.
        obstacles: (O, W, 2).
        obstacle_counts: (O,).
    """
    c, s = math.cos(theta), math.sin(theta)
    condition = 0
    for sector in range(rays.shape[0]):
        hit = False
        for ray in range(rays.shape[1]):
            ox = x + c * rays[sector, ray, 0] - s * rays[sector, ray, 1]
            oy = y + s * rays[sector, ray, 0] + c * rays[sector, ray, 1]
            dx = (c * rays[sector, ray, 2] - s * rays[sector, ray, 3]) * reach
            dy = (s * rays[sector, ray, 2] + c * rays[sector, ray, 3]) * reach
            for o in range(obstacle_counts.size):
                if crosses(ox, oy, dx, dy, obstacles[o], obstacle_counts[o]):
                    hit = True
                    break
            if hit:
                break
        if hit:
            condition |= 1 << sector
    return condition


@njit(**LEAF)
def crosses(ox: float, oy: float, dx: float, dy: float, polygon: Array, count: int) -> bool:
    """Tell whether the segment from o to o + d meets an edge of a polygon (k, 2)."""
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        ex, ey = polygon[j, 0] - polygon[i, 0], polygon[j, 1] - polygon[i, 1]
        wx, wy = polygon[i, 0] - ox, polygon[i, 1] - oy
        cross = dx * ey - dy * ex
        if cross == 0.0:
            continue
        along, across = (wx * ey - wy * ex) / cross, (wx * dy - wy * dx) / cross
        if 0.0 <= along <= 1.0 and 0.0 <= across <= 1.0:
            return True
    return False


@njit(**LEAF)
def to_go(
    x: float, y: float, theta: float, goal: Array, field: Array, cell: Array, origin: Array, reach: float, turn: float
) -> float:
    """Return the heuristic: the larger of the way over the reach of an action and the turn over that of one.

    Args:
        x: [m].
        y: [m].
        theta: [rad].
        goal: (5,) x, y, heading or NaN, tolerances [m], [rad].
        field: (nx, ny) way to the goal round the walls [m]; zeros: as the crow flies.
        cell: (2,) sides of a cell [m], [rad].
        origin: (2,) lower corner of the grid [m].
        reach: most metres that a unit of cost can bring.
        turn: most radians.
    """
    i, j = int((x - origin[0]) / cell[0]), int((y - origin[1]) / cell[0])
    # The field's number is that of the cell's middle, the pose is somewhere in the cell.
    way = max(math.hypot(goal[0] - x, goal[1] - y), field[i, j] - cell[0])
    rest = max(way - goal[3], 0.0) / reach
    if not math.isnan(goal[2]):
        difference = theta - goal[2]
        difference -= TWO_PI * math.floor(difference / TWO_PI + 0.5)
        rest = max(rest, max(abs(difference) - goal[4], 0.0) / turn)
    return rest


@njit(cache=True, error_model="numpy", nogil=True)
def search(
    start: Array,
    goal: Array,
    table: Array,
    cost: Array,
    parts: Array,
    counts: Integers,
    radius: float,
    obstacles: Array,
    obstacle_counts: Integers,
    middles: Array,
    radii: Array,
    margin: float,
    knows_walls: bool,
    rays: Array,
    ray_reach: float,
    field: Array,
    origin: Array,
    cell: Array,
    reach: float,
    turn: float,
    weight: float,
    budget: int,
    node_cost: Array,
    node_pose: Array,
    node_parent: Integers,
    node_action: Integers,
) -> tuple[int, int, int]:
    """Search; the last four arguments are written.

    Args:
        start: (3,) pose.
        goal: (5,) as in `to_go`.
        table: (C, A, S, 3) poses on the way of each action, in the body's axes at its start, by contact condition.
        cost: (A,) of each action, above zero.
        parts: as in `stands_free`, like the next seven.
        counts: see `parts`.
        radius: see `parts`.
        obstacles: see `parts`.
        obstacle_counts: see `parts`.
        middles: see `parts`.
        radii: see `parts`.
        margin: see `parts`.
        knows_walls: False: motions go through obstacles, as a model without contact has it.
        rays: as in `sectors_in_contact`; used where the table has more than one condition.
        ray_reach: see `rays`.
        field: as in `to_go`, like the next five.
        origin: see `field`.
        cell: see `field`.
        reach: see `field`.
        turn: see `field`.
        weight: of the heuristic; 1: the cheapest plan.
        budget: nodes that may be expanded.
        node_cost: (nx, ny, nt) infinity everywhere, then one more for the goal: flat.
        node_pose: (n, 3).
        node_parent: (n,).
        node_action: (n,).

    Returns:
        Status, the goal's node or the one that came nearest, nodes expanded.
    """
    nx, ny, turns = field.shape[0], field.shape[1], round(TWO_PI / cell[1])
    last = node_cost.size - 1
    closed = np.zeros(node_cost.size, dtype=np.bool_)
    scratch = np.empty_like(parts)
    first = cell_of(start[0], start[1], start[2], origin, cell, nx, ny, turns)
    if first == NONE:
        return EXHAUSTED, NONE, 0
    node_cost[first] = 0.0
    node_pose[first] = start
    node_parent[first] = NONE
    guess = to_go(start[0], start[1], start[2], goal, field, cell, origin, reach, turn)
    heap = [(weight * guess, 0.0, first)]
    best, least, expanded = first, guess, 0
    while len(heap) > 0:
        _, _, node = heapq.heappop(heap)
        if closed[node]:
            continue
        closed[node] = True
        if node == last:
            return FOUND, last, expanded
        if expanded >= budget:
            return OUT_OF_BUDGET, best, expanded
        expanded += 1
        x, y, theta = node_pose[node, 0], node_pose[node, 1], node_pose[node, 2]
        guess = to_go(x, y, theta, goal, field, cell, origin, reach, turn)
        if guess < least:
            best, least = node, guess
        condition = 0
        if table.shape[0] > 1:
            condition = sectors_in_contact(x, y, theta, rays, ray_reach, obstacles, obstacle_counts)
        c, s = math.cos(theta), math.sin(theta)
        for action in range(table.shape[1]):
            free = True
            px = py = pt = 0.0
            for sample in range(table.shape[2]):
                dx, dy = table[condition, action, sample, 0], table[condition, action, sample, 1]
                px, py = x + c * dx - s * dy, y + s * dx + c * dy
                pt = theta + table[condition, action, sample, 2]
                if knows_walls and not stands_free(
                    px, py, pt, parts, counts, radius, obstacles, obstacle_counts, middles, radii, margin, scratch
                ):
                    free = False
                    break
            if not free:
                continue
            other = cell_of(px, py, pt, origin, cell, nx, ny, turns)
            if other == NONE:
                continue
            if at_goal(px, py, pt, goal):
                other = last
            total = node_cost[node] + cost[action]
            if closed[other] or total >= node_cost[other]:
                continue
            rest = 0.0 if other == last else to_go(px, py, pt, goal, field, cell, origin, reach, turn)
            if math.isinf(rest):
                continue
            node_cost[other] = total
            node_pose[other, 0], node_pose[other, 1], node_pose[other, 2] = px, py, pt
            node_parent[other] = node
            node_action[other] = action
            heapq.heappush(heap, (total + weight * rest, -total, other))
    return EXHAUSTED, best, expanded


@njit(**LEAF)
def at_goal(x: float, y: float, theta: float, goal: Array) -> bool:
    """Tell whether a pose is within the goal's tolerances."""
    if math.hypot(goal[0] - x, goal[1] - y) > goal[3]:
        return False
    if math.isnan(goal[2]):
        return True
    difference = theta - goal[2]
    return abs(difference - TWO_PI * math.floor(difference / TWO_PI + 0.5)) <= goal[4]


@njit(**LEAF)
def cell_of(x: float, y: float, theta: float, origin: Array, cell: Array, nx: int, ny: int, turns: int) -> int:
    """Return the flat index of a pose's cell, or NONE outside the grid."""
    i, j = math.floor((x - origin[0]) / cell[0]), math.floor((y - origin[1]) / cell[0])
    if i < 0 or j < 0 or i >= nx or j >= ny:
        return NONE
    k = math.floor(theta / cell[1] + 0.5) % turns
    return (i * ny + j) * turns + k
