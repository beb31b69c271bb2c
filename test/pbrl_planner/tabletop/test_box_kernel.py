"""Boxes and balls against shapely."""

from __future__ import annotations

import numpy as np
import pytest
from shapely import LineString, Point, Polygon, box
from shapely.affinity import rotate, translate

from pbrl_planner.tabletop.box_kernel import ball_meets, box_fault, room_inside, separation


def polygon(row: np.ndarray) -> Polygon:
    x, y, t, length, width = row
    return translate(rotate(box(-length, -width, length, width), t, origin=(0, 0), use_radians=True), x, y)


def boxes(rng: np.random.Generator, count: int) -> np.ndarray:
    return np.column_stack(
        (rng.uniform(-0.3, 0.3, (count, 2)), rng.uniform(-4, 4, count), rng.uniform(0.02, 0.2, (count, 2)))
    )


def test_boxes_meet_where_shapely_says_so(rng: np.random.Generator) -> None:
    answers = []
    for a, b in zip(boxes(rng, 800), boxes(rng, 800), strict=True):
        area = polygon(a).intersection(polygon(b)).area
        if 0.0 < area < 1e-9:
            continue
        apart = separation(*a, *b)
        assert (apart < 0.0) == (area > 0.0)
        assert separation(*b, *a) == pytest.approx(apart)
        assert apart <= polygon(a).distance(polygon(b)) + 1e-9
        answers.append(area > 0.0)
    assert 100 < sum(answers) < 700


def test_a_box_is_inside_where_shapely_says_so(rng: np.random.Generator) -> None:
    low, high = np.array([-0.3, -0.2]), np.array([0.35, 0.3])
    answers = [(room_inside(*row, low, high) >= 0.0, box(*low, *high).covers(polygon(row))) for row in boxes(rng, 600)]
    assert all(a == b for a, b in answers)
    assert any(a for a, _ in answers)
    assert not all(a for a, _ in answers)


@pytest.mark.parametrize("still", [False, True])
def test_a_ball_meets_a_box_where_shapely_says_so(rng: np.random.Generator, still: bool) -> None:
    answers = []
    for row in boxes(rng, 800):
        p, q = rng.uniform(-0.4, 0.4, (2, 2))
        q = p if still else q
        away = polygon(row).distance(Point(p) if still else LineString([p, q]))
        radius = rng.uniform(0.005, 0.05)
        if abs(away - radius) > 1e-9:
            assert ball_meets(*p, *q, radius, *row) == (away < radius)
            answers.append(away < radius)
    assert any(answers)
    assert not all(answers)


def test_faults_name_what_is_met_first() -> None:
    halves = np.array([[0.05, 0.02], [0.05, 0.02]])
    fixed = np.array([[0.0, 0.2, 0.0, 0.05, 0.05]])
    layout = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]])
    low, high = np.array([-0.5, -0.3]), np.array([0.5, 0.3])

    def fault(pose: tuple[float, float, float], margin: float = 0.0) -> int:
        return box_fault(layout, 0, np.array(pose), halves, fixed, low, high, margin)

    assert fault((0.0, 0.0, 0.0)) == 0
    assert fault((0.48, 0.0, 0.0)) == -1
    assert fault((0.22, 0.0, 0.0)) == 2
    assert fault((0.0, 0.14, 0.0)) == 3
    assert fault((0.19, 0.0, 0.0)) == 0
    assert fault((0.19, 0.0, 0.0), 0.02) == 2
    assert fault((0.22, 0.0, 0.0), -0.03) == 0, "what overlaps by less than it was shrunk by is let pass"
