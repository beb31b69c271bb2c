"""Compiled: a held thing follows many twists, gripped in many ways, until a way is open or something is hit.

Thing, arms and robot go as one rigid body along a screw: all that is quasi-static about it is that it stops at once.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_namo.manipulation.opening_kernel import cut_off, draw_track, find_gaps, touches
from pbrl_namo.manipulation.plane_kernel import box_gap, moved, place, point_distance, separation

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

NEARER = 1e-3
"""[m] nearer than at the start that what is near then may come: rounding, of a thing that slides along another."""
OPEN, LIMIT, THING, ROBOT = 0, 1, 2, 3


@njit(cache=True, error_model="numpy")
def roll(
    pose: Array,
    own: Array,
    own_starts: Indices,
    own_circle: Array,
    hubs: Array,
    doors: Array,
    parents: Indices,
    hulls: Array,
    hull_starts: Indices,
    hull_circles: Array,
    leaves: Array,
    points: Array,
    starts: Indices,
    boxes: Array,
    clusters: Indices,
    ways: Array,
    way_starts: Indices,
    target: Array,
    twists: Array,
    strides: Array,
    limits: Array,
    sizes: Array,
    look: int,
    went: Array,
    causes: Indices,
    hits: Indices,
) -> None:
    """Follow every twist with every grasp.

    Args:
        pose: (3,) of the thing in `world` at the start.
        own: (n, 2) corners of its convex parts, in its frame, as all of it.
        own_starts: (q + 1,)
        own_circle: (3,) middle and radius of a circle around it.
        hubs: (q, 2) see `cut_off`.
        doors: (q, 2)
        parents: (q,)
        hulls: (k, 2) corners of what the robot covers, two convex outlines a grasp, in the thing's frame.
        hull_starts: (2 g + 1,)
        hull_circles: (2 g, 3)
        leaves: (g, 2) where the base's middle is once it has backed off, in the thing's frame.
        points: (., 2) corners of everything else.
        starts: (m + 1,)
        boxes: (m, 4)
        clusters: (m,) below zero: is in the way, but need not be gone round.
        ways: (., 2) from each leave to the target, the thing taken out.
        way_starts: (g + 1,)
        target: (2,)
        twists: (c, 3) of the thing's origin in its axes.
        strides: (c,) between two looks for a collision, in units of the twist.
        limits: (c, g) how far it may be followed; not above zero: it is not tried.
        sizes: (4,) radius of the disc, spare width of an opening, clearance [m], chord of an arc [rad].
        look: strides between two looks for an opening.
        went: (c, g) out: how far it was followed.
        causes: (c, g) out: OPEN, LIMIT, THING or ROBOT.
        hits: (c, g) out: the piece that was hit, else -1.
    """
    grasps, pieces, parts = leaves.shape[0], clusters.shape[0], own_starts.shape[0] - 1
    radius, spare, clearance, chord = sizes[0], sizes[1], sizes[2], sizes[3]
    width = 2.0 * radius + spare
    there, body, leave = np.empty(3), np.empty_like(own), np.empty((1, 2))
    hub_now, door_now, hull_now = np.empty_like(hubs), np.empty_like(doors), np.empty_like(hulls)
    circle = np.empty((1, 2))
    near = np.empty(pieces)
    hull_near = np.empty((2 * grasps, pieces))
    leave_near = np.empty((grasps, pieces))
    gaps, gap_parts = np.empty((pieces * parts + 1, 4)), np.empty(pieces * parts + 1, dtype=np.int64)
    gap_clusters, parities = np.empty(pieces * parts + 1, dtype=np.int64), np.zeros(parts, dtype=np.int64)
    seen = np.zeros(pieces + 1 if pieces == 0 else clusters.max() + 2, dtype=np.int64)
    track = np.empty((int(2.0 * math.pi / chord) + 64, 2))
    alive = np.empty(grasps, dtype=np.bool_)
    place(own, pose, body)
    place(hulls, pose, hull_now)
    for m in range(pieces):
        near[m] = np.inf
        for q in range(parts):
            gap = separation(body, own_starts[q], own_starts[q + 1], points, starts[m], starts[m + 1])
            near[m] = min(near[m], gap)
        near[m] = min(clearance, near[m] - NEARER)
        for h in range(2 * grasps):
            gap = separation(hull_now, hull_starts[h], hull_starts[h + 1], points, starts[m], starts[m + 1])
            hull_near[h, m] = min(clearance, gap - NEARER)
        for g in range(grasps):
            place(leaves[g : g + 1], pose, leave)
            away = point_distance(leave[0, 0], leave[0, 1], points, starts[m], starts[m + 1])
            leave_near[g, m] = min(radius, away)
    for c in range(twists.shape[0]):
        left = 0
        for g in range(grasps):
            alive[g] = limits[c, g] > 0.0
            left += alive[g]
            went[c, g], causes[c, g], hits[c, g] = 0.0, LIMIT, -1
        n = 0
        while left > 0:
            n += 1
            way = n * strides[c]
            for g in range(grasps):
                if alive[g] and way > limits[c, g]:
                    alive[g] = False
                    left -= 1
            if left == 0:
                break
            moved(pose, twists[c], way, there)
            place(own, there, body)
            circle[0, 0], circle[0, 1] = own_circle[0], own_circle[1]
            place(circle, there, leave)
            middle_x, middle_y = leave[0, 0], leave[0, 1]
            hit = -1
            for m in range(pieces):
                if box_gap(middle_x, middle_y, boxes[m]) < own_circle[2] + clearance:
                    for q in range(parts):
                        gap = separation(body, own_starts[q], own_starts[q + 1], points, starts[m], starts[m + 1])
                        if gap < near[m]:
                            hit = m
                if hit >= 0:
                    break
            if hit >= 0:
                for g in range(grasps):
                    if alive[g]:
                        causes[c, g], hits[c, g], alive[g] = THING, hit, False
                break
            looking = n % look == 0
            count = 0
            if looking:
                circle[0, 0], circle[0, 1] = middle_x, middle_y
                count = find_gaps(
                    body,
                    own_starts,
                    circle[0],
                    own_circle[2],
                    points,
                    starts,
                    boxes,
                    clusters,
                    width,
                    gaps,
                    gap_parts,
                    gap_clusters,
                )
                place(hubs, there, hub_now)
                place(doors, there, door_now)
                looking = not touches(target[0], target[1], radius + 0.5 * spare, body, own_starts)
            for g in range(grasps):
                if not alive[g]:
                    continue
                hit = -1
                for h in range(2 * g, 2 * g + 2):
                    low, high = hull_starts[h], hull_starts[h + 1]
                    circle[0, 0], circle[0, 1] = hull_circles[h, 0], hull_circles[h, 1]
                    place(circle, there, leave)
                    placed = False
                    for m in range(pieces):
                        if box_gap(leave[0, 0], leave[0, 1], boxes[m]) < hull_circles[h, 2] + clearance:
                            if not placed:
                                place(hulls[low:high], there, hull_now[low:high])
                                placed = True
                            gap = separation(hull_now, low, high, points, starts[m], starts[m + 1])
                            if gap < hull_near[h, m]:
                                hit = m
                                break
                    if hit >= 0:
                        break
                place(leaves[g : g + 1], there, leave)
                if hit < 0:
                    for m in range(pieces):
                        if box_gap(leave[0, 0], leave[0, 1], boxes[m]) < radius:
                            away = point_distance(leave[0, 0], leave[0, 1], points, starts[m], starts[m + 1])
                            if away < leave_near[g, m]:
                                hit = m
                                break
                if hit >= 0:
                    causes[c, g], hits[c, g], alive[g] = ROBOT, hit, False
                    left -= 1
                    continue
                went[c, g] = way
                if looking:
                    length = draw_track(pose, twists[c], way, leaves[g], chord, track)
                    low, high = way_starts[g], way_starts[g + 1]
                    closed = cut_off(
                        count,
                        gaps,
                        gap_parts,
                        gap_clusters,
                        hub_now,
                        door_now,
                        parents,
                        track,
                        length,
                        ways,
                        low,
                        high,
                        parities,
                        seen,
                    )
                    if not closed:
                        causes[c, g], alive[g] = OPEN, False
                        left -= 1
