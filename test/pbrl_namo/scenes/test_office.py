"""Random offices: everything has a place of its own, and start and goal are as asked."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from pbrl_control.navigation.footprint import Footprint
from pbrl_namo.errors import NamoError
from pbrl_namo.regions import free_space
from pbrl_namo.scene import NamoScene
from pbrl_namo.scenes.floor_plan import draw_plan
from pbrl_namo.scenes.furniture import MAKES, Furniture, of_make
from pbrl_namo.scenes.office import random_office
from pbrl_namo.scenes.settings import OfficeSettings


def office(count: int, seed: int, *, move_needed: bool = False) -> NamoScene:
    return random_office(count, np.random.default_rng(seed), move_needed=move_needed)


@pytest.mark.parametrize(("count", "seed"), [(5, 0), (5, 1), (12, 2), (33, 3), (80, 4)])
def test_everything_is_inside_and_nothing_overlaps(count: int, seed: int) -> None:
    scene, gap = office(count, seed), OfficeSettings().gap
    assert len(scene.movable) == count == len(scene.poses)
    outlines = [*scene.fixed.values(), *scene.outlines.values()]
    assert scene.room.buffer(1e-9).covers(shapely.union_all(outlines))
    tree = shapely.STRtree(outlines)
    for a, b in tree.query(outlines, predicate="dwithin", distance=gap - 1e-9).T:
        assert a == b or (a < len(scene.fixed) and b < len(scene.fixed)), "only what is built in may touch"
    fixed = list(scene.fixed.values())
    assert shapely.union_all(fixed).area == pytest.approx(sum(piece.area for piece in fixed))
    assert all(isinstance(thing, Furniture) for thing in scene.movable.values())


@pytest.mark.parametrize("seed", range(6))
def test_start_and_goal_are_roomy_and_could_be_driven_between_without_furniture(seed: int) -> None:
    scene = office(10, seed)
    roomy = free_space(scene, scene.robot.radius + OfficeSettings().clearance)
    empty = free_space(scene, leave_out=set(scene.movable))
    assert roomy.index(scene.start) is not None and roomy.index(scene.goal) is not None
    assert empty.index(scene.start) == empty.index(scene.goal) is not None
    assert np.hypot(*(scene.goal - scene.start)[:2]) >= OfficeSettings().apart


@pytest.mark.parametrize("seed", range(8))
def test_where_moving_is_needed_start_and_goal_are_in_different_regions(seed: int) -> None:
    scene = office(8, seed, move_needed=True)
    free = free_space(scene)
    assert free.index(scene.start) != free.index(scene.goal)


def test_without_furniture_every_room_can_be_reached() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        plan = draw_plan(int(rng.integers(5, 81)), rng, OfficeSettings())
        bare = NamoScene(plan.outline, plan.fixed, {}, {}, np.zeros(3), np.zeros(3))
        free = free_space(bare)
        doors = {free.index(np.array([door.x, door.y])) for door in plan.doors}
        assert doors == {0}
        assert all(region.area < 0.5 for region in free.regions[1:]), "corners behind built-in desks at most"
        for room in plan.rooms:
            assert free.regions[0].intersects(plan.room(room, 0.1))


def test_floor_grows_with_the_furniture() -> None:
    for count in (10, 20, 40, 80):
        area = office(count, count).room.area
        assert area == pytest.approx(count * OfficeSettings().area_per_thing)


def test_one_seed_gives_one_office_and_another_one_another() -> None:
    one, two, other = (office(20, seed) for seed in (7, 7, 8))
    assert list(one.movable) == list(two.movable) and list(one.fixed) == list(two.fixed)
    for name in one.movable:
        assert one.poses[name].tobytes() == two.poses[name].tobytes()
    assert one.start.tobytes() == two.start.tobytes() and one.start.tobytes() != other.start.tobytes()


def test_another_robot_gets_places_that_are_roomy_for_it() -> None:
    robot = Footprint.circle(0.9)
    scene = random_office(5, np.random.default_rng(1), robot=robot)
    assert scene.robot is robot
    assert free_space(scene, 0.9).index(scene.start) is not None


@pytest.mark.parametrize("count", [0, 4, 81, -1])
def test_a_count_out_of_range_is_refused(count: int) -> None:
    with pytest.raises(NamoError, match="expected 5 to 80"):
        office(count, 0)


def test_a_room_that_cannot_be_drawn_is_given_up_in_words() -> None:
    with pytest.raises(NamoError, match="give more floor to each"):
        random_office(20, np.random.default_rng(0), settings=OfficeSettings(area_per_thing=1.0, attempts=2))
    with pytest.raises(NamoError, match="draw again"):
        random_office(5, np.random.default_rng(0), settings=OfficeSettings(apart=500.0, attempts=2))


def test_an_unknown_make_is_refused_with_those_there_are() -> None:
    with pytest.raises(NamoError, match="expected one of desk, table"):
        of_make("throne")
    assert {of_make(make).mass for make in MAKES} == {make.mass for make in MAKES.values()}
