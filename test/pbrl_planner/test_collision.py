"""Outlines against a floor: the quick answer is the plain one, touching is free, bad outlines are refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from shapely import Polygon

from pbrl_control.navigation.floor_map import FloorMap
from pbrl_control.planar import rotation
from pbrl_planner.collision import MovingOutlines
from pbrl_planner.errors import PlannerError

SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
HOOK = np.array([[0.6, 0.0], [1.2, 0.0], [1.2, 0.6], [1.1, 0.6], [1.1, 0.1], [0.6, 0.1]])
FLOOR = FloorMap.of(4.0 * SQUARE, {"post": 0.1 * SQUARE + [1.0, 1.0], "sofa": SQUARE * [1.0, 0.4] - [0.5, 1.6]})


def placed(outlines: MovingOutlines, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    corners = np.array([outlines.corners @ rotation(pose[2]).T + pose[:2] for pose in poses])
    return corners, np.array([*corners.min(axis=(0, 1)), *corners.max(axis=(0, 1))])


def test_quick_and_plain_answers_are_those_of_single_polygons(rng: np.random.Generator) -> None:
    outlines = MovingOutlines({"body": SQUARE, "hook": HOOK}, FLOOR)
    free = 0
    for _ in range(300):
        poses = rng.uniform([-2, -2, -3], [2, 2, 3]) + rng.uniform(-0.05, 0.05, (4, 3))
        expected = [
            all(FLOOR.free.covers(Polygon(part @ rotation(pose[2]).T + pose[:2])) for part in (SQUARE, HOOK))
            for pose in poses
        ]
        assert outlines.valid(poses).tolist() == expected
        assert outlines.are_free(*placed(outlines, poses)) == all(expected)
        assert [outlines.fault(pose) == "" for pose in poses] == expected
        free += all(expected)
    assert 10 < free < 290


def test_a_hollow_of_an_outline_may_hold_what_the_outline_does_not_touch() -> None:
    outlines = MovingOutlines({"hook": HOOK}, FloorMap.of(4.0 * SQUARE, {"post": 0.1 * SQUARE + [0.8, 0.4]}))
    assert outlines.fault(np.zeros(3)) == ""
    assert outlines.fault(np.array([0.0, 0.3, 0.0])) == "hook would be in 'post'"


def test_a_thing_wholly_inside_an_outline_is_seen() -> None:
    outlines = MovingOutlines({"body": SQUARE}, FloorMap.of(4.0 * SQUARE, {"pin": 0.01 * SQUARE}))
    assert outlines.fault(np.zeros(3)) == "body would be in 'pin'"


@pytest.mark.parametrize("angle", [0.0, 0.5 * math.pi, math.pi])
def test_touching_is_free_at_any_rounding(angle: float) -> None:
    outlines = MovingOutlines({"body": SQUARE}, FLOOR)
    assert outlines.fault(np.array([-1.5, 0.7, angle])) == ""
    assert outlines.fault(np.array([-1.5 - 1e-5, 0.7, angle])) == "body would be in the walls"


def test_a_floor_with_nothing_free_leaves_no_place() -> None:
    full = FloorMap.of(SQUARE, {"all of it": 2.0 * SQUARE})
    assert "all of it" in MovingOutlines({"body": 0.1 * SQUARE}, full).fault(np.zeros(3))


@pytest.mark.parametrize(
    "corners", [np.zeros((3, 2)), SQUARE[:2], SQUARE[[0, 2, 1, 3]], np.full((4, 2), math.nan), np.zeros(4)]
)
def test_outlines_that_are_none_are_refused(corners: np.ndarray) -> None:
    with pytest.raises(PlannerError, match="body"):
        MovingOutlines({"body": corners}, FLOOR)
    with pytest.raises(PlannerError, match="expected an outline at least"):
        MovingOutlines({}, FLOOR)
    assert shapely.is_prepared(FLOOR.free)
