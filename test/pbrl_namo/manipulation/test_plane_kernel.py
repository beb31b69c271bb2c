"""Plane geometry against shapely, and against what a screw motion is."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from manipulation_rooms import box, screw

from pbrl_namo.manipulation.plane_kernel import (
    box_gap,
    crosses,
    moved,
    nearest_points,
    place,
    point_distance,
    separation,
)


def convex(rng: np.random.Generator, spread: float) -> np.ndarray:
    """Return a random convex outline (k, 2), counter-clockwise; sometimes a segment."""
    points = rng.normal(size=(int(rng.integers(2, 9)), 2)) + spread * rng.normal(size=2)
    if len(points) == 2:
        return points
    return shapely.get_coordinates(shapely.orient_polygons(shapely.convex_hull(shapely.multipoints(points))))[:-1]


def shape(outline: np.ndarray) -> shapely.Geometry:
    return shapely.LineString(outline) if len(outline) == 2 else shapely.Polygon(outline)


@pytest.mark.parametrize("seed", range(200))
def test_outlines_are_apart_where_shapely_says_so(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = convex(rng, 2.0), convex(rng, 2.0)
    away = shape(a).distance(shape(b))
    gap = separation(a, 0, len(a), b, 0, len(b))
    assert gap == pytest.approx(separation(b, 0, len(b), a, 0, len(a)), abs=1e-12)
    assert (gap > 0.0) == (away > 0.0)
    assert gap <= away + 1e-12
    if away > 0.0:
        points = np.empty(4)
        assert nearest_points(a, 0, len(a), b, 0, len(b), points) == pytest.approx(away, abs=1e-12)
        assert np.hypot(*(points[:2] - points[2:])) == pytest.approx(away, abs=1e-12)
        assert shape(a).distance(shapely.Point(points[:2])) < 1e-9
        assert shape(b).distance(shapely.Point(points[2:])) < 1e-9


def test_outlines_that_overlap_say_how_deep() -> None:
    a, b = box(2.0, 1.0), box(1.0, 1.0, (1.3, 0.1))
    assert separation(a, 0, 4, b, 0, 4) == pytest.approx(-0.2)


def test_rows_of_a_flat_array_are_an_outline() -> None:
    rows = np.vstack((box(1.0, 1.0), box(1.0, 1.0, (3.0, 0.0))))
    assert separation(rows, 0, 4, rows, 4, 8) == pytest.approx(2.0)


@pytest.mark.parametrize("seed", range(100))
def test_a_points_distance_is_shapelys(seed: int) -> None:
    rng = np.random.default_rng(seed)
    outline, (x, y) = convex(rng, 0.5), rng.normal(size=2)
    assert point_distance(x, y, outline, 0, len(outline)) == pytest.approx(
        shape(outline).distance(shapely.Point(x, y)), abs=1e-12
    )
    bounds = np.array(shape(outline).bounds)
    assert box_gap(x, y, bounds) == pytest.approx(shapely.box(*bounds).distance(shapely.Point(x, y)), abs=1e-12)


@pytest.mark.parametrize("seed", range(100))
def test_crossings_are_counted_modulo_two(seed: int) -> None:
    rng = np.random.default_rng(seed)
    path, (a, b) = rng.normal(size=(7, 2)), rng.normal(size=(2, 2))
    one_by_one = sum(
        shapely.LineString([a, b]).intersects(shapely.LineString(path[k : k + 2])) for k in range(len(path) - 1)
    )
    assert crosses(*a, *b, path, 0, len(path)) == one_by_one % 2
    assert crosses(*a, *b, path, 3, 4) == crosses(*a, *b, path, 2, 2) == 0  # one point, and none: no line


@pytest.mark.parametrize("seed", range(20))
def test_a_closed_line_is_crossed_evenly_by_a_loop(seed: int) -> None:
    rng = np.random.default_rng(seed)
    loop, path = rng.normal(size=(6, 2)), rng.normal(size=(9, 2))
    path[-1] = path[0]
    around = sum(crosses(*loop[k], *loop[(k + 1) % 6], path, 0, 9) for k in range(6))
    assert around % 2 == 0


@pytest.mark.parametrize("twist", [(0.3, -0.2, 0.0), (0.3, -0.2, 0.7), (0.0, 0.0, -1.2), (0.1, 0.4, 1e-10)])
def test_a_constant_twist_is_a_screw(twist: tuple[float, float, float]) -> None:
    pose, out = np.array([1.0, -2.0, 0.4]), np.empty(3)
    moved(pose, np.array(twist), 1.7, out)
    assert out == pytest.approx(screw(pose, np.array(twist), 1.7), abs=1e-6)
    half, whole = np.empty(3), np.empty(3)
    moved(pose, np.array(twist), 0.85, half)
    moved(half, np.array(twist), 0.85, whole)
    assert whole == pytest.approx(out, abs=1e-9)


def test_placing_keeps_distances() -> None:
    out = np.empty((4, 2))
    place(box(2.0, 1.0), np.array([3.0, 1.0, 2.1]), out)
    assert shapely.Polygon(out).area == pytest.approx(2.0)
    assert out.mean(axis=0) == pytest.approx([3.0, 1.0])
