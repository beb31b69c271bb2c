"""What stops a drive though no map shows it."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from shapely import Polygon
from shapely.affinity import rotate, translate

from pbrl_control.navigation import KRANG_STOWED, FloorMap, MotionChecker, Struck, plan_route

ROOM = np.array([[-4.0, -3.0], [4.0, -3.0], [4.0, 3.0], [-4.0, 3.0]])
EMPTY = FloorMap.of(ROOM, {})


def known(floor: FloorMap, struck: Struck) -> FloorMap:
    return FloorMap(floor.room, {**floor.obstacles, **struck.outlines})


@pytest.mark.parametrize("direction", [1, -1])
def test_the_robot_stands_free_and_cannot_go_on(direction: int, rng: np.random.Generator) -> None:
    for _ in range(20):
        pose, struck = np.array([*rng.uniform(-1.0, 1.0, 2), rng.uniform(-math.pi, math.pi)]), Struck()
        assert struck.add(EMPTY, KRANG_STOWED, pose, direction) == "something unseen 1"
        checker = MotionChecker(known(EMPTY, struck), KRANG_STOWED, 0.0)
        ahead = direction * np.array([math.cos(pose[2]), math.sin(pose[2])])
        assert checker.pose_fault(pose) == ""
        assert checker.drive_fault(pose[:2], pose[:2] - 0.3 * ahead, float(pose[2])) == ""
        assert "something unseen 1" in checker.drive_fault(pose[:2], pose[:2] + 0.1 * ahead, float(pose[2]))


def test_it_is_the_same_in_any_frame(rng: np.random.Generator) -> None:
    here, there = Struck(), Struck()
    angle = float(rng.uniform(-math.pi, math.pi))
    wide = FloorMap(shapely.Point(0.0, 0.0).buffer(50.0), {})
    here.add(wide, KRANG_STOWED, np.zeros(3), 1)
    there.add(wide, KRANG_STOWED, np.array([1.0, 2.0, angle]), 1)
    moved = translate(rotate(here.outlines["something unseen 1"], angle, origin=(0, 0), use_radians=True), 1.0, 2.0)
    assert moved.symmetric_difference(there.outlines["something unseen 1"]).area < 1e-9


def test_the_next_way_goes_round_it() -> None:
    struck, pose, goal = Struck(), np.zeros(3), np.array([3.0, 0.0, 0.0])
    struck.add(EMPTY, KRANG_STOWED, pose, 1)
    found = plan_route(MotionChecker(known(EMPTY, struck), KRANG_STOWED), pose, goal, seed=1)
    assert found.path is not None
    assert found.path.length > 3.1


def test_what_is_known_to_be_there_is_no_news_and_keeps_its_room() -> None:
    box = Polygon([(0.47, -0.1), (0.9, -0.1), (0.9, 0.1), (0.47, 0.1)])
    struck = Struck()
    assert struck.add(FloorMap(EMPTY.room, {"box": box}), KRANG_STOWED, np.zeros(3), 1) == ""
    assert not struck.outlines
    beside = translate(box, 0.05, 0.3)
    assert struck.add(FloorMap(EMPTY.room, {"box": beside}), KRANG_STOWED, np.zeros(3), 1)
    assert struck.outlines["something unseen 1"].distance(beside) > 0.02
    wall = np.array([4.0 - 0.46, 0.0, 0.0])
    assert Struck().add(EMPTY, KRANG_STOWED, wall, 1) == ""


def test_several_are_kept_until_they_are_forgotten() -> None:
    struck = Struck()
    struck.add(EMPTY, KRANG_STOWED, np.zeros(3), 1)
    first = struck.outlines
    struck.add(known(EMPTY, struck), KRANG_STOWED, np.zeros(3), -1)
    assert list(struck.outlines) == ["something unseen 1", "something unseen 2"]
    assert struck.outlines is not first
    struck.forget()
    assert not struck.outlines
