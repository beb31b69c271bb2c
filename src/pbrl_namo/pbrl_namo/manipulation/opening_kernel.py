"""Compiled: whether a thing, where it is put, cuts a disc's way off.

The disc's free space is the plane without everything grown by its radius. A way that is free with the thing taken out
joins two points. With the thing put back somewhere they are apart exactly where a closed line of what is grown runs
between them, and such a line has to lead through the thing: from it over a gap less than the disc's diameter to one
piece, on along pieces between which the disc does not pass either (a cluster), and over another gap back. The closed
line runs between the two points exactly where it crosses the way an odd number of times (Jordan). Clusters do not cross
the way, which is free of them. So each gap has a parity, of the crossings from the thing's middle over the gap, and the
two points are apart exactly where a cluster has gaps of both parities. No grid, no search: a look takes microseconds.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF
from pbrl_namo.manipulation.plane_kernel import box_gap, crosses, nearest_points, point_distance

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@njit(**LEAF)
def find_gaps(
    own: Array,
    own_starts: Indices,
    middle: Array,
    reach: float,
    points: Array,
    starts: Indices,
    boxes: Array,
    clusters: Indices,
    width: float,
    gaps: Array,
    gap_parts: Indices,
    gap_clusters: Indices,
) -> int:
    """Write the gaps between a thing and the pieces around it that are less than `width`, and return how many.

    Args:
        own: (n, 2) corners of the thing's convex parts, in `world`.
        own_starts: (q + 1,) where each part begins.
        middle: (2,) of a circle around it.
        reach: that circle's radius.
        points: (k, 2) corners of the pieces.
        starts: (m + 1,) where each begins.
        boxes: (m, 4) around each.
        clusters: (m,) of each; below zero it is left out.
        width: the disc's diameter [m].
        gaps: (m q, 4) out: the point of the thing, and that of the piece.
        gap_parts: (m q,) out: of the thing.
        gap_clusters: (m q,) out: of the piece.
    """
    count = 0
    for m in range(clusters.shape[0]):
        if clusters[m] < 0 or box_gap(middle[0], middle[1], boxes[m]) > reach + width:
            continue
        for q in range(own_starts.shape[0] - 1):
            away = nearest_points(own, own_starts[q], own_starts[q + 1], points, starts[m], starts[m + 1], gaps[count])
            if away < width:
                gap_parts[count], gap_clusters[count] = q, clusters[m]
                count += 1
    return count


@njit(**LEAF)
def cut_off(
    count: int,
    gaps: Array,
    gap_parts: Indices,
    gap_clusters: Indices,
    hubs: Array,
    doors: Array,
    parents: Indices,
    track: Array,
    track_count: int,
    ways: Array,
    first: int,
    last: int,
    parities: Indices,
    seen: Indices,
) -> bool:
    """Say whether a thing's gaps close a line between the two ends of a way.

    Args:
        count: of gaps, as `find_gaps` wrote them.
        gaps: (., 4)
        gap_parts: (.,)
        gap_clusters: (.,)
        hubs: (q, 2) a point inside each part, in `world`.
        doors: (q, 2) a point that each part shares with its parent.
        parents: (q,) the part, of a lower number, that each hangs on; the first is the root.
        track: (., 2) how the way begins; `track_count` points of it.
        track_count: of them.
        ways: (., 2) how it goes on: rows first..last - 1.
        first: row.
        last: row, that one not.
        parities: (q,) work space.
        seen: (clusters,) work space, zero; zero again afterwards.
    """
    parities[0] = 0
    for q in range(1, parents.shape[0]):
        up = parents[q]
        crossed = crosses(hubs[up, 0], hubs[up, 1], doors[q, 0], doors[q, 1], track, 0, track_count)
        crossed ^= crosses(hubs[up, 0], hubs[up, 1], doors[q, 0], doors[q, 1], ways, first, last)
        crossed ^= crosses(doors[q, 0], doors[q, 1], hubs[q, 0], hubs[q, 1], track, 0, track_count)
        crossed ^= crosses(doors[q, 0], doors[q, 1], hubs[q, 0], hubs[q, 1], ways, first, last)
        parities[q] = parities[up] ^ crossed
    found, done = False, 0
    for k in range(count):
        q = gap_parts[k]
        x, y, there_x, there_y = gaps[k, 0], gaps[k, 1], gaps[k, 2], gaps[k, 3]
        parity = parities[q] ^ crosses(hubs[q, 0], hubs[q, 1], x, y, track, 0, track_count)
        parity ^= crosses(hubs[q, 0], hubs[q, 1], x, y, ways, first, last)
        parity ^= crosses(x, y, there_x, there_y, track, 0, track_count)
        parity ^= crosses(x, y, there_x, there_y, ways, first, last)
        seen[gap_clusters[k]] |= 1 << parity
        done = k + 1
        if seen[gap_clusters[k]] == 3:
            found = True
            break
    for k in range(done):
        seen[gap_clusters[k]] = 0
    return found


@njit(**LEAF)
def touches(x: float, y: float, radius: float, own: Array, own_starts: Indices) -> bool:
    """Say whether a disc about a point is in a thing."""
    for q in range(own_starts.shape[0] - 1):
        if point_distance(x, y, own, own_starts[q], own_starts[q + 1]) < radius:
            return True
    return False


@njit(**LEAF)
def draw_track(pose: Array, twist: Array, way: float, point: Array, chord: float, track: Array) -> int:
    """Write where a point of a moving body has been, from now back to the start, and return how many points.

    Args:
        pose: (3,) of the body at the start.
        twist: (3,) constant, in its axes.
        way: how long it was followed.
        point: (2,) in its frame.
        chord: [rad] of an arc that is taken as straight.
        track: (., 2) out.
    """
    turned = abs(twist[2]) * way
    pieces = max(math.ceil(turned / chord), 1)
    c0, s0 = math.cos(pose[2]), math.sin(pose[2])
    for k in range(pieces + 1):
        part = way * (1.0 - k / pieces)
        angle = twist[2] * part
        if turned < 1e-9:
            x, y = twist[0] * part, twist[1] * part
        else:
            sine, versine = math.sin(angle) / twist[2], 2.0 * math.sin(0.5 * angle) ** 2 / twist[2]
            x, y = twist[0] * sine - twist[1] * versine, twist[0] * versine + twist[1] * sine
        c, s = math.cos(angle), math.sin(angle)
        x, y = x + c * point[0] - s * point[1], y + s * point[0] + c * point[1]
        track[k, 0], track[k, 1] = pose[0] + c0 * x - s0 * y, pose[1] + s0 * x + c0 * y
    return pieces + 1
