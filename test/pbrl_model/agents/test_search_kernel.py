"""Separation, contact predicates and the heuristic, against shapely, the slow predicates and geometry."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from pbrl_model.agents.domain import Domain
from pbrl_model.agents.models import ObjectOrientedModel
from pbrl_model.agents.obstacles import edges, obstacles_of, placed
from pbrl_model.agents.planning import ways
from pbrl_model.agents.search_kernel import sectors_in_contact, separated, stands_free
from pbrl_model.baselines.sectors import ContactSectors


def convex(rng: np.random.Generator, middle: np.ndarray, size: float) -> np.ndarray:
    hull = shapely.MultiPoint(middle + size * rng.uniform(-1, 1, (8, 2))).convex_hull
    return np.array(shapely.geometry.polygon.orient(hull).exterior.coords)[:-1]


@pytest.mark.parametrize("margin", [0.0, 0.05])
def test_separated_only_where_the_distance_is_at_least_the_margin(margin: float) -> None:
    rng = np.random.default_rng(0)
    told = 0
    for _ in range(400):
        a, b = convex(rng, np.zeros(2), 1.0), convex(rng, rng.uniform(-2, 2, 2), 0.7)
        distance = shapely.distance(shapely.Polygon(a), shapely.Polygon(b))
        apart = separated(a, len(a), b, len(b), margin)
        assert apart == separated(b, len(b), a, len(a), margin)
        assert not apart or distance >= margin - 1e-12
        if margin == 0.0:
            assert apart == (distance > 0.0)
        told += apart
    assert 50 < told < 350


def test_a_segment_is_a_polygon_of_two_corners() -> None:
    box = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    crossing, beside = np.array([[-1.0, 0.5], [2.0, 0.6]]), np.array([[1.2, -1.0], [1.2, 2.0]])
    assert not separated(box, 4, crossing, 2, 0.0)
    assert separated(box, 4, beside, 2, 0.19)
    assert not separated(box, 4, beside, 2, 0.21)


def test_stands_free_agrees_with_shapely_on_a_body_that_is_not_convex() -> None:
    rng = np.random.default_rng(1)
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.3], [0.3, 0.3], [0.3, 1.0], [0.0, 1.0]]) - 0.35
    walls = [np.array([[1.0, -2.0], [1.2, -2.0], [1.2, 2.0], [1.0, 2.0]]), np.array([[-2.0, 1.0], [2.0, 1.4]])]
    obstacles, own = obstacles_of(walls), obstacles_of([corner])
    shapes = shapely.union_all([shapely.Polygon(walls[0]), shapely.LineString(walls[1])])
    radius = float(np.hypot(*corner.T).max())
    for _ in range(300):
        pose = rng.uniform(-2, 2, 3)
        free = stands_free(
            *pose,
            own.corners,
            own.counts,
            radius,
            obstacles.corners,
            obstacles.counts,
            obstacles.middles,
            obstacles.radii,
            0.0,
            np.empty_like(own.corners),
        )
        assert free == (shapely.distance(shapely.Polygon(placed(corner, pose)), shapes) > 0.0)


def test_compiled_contact_predicates_are_those_of_the_baseline(cart: Domain) -> None:
    rng = np.random.default_rng(2)
    scene = cart.scene
    walls = [*edges(scene.outline), *(side for wall in scene.walls for side in edges(wall))]
    slow = ContactSectors([scene.things[0].footprint], np.array(walls))
    sensing = ObjectOrientedModel(scene).sensing()
    obstacles = obstacles_of([*edges(scene.outline), *scene.walls])
    states = np.zeros((300, 1, 6))
    states[:, 0, :3] = rng.uniform([0.5, 0.5, -4.0], [4.5, 3.5, 4.0], (300, 3))
    expected = slow.conditions(states) @ (1 << np.arange(4))
    told = [
        sectors_in_contact(*state[0, :3], sensing.rays, sensing.reach, obstacles.corners, obstacles.counts)
        for state in states
    ]
    np.testing.assert_array_equal(told, expected)
    assert len(set(told)) > 6


def test_ways_round_the_walls_are_lower_bounds() -> None:
    rng = np.random.default_rng(3)
    blocked = np.zeros((40, 30), dtype=bool)
    goal, cell = np.array([0.32, 0.41]), 0.05
    field = ways(blocked, goal, np.zeros(2), cell)
    for _ in range(200):
        i, j = int(rng.integers(40)), int(rng.integers(30))
        straight = np.hypot(*(np.array([i + 0.5, j + 0.5]) * cell - goal))
        assert field[i, j] <= straight + np.sqrt(0.5) * cell
    blocked[20, :] = True
    shut = ways(blocked, goal, np.zeros(2), cell)
    assert np.isinf(shut[21:]).all() and np.isfinite(shut[:20]).all()
