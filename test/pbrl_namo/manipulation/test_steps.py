"""Grasps anywhere, and several manipulations one after the other: they stand up to exact polygons."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from manipulation_rooms import ANGLED, box, judge, pinned, rolling, stuck, two_tables

from pbrl_control.grasping.settings import GraspSettings
from pbrl_control.planar import Array, compose, inverse
from pbrl_namo.beliefs import ObjectBelief
from pbrl_namo.manipulation import ManipulationSettings, Study, Yard, estimate
from pbrl_namo.manipulation.aims import OpenWay, OutOfTheWay, outlines
from pbrl_namo.manipulation.plane_kernel import moved
from pbrl_namo.manipulation.stances import Stances, leave_point
from pbrl_namo.manipulation.steps import Step, StepSearch, Tries
from pbrl_namo.regions import Opening, build_roadmap, free_space
from pbrl_namo.scene import Movable, NamoScene

QUICK = ManipulationSettings(worlds=20)
FAR_CASTER = 0.32, 0.69
"""Of the long table [m]: on the goal's side of it, about which no one grasp turns it far enough."""


def turned_only() -> NamoScene:
    """Two tables as in the thesis's room; of the long one a caster on the far side is locked, the square one is."""
    scene = two_tables()
    room = box(6.6, 4.6, (3.3, 2.3))
    poses = {"square": np.array([3.2, 0.85, 0.0]), "long": np.array([3.2, 2.9, 0.0])}
    return NamoScene.of(room, {}, dict(scene.movable), poses, np.array([1.0, 2.3, 0.0]), np.array([5.8, 2.3, np.nan]))


def searched(scene: NamoScene, name: str, belief: ObjectBelief, been: tuple[Array, ...] = ()) -> tuple[Step, ...]:
    return search_of(scene, name, belief, been).find()


def search_of(scene: NamoScene, name: str, belief: ObjectBelief, been: tuple[Array, ...] = ()) -> StepSearch:
    free = free_space(scene)
    start, end = free.index(scene.start), free.index(scene.goal)
    assert start is not None and end is not None
    study = Study.of(scene, name, {name: belief}, np.random.default_rng(0), QUICK)
    aim = OpenWay(scene.movable[name], scene.goal[:2], scene.goal[None, :2], free.radius)
    yard = Yard.of(scene, free.radius, QUICK.cell)
    return StepSearch(yard, free, Opening(start, end, name), study, aim, QUICK, been)


def walked(scene: NamoScene, name: str, steps: tuple[Step, ...]) -> NamoScene:
    """Carry out steps, and hold each to exact polygons; return the room after them."""
    for step in steps:
        assert scene.poses[name] == pytest.approx(step.pose, abs=1e-9)
        free = free_space(scene)
        here, there = free.index(scene.start[:2]), free.index(leave_point(step.pose, step.grasp))
        assert here is not None and here == there, "the robot cannot drive there"
        others = shapely.union_all([*scene.fixed.values(), *(o for n, o in scene.outlines.items() if n != name)])
        for share in np.linspace(0.0, 1.0, 30):
            pose = step.at(float(share))
            robot = shapely.Polygon(scene.robot.at(compose(pose, step.grasp.base)))
            for cover in (robot, scene.movable[name].at(pose)):
                assert cover.intersection(others).area < 1e-6
                assert scene.room.buffer(1e-6).covers(cover)
        scene = scene.moved({name: step.end}, compose(step.end, step.grasp.leave))
    return scene


def test_the_ends_of_tries_are_those_of_the_kernel() -> None:
    rng = np.random.default_rng(1)
    twists = np.vstack((rng.normal(size=(20, 3)), np.column_stack((rng.normal(size=(5, 2)), np.zeros(5)))))
    ways, pose = rng.uniform(0.1, 2.0, 25), np.array([0.4, -1.0, 2.0])
    tries = Tries(pose, (), np.zeros(25, dtype=np.int64), twists, ways, ways, np.zeros(25, dtype=bool))
    for end, twist, way in zip(tries.ends(), twists, ways, strict=True):
        there = np.empty(3)
        moved(pose, twist, way, there)
        assert end == pytest.approx(there, abs=1e-12)
    halves = tries.shared((1.0, 0.5))
    assert halves.ends()[:25] == pytest.approx(tries.ends())
    assert halves.ways[25:] == pytest.approx(0.5 * ways)


@pytest.mark.parametrize("footprint", [box(0.75, 1.5), box(0.9, 0.6), ANGLED], ids=["desk", "cart", "angled"])
def test_free_grasps_are_those_that_polygons_allow(footprint: Array) -> None:
    settings, rng = GraspSettings(), np.random.default_rng(2)
    things = {"own": Movable(footprint, 0.75, 30.0), "other": Movable(box(0.6, 0.6), 0.75, 20.0)}
    poses = {"own": np.array([2.5, 2.0, 0.0]), "other": np.array([4.0, 2.0, 0.3])}
    room = box(5.0, 4.0, (2.5, 2.0))
    scene = NamoScene.of(room, {}, things, poses, np.array([0.7, 0.7, 0.0]), np.array([0.7, 3.3, np.nan]))
    stances = Stances.of(scene, "own", 0.2, settings)
    assert len(stances) > 8
    yard = Yard.of(scene, 0.52, 0.025)
    pieces = yard.pieces.taken(np.flatnonzero(~yard.owned(("own",))))
    other, region = scene.outlines["other"], free_space(scene, 0.52, "own").regions[0]
    for _ in range(5):
        pose = np.array([*rng.uniform((1.5, 1.5), (3.0, 2.5)), rng.uniform(-3.0, 3.0)])
        free = stances.free(pose, region, pieces)
        for grasp, told in zip(stances.grasps, free, strict=True):
            parts = [
                shapely.Polygon([compose(pose, np.array([*corner, 0.0]))[:2] for corner in cover])
                for cover in grasp.covers
            ]
            gap = min(min(other.distance(part), scene.room.exterior.distance(part)) for part in parts)
            inside = all(scene.room.covers(part) for part in parts) and region.covers(
                shapely.Point(leave_point(pose, grasp))
            )
            if told:
                assert inside and parts[0].distance(other) >= settings.clearance - 1e-9
            elif inside:
                assert gap < 2.0 * settings.clearance, "refused though nothing is near"


def test_what_one_grasp_does_not_turn_far_enough_several_do() -> None:
    scene = turned_only()
    long = scene.movable["long"]
    beliefs = {"long": pinned(long, *FAR_CASTER), "square": stuck(scene.movable["square"])}
    free, roadmap = free_space(scene), build_roadmap(scene, np.random.default_rng(0))
    start, end = free.index(scene.start), free.index(scene.goal)
    assert start is not None and end is not None
    opening = Opening(start, end, "long")
    once = QUICK.model_copy(update={"steps": 1})
    assert estimate(scene, free, roadmap, opening, beliefs, np.random.default_rng(0), once).plan is None
    several = estimate(scene, free, roadmap, opening, beliefs, np.random.default_rng(0), QUICK)
    assert several.plan is not None and several.probability == 1.0
    assert several.plan.more > 0
    assert judge(scene, free.radius, several.plan).startswith("no way"), "it is a step, and hits nothing"
    steps = searched(scene, "long", beliefs["long"])
    assert len(steps) == several.plan.more + 1
    after = free_space(walked(scene, "long", steps))
    assert after.index(steps[-1].leave) == after.index(scene.goal)


def test_it_is_not_let_go_again_where_it_has_been() -> None:
    scene = turned_only()
    belief = pinned(scene.movable["long"], *FAR_CASTER)
    steps = searched(scene, "long", belief)
    been = tuple(step.end for step in steps[:-1])
    assert been
    for turns in (0.0, math.tau):  # a tag's heading is within half a turn, a step's end may be beyond
        told = tuple(pose + np.array([0.0, 0.0, turns]) for pose in been)
        for step in searched(scene, "long", belief, told)[:-1]:
            assert all(np.abs(step.end - pose).max() > 1e-3 for pose in been)


@pytest.mark.parametrize("pinning", [True, False], ids=["turned only", "anywhere"])
def test_headings_on_both_sides_of_half_a_turn_are_looked_at_as_one(pinning: bool) -> None:
    scene = turned_only()
    thing = scene.movable["long"]
    search = search_of(scene, "long", pinned(thing, *FAR_CASTER) if pinning else rolling(thing))
    keys = [search._key(np.array([1.0, 1.0, turn])) for turn in (math.pi - 0.004, 0.004 - math.pi, 0.004 + math.pi)]
    assert keys[0] == keys[1] == keys[2]
    around = [search._key(np.array([1.0, 1.0, turn])) for turn in np.linspace(-math.pi, math.pi, 1000)]
    assert len(set(around)) == (126 if pinning else 42)


def test_what_is_in_the_way_is_put_where_it_is_not() -> None:
    scene = two_tables()
    free = free_space(scene)
    start = free.index(scene.start)
    assert start is not None
    area = scene.outlines["long"].buffer(0.3)
    study = Study.of(scene, "long", {"long": rolling(scene.movable["long"])}, np.random.default_rng(0), QUICK)
    asked: list[Step] = []

    def good(step: Step) -> bool:
        asked.append(step)
        return len(asked) > 1

    aim = OutOfTheWay(scene.movable["long"], area, scene.goal[None, :2], free.radius, good)
    yard = Yard.of(scene, free.radius, QUICK.cell)
    steps = StepSearch(yard, free, Opening(start, start, "long"), study, aim, QUICK).find()
    assert steps and steps[-1] is asked[-1] and len(asked) == 2, "the first place is refused, the next one taken"
    put = outlines(scene.movable["long"], steps[-1].end[None])[0]
    assert not put.intersects(area)
    assert put.distance(shapely.Point(scene.goal[:2])) > free.radius
    walked(scene, "long", steps)


def test_grasps_do_not_depend_on_where_a_thing_stands() -> None:
    scene = two_tables()
    elsewhere = scene.moved({"long": np.array([3.0, 2.6, 1.0])})
    first, second = (Stances.of(each, "long", 0.2, GraspSettings()) for each in (scene, elsewhere))
    assert first.leaves == pytest.approx(second.leaves)
    pose = scene.poses["long"]
    for grasp in first.grasps:
        assert compose(inverse(pose), compose(pose, grasp.base))[:2] == pytest.approx(grasp.base[:2])
        assert shapely.Polygon(grasp.covers[0]).distance(shapely.Polygon(scene.movable["long"].footprint)) >= 0.03
