"""Compiled: beams through cells, and what is believed of cells after a scan."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]
Byte = NDArray[np.uint8]
Int = NDArray[np.int64]
PASSED, HIT = 1, 2


@njit(**LEAF)
def pass_through(ax: float, ay: float, bx: float, by: float, touched: Byte) -> None:
    """Mark the cells that a beam passes before the one it ends in.

    Amanatides and Woo (1987), with the steps along each axis counted, so that rounding leads nowhere else.

    Args:
        ax: where it begins along x, in cells from the window's corner.
        ay: the same along y.
        bx: where it ends along x.
        by: the same along y.
        touched: (rows, columns), in and out.
    """
    rows, columns = touched.shape
    i, j = math.floor(ay), math.floor(ax)
    left_x, left_y = abs(math.floor(bx) - j), abs(math.floor(by) - i)
    dx, dy = bx - ax, by - ay
    step_x, step_y = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
    per_x = 1.0 / abs(dx) if dx != 0.0 else math.inf
    per_y = 1.0 / abs(dy) if dy != 0.0 else math.inf
    next_x = ((j + 1 - ax) if step_x > 0 else (ax - j)) * per_x if dx != 0.0 else math.inf
    next_y = ((i + 1 - ay) if step_y > 0 else (ay - i)) * per_y if dy != 0.0 else math.inf
    while left_x > 0 or left_y > 0:
        if 0 <= i < rows and 0 <= j < columns and touched[i, j] == 0:
            touched[i, j] = PASSED
        if left_y == 0 or (left_x > 0 and next_x <= next_y):
            j += step_x
            next_x += per_x
            left_x -= 1
        else:
            i += step_y
            next_y += per_y
            left_y -= 1


@njit(**LEAF)
def near_ring(x: float, y: float, ring: Array, margin: float) -> bool:
    """Say whether a point is in a simple polygon (k, 2), or at most a margin away from it."""
    inside = False
    nearest = math.inf
    count = len(ring)
    for k in range(count):
        other = k + 1 if k + 1 < count else 0
        ux, uy = ring[k, 0], ring[k, 1]
        vx, vy = ring[other, 0], ring[other, 1]
        if (uy > y) != (vy > y) and x < ux + (y - uy) * (vx - ux) / (vy - uy):
            inside = not inside
        wx, wy = vx - ux, vy - uy
        square = wx * wx + wy * wy
        share = ((x - ux) * wx + (y - uy) * wy) / square if square > 0.0 else 0.0
        share = min(max(share, 0.0), 1.0)
        nearest = min(nearest, (ux + share * wx - x) ** 2 + (uy + share * wy - y) ** 2)
    return inside or nearest <= margin * margin


@njit(**LEAF)
def near_any(x: float, y: float, corners: Array, first: Int, margin: float) -> bool:
    """Say whether a point is in one of several polygons, or near it: corners (c, 2), ring k from `first[k]` on."""
    found = False
    for k in range(len(first) - 1):
        found = found or near_ring(x, y, corners[first[k] : first[k + 1]], margin)
    return found


@njit(**LEAF)
def trace(
    ranges: Array,
    angle_min: float,
    increment: float,
    least: float,
    greatest: float,
    pose: Array,
    mark_range: float,
    clear_range: float,
    corners: Array,
    first: Int,
    margin: float,
    resolution: float,
    left: float,
    bottom: float,
    touched: Byte,
) -> int:
    """Mark which cells a scan passes and hits; return how many readings were of the robot or its cart.

    Args:
        ranges: (n,) [m].
        angle_min: of the first beam [rad].
        increment: between beams [rad].
        least: range that means something [m].
        greatest: the same [m].
        pose: (3,) of the laser.
        mark_range: up to which obstacles are believed [m].
        clear_range: up to which free floor is [m].
        corners: of the outlines of robot and cart, see `near_any`.
        first: where each begins.
        margin: about them [m].
        resolution: of a cell [m].
        left: lowest x of the window [m].
        bottom: lowest y of it [m].
        touched: (rows, columns) zeros, out: `HIT` wins over `PASSED`.
    """
    rows, columns = touched.shape
    ax, ay = (pose[0] - left) / resolution, (pose[1] - bottom) / resolution
    own = 0
    for k in range(len(ranges)):
        far = ranges[k]
        if math.isnan(far) or far < least:
            continue
        angle = pose[2] + angle_min + k * increment
        c, s = math.cos(angle), math.sin(angle)
        hit = far <= greatest
        seen = min(far, clear_range) if hit else min(greatest, clear_range)
        bx, by = ax + c * seen / resolution, ay + s * seen / resolution
        pass_through(ax, ay, bx, by, touched)
        if not hit or far > mark_range:
            continue
        if near_any(pose[0] + c * far, pose[1] + s * far, corners, first, margin):
            own += 1
            continue
        i, j = math.floor(by), math.floor(bx)
        if 0 <= i < rows and 0 <= j < columns:
            touched[i, j] = HIT
    return own


@njit(**LEAF)
def believe(
    touched: Byte,
    time: float,
    hit: int,
    miss: int,
    most: int,
    evidence: Byte,
    looked: Byte,
    last: Array,
    came: Array,
    went: Array,
) -> tuple[int, int]:
    """Bring evidence up to date with a scan, and forget the scan; return how many cells got occupied, and free.

    Args:
        touched: (rows, columns) by `trace`; zeros afterwards.
        time: of the scan [s].
        hit: see `EvidenceSettings`.
        miss: the same.
        most: the same.
        evidence: (rows, columns), in and out.
        looked: (rows, columns) whether a cell was ever seen, in and out.
        last: (rows, columns) when something was last seen in it [s], in and out.
        came: (rows, columns) when that came, in a cell that was free until then [s], in and out.
        went: (rows, columns) when a cell that was occupied was seen to be free [s], in and out; -inf elsewhere.
    """
    taken = freed = 0
    for i in range(touched.shape[0]):
        for j in range(touched.shape[1]):
            what = touched[i, j]
            if what == 0:
                continue
            touched[i, j] = 0
            looked[i, j] = 1
            before = int(evidence[i, j])
            if what == HIT:
                evidence[i, j] = min(before + hit, most)
                last[i, j] = max(time, last[i, j])
                went[i, j] = -math.inf
                if before == 0:
                    came[i, j] = time
                    taken += 1
            elif before > 0:
                evidence[i, j] = max(before - miss, 0)
                if before <= miss:
                    went[i, j] = time
                    freed += 1
    return taken, freed


@njit(**LEAF)
def forget(
    now: float, confirmed: int, fleeting: float, memory: float, evidence: Byte, looked: Byte, last: Array
) -> int:
    """Make unknown what was seen too long ago; return how many cells."""
    gone = 0
    for i in range(evidence.shape[0]):
        for j in range(evidence.shape[1]):
            if evidence[i, j] > 0 and now - last[i, j] > (memory if evidence[i, j] >= confirmed else fleeting):
                evidence[i, j] = looked[i, j] = 0
                gone += 1
    return gone


@njit(cache=True)
def cells_near(
    corners: Array, first: Int, margin: float, resolution: float, left: float, bottom: float, found: Byte
) -> None:
    """Mark the cells whose centre is in one of several outlines, or at most a margin away.

    Args:
        corners: see `near_any`.
        first: see there.
        margin: [m].
        resolution: of a cell [m].
        left: lowest x of the window [m].
        bottom: lowest y of it [m].
        found: (rows, columns), out: 1.
    """
    rows, columns = found.shape
    for k in range(len(first) - 1):
        ring = corners[first[k] : first[k + 1]]
        low_x, high_x = ring[:, 0].min() - margin, ring[:, 0].max() + margin
        low_y, high_y = ring[:, 1].min() - margin, ring[:, 1].max() + margin
        begin_j = max(math.floor((low_x - left) / resolution), 0)
        end_j = min(math.floor((high_x - left) / resolution) + 1, columns)
        begin_i = max(math.floor((low_y - bottom) / resolution), 0)
        end_i = min(math.floor((high_y - bottom) / resolution) + 1, rows)
        for i in range(begin_i, end_i):
            for j in range(begin_j, end_j):
                x, y = left + (j + 0.5) * resolution, bottom + (i + 0.5) * resolution
                if near_ring(x, y, ring, margin):
                    found[i, j] = 1
