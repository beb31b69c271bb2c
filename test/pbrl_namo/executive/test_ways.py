"""Grasps, ways and openings, and the trajectory that a move becomes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from office_of_fakes import GOAL, SETTINGS, TABLE, Office, light, office, view_of

from pbrl_control.errors import ControlError
from pbrl_control.grasping import GraspSettings
from pbrl_control.kinematics import RobotKinematics
from pbrl_namo.errors import NamoError
from pbrl_namo.executive import ExecutiveSettings, GraspJob, Move, OpenByFreeSpace
from pbrl_namo.executive.manipulating import FoundGrasp, plan_of
from pbrl_namo.executive.opening_check import stretch_of
from pbrl_namo.executive.ways import find_grasp, find_way
from pbrl_namo.regions import drive_radius
from pbrl_namo.scene import NamoScene


def scene_of(world: Office, goal: np.ndarray = GOAL) -> NamoScene:
    return view_of(world).scene(world.time, goal, ())


def pull(name: str = "table_a", **more: object) -> Move:
    told = {"segments": ((np.array([-0.12, 0.0, 0.0]), 5.0),), "contact": np.array([-0.375, 0.0])} | more
    return Move(name, start=0, end=1, targets=np.array([[2.0, 0.0]]), **told)  # type: ignore[arg-type]


def test_the_planned_grasp_is_found_with_both_hands(kinematics: RobotKinematics) -> None:
    scene = scene_of(office(kinematics))
    found = find_grasp(GraspJob(scene, pull(), (), 5), SETTINGS.fetch.grasps)
    assert found.candidate is not None
    assert found.candidate.sides == ("left", "right")
    assert np.mean(list(found.candidate.contacts.values()), axis=0) == pytest.approx([-0.375, 0.0], abs=1e-9)


@pytest.mark.parametrize("hands", [("left", "right"), ("left",), ("right",)])
def test_the_hands_that_were_planned_come_first(kinematics: RobotKinematics, hands: tuple[str, ...]) -> None:
    found = find_grasp(GraspJob(scene_of(office(kinematics)), pull(hands=hands), (), 5), SETTINGS.fetch.grasps)
    assert found.candidate is not None
    assert found.candidate.sides == hands


def test_where_it_failed_another_grasp_of_that_side_is_found(kinematics: RobotKinematics) -> None:
    scene = scene_of(office(kinematics))
    first = find_grasp(GraspJob(scene, pull(), (), 5), SETTINGS.fetch.grasps).candidate
    assert first is not None
    job = GraspJob(scene, pull(model=light()), (first.base_goal[:2],), 5)
    again = find_grasp(job, GraspSettings(samples=24, wanted=6, time_limit=2.0)).candidate
    assert again is not None
    assert np.hypot(*(again.base_goal - first.base_goal)[:2]) > 0.25
    assert all(place[0] == pytest.approx(-0.375) for place in again.contacts.values()), "on the same face"


def test_no_grasp_has_its_reason(kinematics: RobotKinematics) -> None:
    world = office(kinematics)
    world.bodies = {**world.bodies, "table_a": replace(TABLE, height=1.2)}
    found = find_grasp(GraspJob(scene_of(world), pull(), (), 5))
    assert found.candidate is None
    assert "0.6 to 0.92 m above the floor" in found.reason


def test_a_way_of_any_heading_ends_as_it_arrives(kinematics: RobotKinematics) -> None:
    world = office(kinematics)
    scene = scene_of(world, np.array([-2.0, 2.0, math.nan]))
    way = find_way(scene, 3)
    assert way.goal[:2] == pytest.approx([-2.0, 2.0])
    assert way.goal[2] == pytest.approx(way.legs[-1].heading)
    told = find_way(scene_of(world, np.array([-2.0, 2.0, 1.0])), 3)
    assert told.goal[2] == 1.0


def test_no_way_has_its_reason(kinematics: RobotKinematics) -> None:
    world = office(kinematics)
    with pytest.raises(NamoError, match=r"way to the goal: .*narrower than the robot"):
        find_way(scene_of(world), 3)
    with pytest.raises(NamoError, match="way to the goal: goal: the robot would be in 'table_a'"):
        find_way(scene_of(world, np.array([0.3, 1.5, math.nan])), 3)


def test_the_same_seed_finds_the_same_way(kinematics: RobotKinematics) -> None:
    world = office(kinematics)
    world.things["table_a"][0] = -1.4
    ways = [find_way(scene_of(world), 7).poses() for _ in range(2)]
    assert np.array_equal(*ways)


def test_openings_are_seen_when_they_are_wide_enough(kinematics: RobotKinematics) -> None:
    world = office(kinematics)
    scene, targets = scene_of(world), np.array([[2.0, 0.0], [2.0, 1.5], [0.3, 1.55]])
    check = OpenByFreeSpace(0.5, spare=0.0)
    gaps = {x: check(scene.moved({"table_a": np.array([x, 1.55, 0.0])}), targets) for x in np.arange(-1.5, 0.4, 0.1)}
    opened = [x for x, found in gaps.items() if found]
    assert opened
    assert max(opened) == pytest.approx(0.95 - 1.0 - 0.375, abs=0.11), "a metre between wall and table"
    assert all(gaps[x] for x in gaps if x < max(opened)), "once open it stays so"
    assert not check(scene, np.zeros((0, 2)))
    assert not check(scene, np.array([[0.3, 1.55]])), "no room there for anybody"
    assert not check(scene.moved({}, start=np.array([0.3, 1.55, 0.0])), targets), "it stands in the table"


def test_an_opening_is_none_while_what_is_moved_stands_at_the_goal(kinematics: RobotKinematics) -> None:
    scene, check = scene_of(office(kinematics)), OpenByFreeSpace(0.5, spare=0.0)
    targets = np.array([[2.0, 0.0], [2.0, 1.5]])
    away = np.array([-1.0, 1.55, 0.0])
    assert check(scene.moved({"table_a": away}), targets)
    beside = np.array([scene.goal[0] - 0.6, scene.goal[1], 0.0])
    for heading in (math.nan, 0.0):
        there = replace(scene, goal=np.array([*scene.goal[:2], heading]))
        assert not check(there.moved({"table_a": beside}), targets)


@pytest.mark.parametrize(("way", "stretch"), [(0.5, 1.3), (1.0, 1.14), (1.3, 1.3)])
def test_nothing_is_moved_on_until_it_stands_at_the_goal(
    way: float, stretch: float, kinematics: RobotKinematics
) -> None:
    """Room for the robot, 0.52 m, is left after 1.15 m."""
    scene = scene_of(office(kinematics))
    thing = scene.movable["table_a"].footprint[:, 0].max()
    goal = np.array([scene.poses["table_a"][0] + 1.15 + thing + drive_radius(scene.robot), 1.55, math.nan])
    move = pull(segments=((np.array([0.1, 0.0, 0.0]), 10.0 * way),))
    assert stretch_of(move, replace(scene, goal=goal), 1.3) == pytest.approx(stretch, abs=1e-6)


def test_a_grasp_is_good_until_somebody_moves(kinematics: RobotKinematics, rng: np.random.Generator) -> None:
    scene = scene_of(office(kinematics))
    candidate = find_grasp(GraspJob(scene, pull(), (), 5), SETTINGS.fetch.grasps).candidate
    assert candidate is not None
    pose, base = scene.poses["table_a"], scene.start
    choice = FoundGrasp(candidate, pose, SETTINGS)

    def search(pose: np.ndarray, base: np.ndarray) -> str:
        return choice.search("table_a", TABLE, pose, base, scene.floor(), rng, GraspSettings()).why()

    assert search(pose, base) == ""
    assert search(pose + np.array([0.05, 0.0, 0.05]), base + np.array([0.05, 0.0, 0.1])) == ""
    assert "the base has moved by 0.20 m" in search(pose, base + np.array([0.2, 0.0, 0.0]))
    assert "'table_a' has moved by" in search(pose + np.array([0.0, 0.0, 0.5]), base)


def test_a_move_is_slowed_down_not_cut_short(kinematics: RobotKinematics) -> None:
    candidate = find_grasp(GraspJob(scene_of(office(kinematics)), pull(), (), 5), SETTINGS.fetch.grasps).candidate
    assert candidate is not None
    fast = pull(segments=((np.array([0.6, 0.0, 0.0]), 2.0), (np.array([0.0, 0.0, 0.8]), 1.0)))
    settings = ExecutiveSettings(stretch=1.0)
    trajectory = plan_of(fast, candidate, settings).trajectory(np.zeros(3))
    assert trajectory.end == pytest.approx([1.2, 0.0, 0.8], abs=1e-6)
    longer = plan_of(fast, candidate, ExecutiveSettings(stretch=1.5)).trajectory(np.zeros(3))
    assert longer.end == pytest.approx([1.2, 0.0, 1.2], abs=1e-6), "the last part goes on"
    step = plan_of(replace(fast, more=1), candidate, ExecutiveSettings(stretch=1.5)).trajectory(np.zeros(3))
    assert step.end == pytest.approx([1.2, 0.0, 0.8], abs=1e-6), "a step ends where the next one begins"


def test_what_is_expected_without_a_model_counts(kinematics: RobotKinematics) -> None:
    candidate = find_grasp(GraspJob(scene_of(office(kinematics)), pull(), (), 5), SETTINGS.fetch.grasps).candidate
    assert candidate is not None
    limits = {
        force: plan_of(pull(expected_force=force), candidate, SETTINGS).abort.force for force in (60.0, 2.0, math.nan)
    }
    assert limits[60.0] == pytest.approx(90.0)
    assert limits[2.0] == SETTINGS.abort.force_floor
    assert list(limits.values())[2] == SETTINGS.abort.force
    with pytest.raises(ControlError, match="move of 'table_a': expected a trajectory"):
        plan_of(pull(segments=((np.full(3, np.nan), 1.0),)), candidate, SETTINGS)


def test_what_is_to_be_pushed_as_well_is_expected_at_the_grips(kinematics: RobotKinematics) -> None:
    """The model is of the object alone."""
    candidate = find_grasp(GraspJob(scene_of(office(kinematics)), pull(), (), 5), SETTINGS.fetch.grasps).candidate
    assert candidate is not None
    alone, pushing = (
        plan_of(pull(expected_force=80.0, pushes=pushes), candidate, SETTINGS).abort for pushes in ((), ("chair",))
    )
    assert alone.force_floor == SETTINGS.abort.force_floor
    assert pushing.force_floor == pytest.approx(SETTINGS.abort.force_ratio * 80.0)
