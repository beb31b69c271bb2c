"""Grasps: where figure 39 wants them, from the region in which the robot is, far from each other."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest
import shapely
from manipulation_rooms import WHEEL, box, pinned, rolling, stuck, two_tables

from pbrl_control.constraints.classes import Freedom
from pbrl_control.planar import compose
from pbrl_namo.beliefs import ObjectBelief, belief_of_draws
from pbrl_namo.manipulation import ManipulationSettings
from pbrl_namo.manipulation.grasps import Grasp, chosen, reachable_grasps, suits
from pbrl_namo.regions import build_roadmap, free_space
from pbrl_namo.scene import Movable, NamoScene

SETTINGS = ManipulationSettings()


def open_room() -> NamoScene:
    thing = Movable(box(0.75, 1.5), 0.75, 33.0)
    return NamoScene.of(
        box(8.0, 8.0, (4.0, 4.0)), {}, {"table": thing}, {"table": np.array([4.0, 4.0, 0.3])}, np.ones(3), np.ones(3)
    )


@pytest.fixture(scope="module")
def all_round() -> tuple[Grasp, ...]:
    scene = open_room()
    return reachable_grasps(scene, build_roadmap(scene, np.random.default_rng(0)), "table", 0, SETTINGS)


def kept(grasps: tuple[Grasp, ...], belief: ObjectBelief) -> list[Grasp]:
    model = belief.models(np.random.default_rng(0), 1)[0]
    flags = suits(grasps, Freedom.of(model), model.footprint, model.com)
    return [grasp for grasp, flag in zip(grasps, flags, strict=True) if flag]


def test_a_free_thing_is_grasped_on_every_face_and_a_static_one_on_none(all_round: tuple[Grasp, ...]) -> None:
    table = open_room().movable["table"]
    faces = {round(math.degrees(grasp.normal)) % 360 for grasp in kept(all_round, rolling(table))}
    assert faces == {0, 90, 180, 270}
    assert kept(all_round, stuck(table)) == []


def test_a_wheeled_thing_is_grasped_across_its_axis(all_round: tuple[Grasp, ...]) -> None:
    table = open_room().movable["table"]
    rows = np.array([[33.0, 0.0, 0.0, math.radians(80.0), 0.01, 0.6, 0.01]])
    faces = {round(math.degrees(grasp.normal)) % 360 for grasp in kept(all_round, belief_of_draws(table, WHEEL, rows))}
    assert faces == {90, 270}


def test_a_pinned_thing_is_grasped_away_from_its_anchor(all_round: tuple[Grasp, ...]) -> None:
    table = open_room().movable["table"]
    found = kept(all_round, pinned(table, 0.3, -0.7))
    assert found
    for grasp in found:
        assert np.mean(list(grasp.contacts.values()), axis=0)[1] > 0.2


def test_grasps_are_of_the_region_that_is_asked_about() -> None:
    scene = two_tables()
    free, roadmap = free_space(scene), build_roadmap(scene, np.random.default_rng(0))
    for region in range(2):
        grasps = reachable_grasps(scene, roadmap, "long", region, SETTINGS)
        assert grasps
        for grasp in grasps:
            leave = compose(scene.poses["long"], grasp.leave)
            assert free.index(leave[:2]) == region
            stand = compose(scene.poses["long"], grasp.base)
            assert np.hypot(*(stand - leave)[:2]) == pytest.approx(0.14)
            assert abs(math.sin(stand[2] - leave[2])) < 1e-9


def test_what_robot_and_arms_cover_is_convex_and_around_the_base(all_round: tuple[Grasp, ...]) -> None:
    for grasp in all_round:
        for outline in grasp.covers:
            polygon = shapely.Polygon(outline)
            assert polygon.area == pytest.approx(polygon.convex_hull.area)
            assert polygon.exterior.is_ccw
        assert shapely.Polygon(grasp.covers[0]).contains(shapely.Point(grasp.base[:2]))


@pytest.mark.parametrize("wanted", ["all", "none", "one hand"])
def test_few_are_chosen_and_far_apart(all_round: tuple[Grasp, ...], wanted: str) -> None:
    flags = np.array([wanted == "all" or (wanted == "one hand" and len(grasp.sides) == 1) for grasp in all_round])
    picked = chosen(all_round, flags, SETTINGS)
    assert len(picked) == len(set(picked)) <= SETTINGS.grasps
    assert bool(picked) == (wanted != "none")
    middles = [np.mean(list(all_round[k].contacts.values()), axis=0) for k in picked]
    assert all(np.hypot(*(a - b)) >= SETTINGS.apart for a, b in combinations(middles, 2))
    hands = [len(all_round[k].sides) for k in picked]
    assert hands == sorted(hands, reverse=True)  # both hands first
