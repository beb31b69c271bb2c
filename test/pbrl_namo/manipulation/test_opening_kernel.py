"""Whether a thing cuts a way off: by gaps and parities, as the exact free space says."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from manipulation_rooms import ANGLED, HOLLOW, box, screw_closed

from pbrl_namo.manipulation.body import Body
from pbrl_namo.manipulation.opening_kernel import cut_off, draw_track, find_gaps, touches
from pbrl_namo.manipulation.plane_kernel import place
from pbrl_namo.manipulation.rollout import reference_ways
from pbrl_namo.manipulation.yard import Yard
from pbrl_namo.regions import Opening, free_space
from pbrl_namo.scene import Movable, NamoScene

NEAR = 2e-3
"""[m] from a gap as wide as the disc: there the exact free space, whose arcs are polygons, is not exact."""


def crowded(rng: np.random.Generator) -> NamoScene:
    """A room with things that stand anywhere, over each other too, some of them hollow, and maybe a wall in it."""
    outlines = [ANGLED, HOLLOW, box(0.8, 1.5), box(0.9, 0.9)]
    names = [f"thing_{k}" for k in range(int(rng.integers(2, 6)))]
    movable = {name: Movable(outlines[int(rng.integers(4))]) for name in names}
    poses = {name: rng.uniform([0.8, 0.8, -3.0], [5.2, 4.2, 3.0]) for name in names}
    wall = box(0.2, rng.uniform(0.5, 2.0), tuple(rng.uniform([1.0, 1.0], [5.0, 4.0])))
    fixed = {"wall": wall} if rng.random() < 0.5 else {}
    return NamoScene.of(box(6.0, 5.0, (3.0, 2.5)), fixed, movable, poses, np.ones(3), np.ones(3))


def is_cut_off(yard: Yard, way: np.ndarray, pose: np.ndarray, width: float) -> bool:
    """Say whether the first thing, at a pose, cuts off the two ends of a way for a disc of a width."""
    own = yard.owned(("thing_0",))
    near = np.flatnonzero(~own)
    pieces, clusters = yard.pieces.taken(near), yard.clusters(("thing_0",))[near]
    body = Body.of(yard.scene.movable["thing_0"].footprint)
    outline, hubs, doors, middle = (
        np.empty_like(each) for each in (body.points, body.hubs, body.doors, np.ones((1, 2)))
    )
    for source, out in (
        (body.points, outline),
        (body.hubs, hubs),
        (body.doors, doors),
        (body.circle[None, :2], middle),
    ):
        place(np.ascontiguousarray(source), pose, out)
    parts = len(body.parents)
    size = len(pieces) * parts + 1
    gaps, of_part, of_cluster = np.empty((size, 4)), np.empty(size, dtype=np.int64), np.empty(size, dtype=np.int64)
    count = find_gaps(
        outline,
        body.starts,
        middle[0],
        body.circle[2],
        pieces.points,
        pieces.starts,
        pieces.boxes,
        clusters,
        width,
        gaps,
        of_part,
        of_cluster,
    )
    seen = np.zeros(int(clusters.max()) + 2, dtype=np.int64)
    parities = np.zeros(parts, dtype=np.int64)
    none = np.empty((1, 2))
    found = cut_off(
        count, gaps, of_part, of_cluster, hubs, doors, body.parents, none, 0, way, 0, len(way), parities, seen
    )
    assert not seen.any()  # left as it was found
    return found or any(touches(*end, 0.5 * width, outline, body.starts) for end in (way[0], way[-1]))


@pytest.mark.parametrize("seed", range(40))
def test_a_thing_put_anywhere_cuts_off_what_the_exact_free_space_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scene, radius = crowded(rng), float(rng.uniform(0.15, 0.5))
    yard, without = Yard.of(scene, radius, 0.025), free_space(scene, radius, leave_out="thing_0")
    points = rng.uniform([0.0, 0.0], [6.0, 5.0], (200, 2))
    ends = points[without.indices(points) >= 0][:2]
    assert len(ends) == 2
    (way,) = reference_ways(yard, Opening(0, 1, "thing_0"), ends[1], [ends[0]])
    joined = without.index(ends[0]) == without.index(ends[1])
    assert (way is not None) == joined
    if way is None:
        return
    for _ in range(8):
        pose = rng.uniform([0.5, 0.5, -3.0], [5.5, 4.5, 3.0])
        free = free_space(scene.moved({"thing_0": pose}), radius)
        exact = free.index(ends[0]) is not None and free.index(ends[0]) == free.index(ends[1])
        sure = [is_cut_off(yard, way, pose, 2.0 * radius + sign * NEAR) for sign in (1.0, -1.0)]
        if sure[0] == sure[1]:
            assert sure[0] != exact


@pytest.mark.parametrize("twist", [(0.5, 0.2, 0.0), (0.1, -0.3, 0.8), (0.0, 0.0, -2.0)])
def test_a_track_is_where_the_point_was(twist: tuple[float, float, float]) -> None:
    pose, point, track = np.array([1.0, 2.0, 0.3]), np.array([0.4, -0.9]), np.empty((200, 2))
    count = draw_track(pose, np.array(twist), 1.1, point, 0.1, track)
    for k in range(count):
        there = screw_closed(pose, np.array(twist), 1.1 * (1.0 - k / (count - 1)))
        c, s = np.cos(there[2]), np.sin(there[2])
        assert track[k] == pytest.approx(there[:2] + np.array([[c, -s], [s, c]]) @ point)
    assert shapely.LineString(track[:count]).length > 0.0
