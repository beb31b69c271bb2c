"""Compiled: what one push does to a layout, and the growth of a tree of layouts by pushes (thesis figure 3).

No random draw is made here: what the tree grows towards is handed in.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_planner.tabletop.box_kernel import ball_meets, room_inside, separation

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Flags = NDArray[np.uint8]
TWO_PI = 2.0 * math.pi
LOOKS = 3
"""Poses of a pushed item that are looked at on its way, the last one included."""
SLIDE = 5e-4
"""By which two that touch may come closer while one slides along the other [m]."""
UNTRIED, DEAD = 0, 1


class PushTables(NamedTuple):
    """What pushes do, and the desk that they do it on; k pushes an item.

    Attributes:
        mean: (n, k, 3) displacement in the item's frame [m, m, rad].
        clearance: (n, k) kept free around a pushed item [m].
        paths: (n, k, 4) where the ball's centre begins and ends, x y x y in the item's frame [m].
        radius: of the ball and what is kept free around it [m].
        most: way that a push brings any item, or the ball beyond its middle, at most [m].
        halves: (n, 2) half sides of the items [m].
        fixed: (o, 5) x, y, yaw and half sides of obstacles.
        low, high: (2,) borders of the table [m].
        reach: (4,) x, y of the arm's column, least and most radius of the ball's centre about it [m].
    """

    mean: Array
    clearance: Array
    paths: Array
    radius: float
    most: float
    halves: Array
    fixed: Array
    low: Array
    high: Array
    reach: Array


class Tree(NamedTuple):
    """A tree of layouts; the first `count` rows are in use.

    Attributes:
        layouts: (N, n, 3)
        parent: (N,) row; -1 for the first.
        via: (N,) item times k plus push that led there.
        tried: (N, n * k) whether that push was looked at from there.
        stuck: (N,) whether nothing that is untried there leads nearer to the present goal.
        depth: (N,) pushes from the first.
    """

    layouts: Array
    parent: Index
    via: Index
    tried: Flags
    stuck: Flags
    depth: Index


@njit(**LEAF)
def wrapped(angle: float) -> float:
    """Return an angle in [-pi, pi) [rad]."""
    return angle - TWO_PI * math.floor(angle / TWO_PI + 0.5)


@njit(**LEAF)
def after(pose: Array, mean: Array, share: float, out: Array) -> None:
    """Write where an item is after a share of its displacement."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    out[0] = pose[0] + share * (c * mean[0] - s * mean[1])
    out[1] = pose[1] + share * (s * mean[0] + c * mean[1])
    out[2] = wrapped(pose[2] + share * mean[2])


@njit(**LEAF)
def push_fault(layout: Array, item: int, push: int, tables: PushTables, out: Array) -> int:
    """Push an item: write its pose afterwards, and return what is in the way.

    Returns:
        0: nothing; -1: it would leave the table; -2: the arm does not reach; k + 1: it or the ball would touch item or
        obstacle k.
    """
    pose, mean, reach = layout[item], tables.mean[item, push], tables.reach
    c, s = math.cos(pose[2]), math.sin(pose[2])
    path = tables.paths[item, push]
    px, py = pose[0] + c * path[0] - s * path[1], pose[1] + s * path[0] + c * path[1]
    qx, qy = pose[0] + c * path[2] - s * path[3], pose[1] + s * path[2] + c * path[3]
    for x, y in ((px, py), (qx, qy)):
        square = (x - reach[0]) ** 2 + (y - reach[1]) ** 2
        if square < reach[2] ** 2 or square > reach[3] ** 2:
            return -2
    length, width = tables.halves[item, 0], tables.halves[item, 1]
    room = room_inside(pose[0], pose[1], pose[2], length, width, tables.low, tables.high)
    for look in range(1, LOOKS + 1):
        after(pose, mean, look / LOOKS, out)
        if room_inside(out[0], out[1], out[2], length, width, tables.low, tables.high) < min(0.0, room):
            return -1
    for k in range(len(layout) + len(tables.fixed)):
        if k == item:
            continue
        if k < len(layout):
            ox, oy, ot, ol, ow = layout[k, 0], layout[k, 1], layout[k, 2], tables.halves[k, 0], tables.halves[k, 1]
        else:
            ox, oy, ot, ol, ow = tables.fixed[k - len(layout)]
        far = math.hypot(ol, ow) + math.hypot(length, width) + tables.clearance[item, push] + tables.most
        if (ox - pose[0]) ** 2 + (oy - pose[1]) ** 2 > far * far:
            continue
        if ball_meets(px, py, qx, qy, tables.radius, ox, oy, ot, ol, ow):
            return k + 1
        # Doubt grows with the way; and what stands closer than the clearance may be left, or slid along.
        now = separation(pose[0], pose[1], pose[2], length, width, ox, oy, ot, ol, ow) - SLIDE
        for look in range(1, LOOKS + 1):
            share = look / LOOKS
            after(pose, mean, share, out)
            free = separation(out[0], out[1], out[2], length, width, ox, oy, ot, ol, ow)
            if free < min(share * tables.clearance[item, push], now):
                return k + 1
    after(pose, mean, 1.0, out)
    return 0


@njit(**LEAF)
def apart(a: Array, b: Array, weight: float) -> float:
    """Return the square of the distance (11) of two poses: an angle counts `weight` metres a radian."""
    dx, dy, turn = a[0] - b[0], a[1] - b[1], weight * wrapped(a[2] - b[2])
    return dx * dx + dy * dy + turn * turn


@njit(**LEAF)
def nearest(tree: Tree, count: int, goal: Array, weight: float, skip_stuck: bool) -> tuple[int, float]:
    """Return the row of the layout nearest to another, and its squared distance; -1 where all are stuck."""
    best, least = -1, math.inf
    for row in range(count):
        if skip_stuck and tree.stuck[row] == DEAD:
            continue
        total = 0.0
        for k in range(len(goal)):
            total += apart(tree.layouts[row, k], goal[k], weight)
            if total >= least:
                break
        if total < least:
            best, least = row, total
    return best, least


@njit(cache=True, error_model="numpy")
def extend(tree: Tree, count: int, row: int, goal: Array, weight: float, tables: PushTables) -> int:
    """Add the push from a row that leads nearest to a goal among those that are free and lead nearer.

    Returns:
        The number of rows then; the same as before where there is no such push.
    """
    items, pushes = tables.clearance.shape
    layout = tree.layouts[row]
    gains = np.empty(items * pushes)
    new = np.empty(3)
    for item in range(items):
        here = apart(layout[item], goal[item], weight)
        for push in range(pushes):
            after(layout[item], tables.mean[item, push], 1.0, new)
            gains[item * pushes + push] = here - apart(new, goal[item], weight)
    for _ in range(len(gains)):
        best = int(np.argmax(gains))
        if gains[best] <= 1e-12:
            return count
        gains[best] = -math.inf
        if tree.tried[row, best]:
            continue
        tree.tried[row, best] = 1
        item, push = best // pushes, best % pushes
        if push_fault(layout, item, push, tables, new) == 0:
            tree.layouts[count] = layout
            tree.layouts[count, item] = new
            tree.parent[count], tree.via[count], tree.stuck[count] = row, best, UNTRIED
            tree.depth[count] = tree.depth[row] + 1
            tree.tried[count] = 0
            return count + 1
    return count


@njit(cache=True, error_model="numpy")
def grow(tree: Tree, count: int, samples: Array, weight: float, tables: PushTables) -> int:
    """Extend a tree once towards each of some layouts (s, n, 3), and return the number of rows then."""
    for k in range(len(samples)):
        if count == len(tree.parent):
            break
        row, _ = nearest(tree, count, samples[k], weight, False)
        count = extend(tree, count, row, samples[k], weight, tables)
    return count


@njit(cache=True, error_model="numpy")
def connect(tree: Tree, count: int, goal: Array, weight: float, steps: int, tables: PushTables) -> int:
    """Extend a tree towards one layout, from wherever it is nearest and not stuck, some steps long (RRT-Connect).

    `stuck` belongs to this goal: whoever changes the goal sets it back.

    Returns:
        The number of rows then.
    """
    for _ in range(steps):
        if count == len(tree.parent):
            break
        row, _ = nearest(tree, count, goal, weight, True)
        if row < 0:
            break
        more = extend(tree, count, row, goal, weight, tables)
        if more == count:
            tree.stuck[row] = DEAD
        count = more
    return count


@njit(cache=True, error_model="numpy")
def follow(start: Array, sequence: Index, keep: Flags, tables: PushTables, layout: Array) -> bool:
    """Make pushes one after the other, those that are to be kept, and write the layout then.

    Args:
        start: (n, 3)
        sequence: (m,) item times k plus push.
        keep: (m,)
        tables: see there.
        layout: (n, 3) out.

    Returns:
        Whether all of them were free.
    """
    pushes = tables.clearance.shape[1]
    new = np.empty(3)
    layout[:] = start
    for m in range(len(sequence)):
        if keep[m]:
            item, push = sequence[m] // pushes, sequence[m] % pushes
            if push_fault(layout, item, push, tables, new) != 0:
                return False
            layout[item] = new
    return True


@njit(cache=True, error_model="numpy")
def follow_what_is_free(start: Array, sequence: Index, keep: Flags, tables: PushTables, layout: Array) -> None:
    """Make pushes one after the other, but for those that are not free, and write the layout then.

    Args:
        start: (n, 3)
        sequence: (m,) item times k plus push.
        keep: (m,) out: which were made.
        tables: see there.
        layout: (n, 3) out.
    """
    pushes = tables.clearance.shape[1]
    new = np.empty(3)
    layout[:] = start
    for m in range(len(sequence)):
        item, push = sequence[m] // pushes, sequence[m] % pushes
        keep[m] = push_fault(layout, item, push, tables, new) == 0
        if keep[m]:
            layout[item] = new
