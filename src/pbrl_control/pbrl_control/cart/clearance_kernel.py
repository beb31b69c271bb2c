"""Compiled: how far moving outlines stay from the lethal cells of a grid, and where a body goes before it stands."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]
Byte = NDArray[np.uint8]
Int = NDArray[np.int64]


@njit(**LEAF)
def place(corners: Array, on_cart: Byte, grip: Array, pose: Array, placed: Array) -> None:
    """Write corners (c, 2) at a pose (4,) into `placed` (c, 2) [m]."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    cc, cs = math.cos(pose[3]), math.sin(pose[3])
    for k in range(len(corners)):
        x, y = corners[k, 0], corners[k, 1]
        if on_cart[k]:
            x, y = grip[0] + cc * x - cs * y, grip[1] + cs * x + cc * y
        placed[k, 0], placed[k, 1] = pose[0] + c * x - s * y, pose[1] + s * x + c * y


@njit(**LEAF)
def square_to_segment(x: float, y: float, half: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the squared distance of a segment from a square about x, y that it does not cross."""
    nearest = math.inf
    for k in range(2):
        px, py = (ax, ay) if k == 0 else (bx, by)
        dx, dy = max(abs(px - x) - half, 0.0), max(abs(py - y) - half, 0.0)
        nearest = min(nearest, dx * dx + dy * dy)
    wx, wy = bx - ax, by - ay
    square = wx * wx + wy * wy
    for k in range(4):
        px = x + (half if k & 1 else -half)
        py = y + (half if k & 2 else -half)
        share = ((px - ax) * wx + (py - ay) * wy) / square if square > 0.0 else 0.0
        share = min(max(share, 0.0), 1.0)
        nearest = min(nearest, (ax + share * wx - px) ** 2 + (ay + share * wy - py) ** 2)
    return nearest


@njit(**LEAF)
def square_to_ring(x: float, y: float, half: float, ring: Array) -> float:
    """Return the distance of a square about x, y from a convex outline (k, 2); 0 where they overlap or touch."""
    apart = False
    low_x, high_x, low_y, high_y = math.inf, -math.inf, math.inf, -math.inf
    count = len(ring)
    for k in range(count):
        low_x, high_x = min(low_x, ring[k, 0]), max(high_x, ring[k, 0])
        low_y, high_y = min(low_y, ring[k, 1]), max(high_y, ring[k, 1])
    if low_x > x + half or high_x < x - half or low_y > y + half or high_y < y - half:
        apart = True
    nearest = math.inf
    for k in range(count):
        other = k + 1 if k + 1 < count else 0
        ax, ay, bx, by = ring[k, 0], ring[k, 1], ring[other, 0], ring[other, 1]
        nx, ny = by - ay, ax - bx
        if not apart:
            # Every other corner is on one side of a convex outline's edge: is the whole square on the other?
            least, most = math.inf, -math.inf
            for j in range(count):
                side = nx * (ring[j, 0] - ax) + ny * (ring[j, 1] - ay)
                least, most = min(least, side), max(most, side)
            side = nx * (x - ax) + ny * (y - ay)
            reach = half * (abs(nx) + abs(ny))
            apart = side - reach > most or side + reach < least
        nearest = min(nearest, square_to_segment(x, y, half, ax, ay, bx, by))
    return math.sqrt(nearest) if apart else 0.0


@njit(cache=True)
def outward(ring: Array, sides: Array) -> None:
    """Write the sides (k, 3) of a convex outline (k, 2), whichever way round: unit normal outwards, and its offset."""
    count = len(ring)
    middle_x, middle_y = ring[:, 0].mean(), ring[:, 1].mean()
    for k in range(count):
        other = k + 1 if k + 1 < count else 0
        nx, ny = ring[other, 1] - ring[k, 1], ring[k, 0] - ring[other, 0]
        size = math.hypot(nx, ny)
        if size == 0.0:
            sides[k] = (0.0, 0.0, math.inf)
            continue
        if nx * (middle_x - ring[k, 0]) + ny * (middle_y - ring[k, 1]) > 0.0:
            nx, ny = -nx, -ny
        nx, ny = nx / size, ny / size
        sides[k] = (nx, ny, nx * ring[k, 0] + ny * ring[k, 1])


@njit(cache=True)
def shore_cells(cells: Byte, box: Int, most: int) -> tuple[Int, Int]:
    """Return where each row's shore cells begin (r + 1,), and the columns of all of them, in order.

    A shore cell is taken, and one beside it is not: other taken cells are nearest to nothing that is not inside them.

    Args:
        cells: (rows, columns) costs.
        box: (4,) first row, row after the last, first column, column after the last to look at.
        most: cost up to which a cell is taken, from 254 on.
    """
    rows, columns = cells.shape
    first = np.zeros(box[1] - box[0] + 1, dtype=np.int64)
    found = np.empty((box[1] - box[0]) * (box[3] - box[2]), dtype=np.int64)
    at = 0
    for i in range(box[0], box[1]):
        inner = 0 < i < rows - 1
        for j in range(box[2], box[3]):
            if cells[i, j] < 254 or cells[i, j] > most:
                continue
            if inner and 0 < j < columns - 1:
                low = min(min(cells[i - 1, j], cells[i + 1, j]), min(cells[i, j - 1], cells[i, j + 1]))
                high = max(max(cells[i - 1, j], cells[i + 1, j]), max(cells[i, j - 1], cells[i, j + 1]))
                if low >= 254 and high <= most:
                    continue
            found[at] = j
            at += 1
        first[i - box[0] + 1] = at
    return first, found[:at]


@njit(cache=True)
def covered(
    poses: Array, corners: Array, on_cart: Byte, grip: Array, far: float, low: Array, resolution: float, shape: Int
) -> Int:
    """Return the cells (4,) that matter to a body at poses: first row, row after the last, the same of columns.

    Args:
        poses: (n, 4).
        corners: (c, 2) of the body [m].
        on_cart: (c,) whose frame each is in.
        grip: (2,) where the cart turns [m].
        far: about the body [m].
        low: (2,) lowest x and y of the grid [m].
        resolution: of a cell [m].
        shape: (2,) rows and columns of the grid.
    """
    placed = np.empty_like(corners)
    least, most = np.full(2, math.inf), np.full(2, -math.inf)
    for k in range(len(poses)):
        place(corners, on_cart, grip, poses[k], placed)
        for c in range(len(corners)):
            for axis in range(2):
                least[axis] = min(least[axis], placed[c, axis])
                most[axis] = max(most[axis], placed[c, axis])
    box = np.empty(4, dtype=np.int64)
    for axis in range(2):
        # Clipped as numbers: what is far outside would not fit into a whole one.
        begin = (least[1 - axis] - far - low[1 - axis]) / resolution
        end = (most[1 - axis] + far - low[1 - axis]) / resolution + 1.0
        box[2 * axis] = math.floor(min(max(begin, 0.0), shape[axis]))
        box[2 * axis + 1] = math.floor(min(max(end, box[2 * axis]), shape[axis]))
    return box


@njit(cache=True)
def ring_clearance(
    ring: Array,
    far: float,
    enough: float,
    first: Int,
    columns: Int,
    top: int,
    resolution: float,
    left: float,
    bottom: float,
) -> float:
    """Return how far a convex outline (k, 2) is from shore cells, at most `far`; below `enough` any will do.

    Args:
        ring: [m].
        far: distance beyond which nothing matters [m].
        enough: distance from which on less is as bad [m].
        first: by `shore_cells`.
        columns: the same.
        top: row that `first` begins with.
        resolution: of a cell [m].
        left: lowest x of the grid [m].
        bottom: lowest y of it [m].
    """
    if len(columns) == 0:
        return far
    begin_j = math.floor((ring[:, 0].min() - far - left) / resolution)
    end_j = math.floor((ring[:, 0].max() + far - left) / resolution) + 1
    begin_i = math.floor((ring[:, 1].min() - far - bottom) / resolution)
    end_i = math.floor((ring[:, 1].max() + far - bottom) / resolution) + 1
    nearest = far
    half = 0.5 * resolution
    sides = np.empty((len(ring), 3))
    outward(ring, sides)
    for i in range(max(begin_i, top), min(end_i, top + len(first) - 1)):
        for at in range(first[i - top], first[i - top + 1]):
            j = columns[at]
            if j < begin_j:
                continue
            if j >= end_j:
                break
            x, y = left + (j + 0.5) * resolution, bottom + (i + 0.5) * resolution
            # Beyond one side by so much it cannot be nearer: most cells of a wall are settled by that.
            beyond = -math.inf
            for k in range(len(ring)):
                beyond = max(beyond, sides[k, 0] * x + sides[k, 1] * y - sides[k, 2])
            if beyond - half * math.sqrt(2.0) >= nearest:
                continue
            nearest = min(nearest, square_to_ring(x, y, half, ring))
            if nearest <= enough:
                return nearest
    return nearest


@njit(cache=True)
def inside_by(ring: Array, left: float, bottom: float, right: float, top: float) -> float:
    """Return how far an outline (k, 2) is from the border of the box that it is in; 0 where it is not [m]."""
    x = min(ring[:, 0].min() - left, right - ring[:, 0].max())
    y = min(ring[:, 1].min() - bottom, top - ring[:, 1].max())
    return max(min(x, y), 0.0)


@njit(cache=True)
def path_clearance(
    poses: Array,
    corners: Array,
    on_cart: Byte,
    first: Int,
    grip: Array,
    far: float,
    enough: float,
    cells: Byte,
    resolution: float,
    left: float,
    bottom: float,
    closed: bool,
    found: Array,
) -> int:
    """Write how far a body is from lethal cells at poses (n, 4), up to the first that is as near as `enough`.

    Args:
        poses: x, y, heading, articulation.
        corners: (c, 2) of the body, see `CartBody` [m].
        on_cart: (c,) whose frame each is in.
        first: (p + 1,) where each piece begins.
        grip: (2,) where the cart turns [m].
        far: distance beyond which nothing matters [m].
        enough: distance from which on less is as bad [m].
        cells: (rows, columns) costs.
        resolution: of a cell [m].
        left: lowest x of the grid [m].
        bottom: lowest y of it [m].
        closed: whether unknown cells count, and what is outside of the grid.
        found: (n,) out [m]; beyond the first that is too near: `far`.

    Returns:
        The number of that pose; n if there is none.
    """
    rows, columns = cells.shape
    most = 255 if closed else 254
    box = covered(poses, corners, on_cart, grip, far, np.array([left, bottom]), resolution, np.array([rows, columns]))
    starts, shore = shore_cells(cells, box, most)
    right, upper = left + columns * resolution, bottom + rows * resolution
    placed = np.empty_like(corners)
    found[:] = far
    for k in range(len(poses)):
        place(corners, on_cart, grip, poses[k], placed)
        for p in range(len(first) - 1):
            ring = placed[first[p] : first[p + 1]]
            near = ring_clearance(ring, found[k], enough, starts, shore, box[0], resolution, left, bottom)
            # All of it inside of what is taken: no shore is near.
            i, j = math.floor((ring[0, 1] - bottom) / resolution), math.floor((ring[0, 0] - left) / resolution)
            if 0 <= i < rows and 0 <= j < columns and 254 <= cells[i, j] <= most:
                near = 0.0
            if closed:
                near = min(near, inside_by(ring, left, bottom, right, upper))
            found[k] = min(found[k], near)
            if near <= enough:
                return k
    return len(poses)


@njit(cache=True)
def roll_out(pose: Array, rates: Array, hold: float, braking: Array, reach: Array, most: float, poses: Array) -> int:
    """Write where a body goes that keeps its rates for a while and then brakes; return how many poses that is.

    Args:
        pose: (4,) x, y, heading, articulation at the beginning.
        rates: (4,) forward, left, turning, articulation, in the robot's axes.
        hold: [s] before it brakes.
        braking: (3,) of translation, turning, articulation.
        reach: (2,) of corners from the base's centre, and of the cart's from the grip [m].
        most: that a corner moves between two poses [m], unless there is no room for so many.
        poses: (n, 4) out.
    """
    speed = math.hypot(rates[0], rates[1])
    ends = np.array([speed, abs(rates[2]), abs(rates[3])]) / braking
    last = hold + ends.max()
    fastest = speed + reach[0] * abs(rates[2]) + reach[1] * abs(rates[3])
    count = min(max(math.ceil(fastest * last / most), 1), len(poses) - 1)
    dt = last / count
    x, y, heading, articulation = pose
    poses[0] = pose
    for k in range(count):
        middle = max((k + 0.5) * dt - hold, 0.0)
        go = max(1.0 - middle / ends[0], 0.0) if ends[0] > 0.0 else 0.0
        turn = max(1.0 - middle / ends[1], 0.0) * rates[2] if ends[1] > 0.0 else 0.0
        bend = max(1.0 - middle / ends[2], 0.0) * rates[3] if ends[2] > 0.0 else 0.0
        c, s = math.cos(heading + 0.5 * turn * dt), math.sin(heading + 0.5 * turn * dt)
        x += go * dt * (c * rates[0] - s * rates[1])
        y += go * dt * (s * rates[0] + c * rates[1])
        heading += turn * dt
        articulation += bend * dt
        poses[k + 1] = (x, y, heading, articulation)
    return count + 1
