"""Compiled: beams that rise and fall, through columns of voxels, and what is believed of these afterwards."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_planner.costmap.ray_kernel import near_any

Array = NDArray[np.float64]
Byte = NDArray[np.uint8]
Int = NDArray[np.int64]
Mask = NDArray[np.bool_]
Scans = NDArray[np.int32]
SKIM = 0.01
"""[m] over a top within which a beam that ends lower is taken to have gone through it."""


@njit(**LEAF)
def mark_ends(
    ranges: Array,
    angle_min: float,
    increment: float,
    least: float,
    greatest: float,
    laser: Array,
    mark_range: float,
    corners: Array,
    first: Int,
    margin: float,
    resolution: float,
    left: float,
    bottom: float,
    lowest: float,
    level: float,
    scan: int,
    time: float,
    hit: int,
    most: int,
    evidence: Byte,
    tops: Byte,
    scans: Scans,
    count: Byte,
    last: Array,
    patch: int,
    above: int,
    right: int,
    settled: float,
    fleeting: float,
    memory: float,
    patches: Array,
) -> tuple[int, int]:
    """Believe in what beams end at; return how many columns got occupied, and how many readings were of oneself.

    Args:
        ranges: (n,) [m].
        angle_min: of the first beam [rad].
        increment: between beams [rad].
        least: range that means something [m].
        greatest: the same [m].
        laser: (4, 4) of its frame; beams lie in its x-y plane.
        mark_range: up to which obstacles are believed [m].
        corners: of the outlines of robot and cart, see `ray_kernel.near_any`.
        first: where each begins.
        margin: about them [m].
        resolution: of a column [m].
        left: lowest x of the window [m].
        bottom: lowest y of it [m].
        lowest: where the lowest voxels begin [m].
        level: height of a voxel [m].
        scan: number of this scan; each has a greater one than the one before.
        time: of it [s].
        hit: see `OverhangSettings`.
        most: the same.
        evidence: (rows, columns, levels), in and out.
        tops: (rows, columns, levels) height of the highest mark in a voxel, in 255ths of it, in and out.
        scans: (rows, columns, levels) number of the last scan that a voxel was touched by, in and out.
        count: (rows, columns) voxels of a column that are occupied, in and out.
        last: (rows, columns) when something was last seen in a column [s], in and out.
        patch: cells along a side of a patch.
        above: row of the window's corner in the frame's own cells, which patches are cut from.
        right: its column.
        settled: see `OverhangSettings` [s].
        fleeting: between two marks after which a patch begins anew [s].
        memory: the same of one over which something has settled [s].
        patches: (m, n, 2) first and last mark over each patch [s], in and out; patches m or n apart share a place.
    """
    rows, columns, levels = evidence.shape
    taken = own = 0
    for k in range(len(ranges)):
        far = ranges[k]
        if math.isnan(far) or far < least or far > greatest or far > mark_range:
            continue
        along, aside = math.cos(angle_min + k * increment), math.sin(angle_min + k * increment)
        x = laser[0, 3] + far * (laser[0, 0] * along + laser[0, 1] * aside)
        y = laser[1, 3] + far * (laser[1, 0] * along + laser[1, 1] * aside)
        z = laser[2, 3] + far * (laser[2, 0] * along + laser[2, 1] * aside)
        up = (z - lowest) / level
        i, j, h = math.floor((y - bottom) / resolution), math.floor((x - left) / resolution), math.floor(up)
        if not (0 <= i < rows and 0 <= j < columns and 0 <= h < levels):
            continue
        if near_any(x, y, corners, first, margin):
            own += 1
            continue
        top = int((up - h) * 255.0)
        before = int(evidence[i, j, h])
        tops[i, j, h] = top if before == 0 else max(top, int(tops[i, j, h]))
        last[i, j] = max(time, last[i, j])
        spell = patches[(i + above) // patch % patches.shape[0], (j + right) // patch % patches.shape[1]]
        if time - spell[1] > (memory if spell[1] - spell[0] >= settled else fleeting) or time < spell[0]:
            spell[0] = time
        spell[1] = time
        if scans[i, j, h] == scan:
            continue
        scans[i, j, h] = scan
        evidence[i, j, h] = min(before + hit, most)
        if before == 0:
            taken += count[i, j] == 0
            count[i, j] += 1
    return taken, own


@njit(**LEAF)
def see_through(
    ranges: Array,
    angle_min: float,
    increment: float,
    least: float,
    greatest: float,
    laser: Array,
    clear_range: float,
    resolution: float,
    left: float,
    bottom: float,
    lowest: float,
    level: float,
    graze: float,
    scan: int,
    miss: int,
    evidence: Byte,
    tops: Byte,
    scans: Scans,
    count: Byte,
) -> int:
    """Doubt what beams go through; return how many columns got free. Call after `mark_ends`, with the same scan.

    What skims a table top, on its way to another place of it, goes through voxels of the top and says nothing of them.
    So a beam doubts a voxel only where it is lower in it than the highest mark, by more than `graze`; or where it is
    about as high and ends lower, since then it went through the top. Columns are gone through as in Amanatides and Woo
    (1987).

    Args:
        ranges: see `mark_ends`, as are all that are not told here.
        angle_min: of the first beam [rad].
        increment: between beams [rad].
        least: range that means something [m].
        greatest: the same [m].
        laser: (4, 4).
        clear_range: along the beam, up to which it frees [m].
        resolution: of a column [m].
        left: lowest x of the window [m].
        bottom: lowest y of it [m].
        lowest: where the lowest voxels begin [m].
        level: height of a voxel [m].
        graze: [m].
        scan: its number.
        miss: see `OverhangSettings`.
        evidence: (rows, columns, levels), in and out.
        tops: (rows, columns, levels).
        scans: (rows, columns, levels), in and out.
        count: (rows, columns), in and out.
    """
    rows, columns, levels = evidence.shape
    freed = 0
    ax, ay = (laser[0, 3] - left) / resolution, (laser[1, 3] - bottom) / resolution
    for k in range(len(ranges)):
        far = ranges[k]
        if math.isnan(far) or far < least:
            continue
        seen = min(far, clear_range) if far <= greatest else min(greatest, clear_range)
        along, aside = math.cos(angle_min + k * increment), math.sin(angle_min + k * increment)
        dx = seen * (laser[0, 0] * along + laser[0, 1] * aside) / resolution
        dy = seen * (laser[1, 0] * along + laser[1, 1] * aside) / resolution
        dz = seen * (laser[2, 0] * along + laser[2, 1] * aside)
        bx, by = ax + dx, ay + dy
        i, j = math.floor(ay), math.floor(ax)
        left_x, left_y = abs(math.floor(bx) - j), abs(math.floor(by) - i)
        step_x, step_y = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
        per_x = 1.0 / abs(dx) if dx != 0.0 else math.inf
        per_y = 1.0 / abs(dy) if dy != 0.0 else math.inf
        next_x = ((j + 1 - ax) if step_x > 0 else (ax - j)) * per_x if dx != 0.0 else math.inf
        next_y = ((i + 1 - ay) if step_y > 0 else (ay - i)) * per_y if dy != 0.0 else math.inf
        entered, end = 0.0, laser[2, 3] + dz - lowest
        while left_x > 0 or left_y > 0:
            across = left_y == 0 or (left_x > 0 and next_x <= next_y)
            leaves = min(next_x if across else next_y, 1.0)
            if 0 <= i < rows and 0 <= j < columns and count[i, j] > 0:
                one, other = laser[2, 3] + entered * dz - lowest, laser[2, 3] + leaves * dz - lowest
                low, high = min(one, other), max(one, other)
                for h in range(max(math.floor(low / level), 0), min(math.floor(high / level) + 1, levels)):
                    before = int(evidence[i, j, h])
                    top = (h + tops[i, j, h] / 255.0) * level
                    if before == 0 or scans[i, j, h] == scan:
                        continue
                    if low > top - graze and (low > top + SKIM or end > top - graze):
                        continue
                    scans[i, j, h] = scan
                    evidence[i, j, h] = max(before - miss, 0)
                    if before <= miss:
                        count[i, j] -= 1
                        freed += count[i, j] == 0
            entered = leaves
            if across:
                j += step_x
                next_x += per_x
                left_x -= 1
            else:
                i += step_y
                next_y += per_y
                left_y -= 1
    return freed


@njit(**LEAF)
def go_with(
    now: float,
    patience: float,
    radius: int,
    slack: float,
    floor: Byte,
    seen: Array,
    came: Array,
    went: Array,
    evidence: Byte,
    count: Byte,
    last: Array,
    patch: int,
    above: int,
    right: int,
    patches: Array,
) -> int:
    """Clear what is over something that has gone from the floor; return how many columns got free.

    Who walks off takes their trunk along: where nothing stands any more about a cell that something has left, what came
    over it together with that, and was not seen there since, has gone as well. What was over the place before stays.

    Args:
        now: [s].
        patience: for which it is waited that nothing is about a cell that was left [s].
        radius: about such a cell [cells].
        slack: by which what is seen over the floor may come sooner, or be seen later, than what is on it [s].
        floor: (rows, columns) evidence of what is on the floor.
        seen: (rows, columns) when something was last seen on it [s].
        came: (rows, columns) when that came [s].
        went: (rows, columns) when a cell was seen to be left [s], in and out; -inf elsewhere.
        evidence: (rows, columns, levels), in and out.
        count: (rows, columns) voxels of a column that are occupied, in and out.
        last: (rows, columns) when something was last seen in a column [s].
        patch: see `mark_ends`, as are all that are not told here.
        above: row of the window's corner.
        right: its column.
        patches: (m, n, 2), in and out.
    """
    rows, columns, levels = evidence.shape
    freed = 0
    for i in range(rows):
        for j in range(columns):
            if went[i, j] == -math.inf:
                continue
            if now - went[i, j] > patience:
                went[i, j] = -math.inf
                continue
            top, bottom = max(i - radius, 0), min(i + radius + 1, rows)
            left, end = max(j - radius, 0), min(j + radius + 1, columns)
            stands = False
            for k in range(top, bottom):
                for m in range(left, end):
                    if floor[k, m] > 0 and (k - i) ** 2 + (m - j) ** 2 <= radius * radius:
                        stands = True
                        break
                if stands:
                    break
            if stands:
                continue
            went[i, j] = -math.inf
            for k in range(top, bottom):
                for m in range(left, end):
                    if count[k, m] == 0 or (k - i) ** 2 + (m - j) ** 2 > radius * radius:
                        continue
                    spell = patches[(k + above) // patch % patches.shape[0], (m + right) // patch % patches.shape[1]]
                    if last[k, m] > seen[i, j] + slack or spell[0] < came[i, j] - slack:
                        continue
                    for h in range(levels):
                        evidence[k, m, h] = 0
                    count[k, m] = 0
                    freed += 1
            for k in range(top, bottom):
                for m in range(left, end):
                    spell = patches[(k + above) // patch % patches.shape[0], (m + right) // patch % patches.shape[1]]
                    if spell[0] >= came[i, j] - slack and spell[1] <= seen[i, j] + slack:
                        spell[0], spell[1] = math.inf, -math.inf
    return freed


@njit(**LEAF)
def forget_columns(
    now: float, fleeting: float, memory: float, real: Mask, evidence: Byte, count: Byte, last: Array
) -> int:
    """Forget columns in which something was seen too long ago; return how many.

    Args:
        now: [s].
        fleeting: see `OverhangSettings` [s].
        memory: the same [s].
        real: (rows, columns) over which patches something has settled.
        evidence: (rows, columns, levels), in and out.
        count: (rows, columns), in and out.
        last: (rows, columns) [s].
    """
    rows, columns, levels = evidence.shape
    gone = 0
    for i in range(rows):
        for j in range(columns):
            if count[i, j] == 0 or now - last[i, j] <= fleeting:
                continue
            if not real[i, j] or now - last[i, j] > memory:
                for h in range(levels):
                    evidence[i, j, h] = 0
                count[i, j] = 0
                gone += 1
    return gone
