"""Footprints: moments against closed forms, laws of moments, and outlines that are none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import Polygon

from pbrl_model.errors import ModelError
from pbrl_model.geometry import bounding_box, check_polygon, convex_parts, mass_properties

CORNER = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.2], [0.2, 0.2], [0.2, 1.0], [0.0, 1.0]])
side = st.floats(0.05, 5.0)
place = st.floats(-10.0, 10.0)


@given(side, side, place, place, st.floats(-4.0, 4.0))
def test_rectangle_anywhere(width: float, depth: float, x: float, y: float, angle: float) -> None:
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [width / 2, depth / 2]
    c, s = np.cos(angle), np.sin(angle)
    found = mass_properties(corners @ np.array([[c, s], [-s, c]]) + [x, y])
    assert found.area == pytest.approx(width * depth, rel=1e-9)
    assert found.inertia_per_mass == pytest.approx((width**2 + depth**2) / 12, rel=1e-8)
    np.testing.assert_allclose(found.com, [x, y], atol=1e-9)


def test_many_corners_tend_to_the_disc() -> None:
    turn = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    found = mass_properties(0.4 * np.stack([np.cos(turn), np.sin(turn)], -1) + [1.0, 2.0])
    assert found.inertia_per_mass == pytest.approx(0.4**2 / 2, rel=1e-4)


def test_triangle_closed_form() -> None:
    corners = np.array([[0.0, 0.0], [0.6, 0.0], [0.1, 0.5]])
    edges = np.roll(corners, -1, axis=0) - corners
    assert mass_properties(corners).inertia_per_mass == pytest.approx(np.sum(edges**2) / 36)
    np.testing.assert_allclose(mass_properties(corners).com, corners.mean(axis=0))


def test_parts_carry_the_moments_of_the_whole() -> None:
    whole, parts = mass_properties(CORNER), [mass_properties(part) for part in convex_parts(CORNER)]
    areas = np.array([part.area for part in parts])
    centres = np.array([part.com for part in parts])
    assert areas.sum() == pytest.approx(whole.area)
    np.testing.assert_allclose(areas @ centres / areas.sum(), whole.com)
    steiner = [part.inertia_per_mass + np.sum((part.com - whole.com) ** 2) for part in parts]
    assert areas @ np.array(steiner) / areas.sum() == pytest.approx(whole.inertia_per_mass)
    assert all(Polygon(part).convex_hull.area == pytest.approx(Polygon(part).area) for part in convex_parts(CORNER))


def test_outline_comes_back_counter_clockwise_and_open() -> None:
    closed_clockwise = np.vstack([CORNER, CORNER[:1]])[::-1]
    outline = check_polygon(closed_clockwise)
    assert len(outline) == len(CORNER) and Polygon(outline).exterior.is_ccw
    low, high = bounding_box(closed_clockwise)
    np.testing.assert_array_equal([low, high], [[0, 0], [1, 1]])
    assert len(convex_parts(CORNER[:3])) == 1


BAD = {
    "two corners": [[0, 0], [1, 0]],
    "three columns": np.zeros((4, 3)),
    "bow tie": [[0, 0], [1, 1], [1, 0], [0, 1]],
    "line": [[0, 0], [1, 0], [2, 0]],
    "point": [[1, 1], [1, 1], [1, 1]],
    "nan": [[0, 0], [1, 0], [np.nan, 1]],
    "infinite": [[0, 0], [1, 0], [np.inf, 1]],
    "closed line": [[0, 0], [1, 0], [0, 0]],
}


@pytest.mark.parametrize("points", BAD.values(), ids=BAD.keys())
def test_what_is_no_outline_is_refused_in_one_line(points: object) -> None:
    with pytest.raises(ModelError) as caught:
        mass_properties(points)  # type: ignore[arg-type]
    assert str(caught.value).startswith("footprint: expected") and "\n" not in str(caught.value)
