"""The parts of a fetch: where things are, which grasps are tried, what a grip test finds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from room_of_fakes import NOMINAL, ROOM, STOWED, TABLE, World

from pbrl_control.constraints.classes import Freedom
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.course import CourseStep
from pbrl_control.errors import ControlError
from pbrl_control.fetching import ConfirmedCourse, GivenGrips, GripTestSettings, grasp_model
from pbrl_control.fetching.surroundings import Surroundings
from pbrl_control.fetching.whereabouts import Whereabouts
from pbrl_control.grasp_plan import GraspPlan
from pbrl_control.grasping import GraspSettings
from pbrl_control.kinematics import RobotKinematics
from pbrl_control.localizer import LocalizerSettings
from pbrl_control.navigation import FloorMap
from pbrl_control.navigation.floor_map import as_polygon
from pbrl_control.percept import Grip, Percept, Tag
from pbrl_control.planar import rotation
from pbrl_control.types import Hold, PlanarTwist
from pbrl_model.parameters import BodyParameters

LEVEL = np.array([0.0, 0.0, 0.0, 1.0])


def test_late_tags_of_moving_arms_do_not_move_the_base(kinematics: RobotKinematics) -> None:
    world = World(kinematics, np.array([-1.0, 0.5, 0.3]), joints=NOMINAL.copy())
    where, seen = Whereabouts(kinematics, LocalizerSettings()), []
    for tick in range(400):
        now = 0.01 * tick
        world.time = now
        where.odometry(now, np.array([4.0, 0.0, -1.0]))
        percept = world.percept()
        seen.append(percept.tags)
        late = seen[max(tick - 8, 0)]
        where.take(now, Percept(percept.posture, late))
        world.joints += np.clip(STOWED - world.joints, -0.003, 0.003)
    assert np.abs(where.pose(now) - world.base).max() < 2e-3


def test_after_a_clock_was_set_back_the_base_is_where_it_is_seen(kinematics: RobotKinematics) -> None:
    where = Whereabouts(kinematics, LocalizerSettings())
    for begin, place in ((100.0, [-1.0, 0.5, 0.3]), (1.0, [2.0, -0.5, 1.3])):
        world = World(kinematics, np.array(place), joints=STOWED.copy())
        where.take(begin, Percept())  # somebody looks before anything new has come
        for tick in range(20):
            world.time = now = begin + 0.05 * tick
            where.odometry(now, np.zeros(3))
            where.take(now, world.percept())
        assert np.abs(where.pose(now) - world.base).max() < 2e-3


def test_sightings_are_averaged_and_jumps_are_not(rng: np.random.Generator) -> None:
    around = Surroundings(0.5)
    for k in range(100):
        noisy = np.array([1.0, 2.0, 0.8]) + 0.003 * rng.normal(size=3)
        around.take(Percept(tags={"table": Tag(k / 15.0, noisy, LEVEL)}, bodies={"table": TABLE}))
    assert np.hypot(*(around.pose("table")[:2] - [1.0, 2.0])) < 3e-3
    around.take(Percept(tags={"table": Tag(7.0, np.array([1.5, 2.0, 0.8]), LEVEL)}, bodies={"table": TABLE}))
    assert around.pose("table")[0] == 1.5
    assert around.age("table", 8.0) == pytest.approx(1.0)


def test_what_was_seen_before_a_clock_was_set_back_is_not_seen_now() -> None:
    around = Surroundings(0.5)
    around.take(Percept(tags={"table": Tag(100.0, np.array([1.0, 2.0, 0.8]), LEVEL)}, bodies={"table": TABLE}))
    assert around.age("table", 3.0) == pytest.approx(97.0)
    around.take(Percept(tags={"table": Tag(3.0, np.array([1.02, 2.0, 0.8]), LEVEL)}, bodies={"table": TABLE}))
    assert around.pose("table")[0] == 1.02, "nothing of before is in it"
    assert around.age("table", 3.5) == pytest.approx(0.5)


def test_the_map_is_drawn_anew_only_when_something_moves() -> None:
    around = Surroundings(0.5)
    around.told(ROOM, {})
    maps = []
    for time, x in ((0.0, 0.0), (0.1, 0.01), (0.2, 0.5)):
        around.take(Percept(tags={"table": Tag(time, np.array([x, 0.0, 0.8]), LEVEL)}, bodies={"table": TABLE}))
        maps.append(around.floor())
    assert maps[0] is maps[1]
    assert maps[1] is not maps[2]


def test_the_map_creeps_with_what_creeps() -> None:
    """Ways are planned by the poses and driven by this map: where a gap is narrow, both have to agree."""
    around = Surroundings(0.5)
    around.told(ROOM, {})
    for k in range(100):
        x, yaw = 3e-4 * k, 5e-4 * k
        turned = np.array([0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)])
        around.take(Percept(tags={"table": Tag(k / 30.0, np.array([x, 0.0, 0.8]), turned)}, bodies={"table": TABLE}))
        drawn, pose = around.floor().obstacles["table"], around.pose("table")
        placed = as_polygon(np.asarray(TABLE.footprint) @ rotation(float(pose[2])).T + pose[:2], "table")
        assert drawn.hausdorff_distance(placed) < 6e-3
    assert pose[0] > 0.02


def test_what_is_built_in_stays_where_it_was_told() -> None:
    around = Surroundings(0.5)
    around.told(None, {"wall": np.array([1.0, 2.0, 0.5])})
    around.take(Percept(bodies={"wall": TABLE, "chair": TABLE}))
    assert around.pose("wall").tolist() == [1.0, 2.0, 0.5]
    assert around.unplaced() == ["chair"]
    assert around.age("chair", 3.0) == math.inf


GIVEN = {
    "two faces": ([("left", (-0.375, 0.2)), ("right", (0.0, -0.75))], "both grips on one face"),
    "crossed": ([("left", (-0.375, -0.2)), ("right", (-0.375, 0.2))], "left of the right"),
    "far apart": ([("left", (-0.375, 0.5)), ("right", (-0.375, -0.5))], "left of the right"),
    "a corner": ([("left", (-0.375, 0.74))], "corner: expected"),
}


@pytest.mark.parametrize("case", GIVEN)
def test_grips_that_no_robot_reaches_are_refused_with_a_reason(case: str, rng: np.random.Generator) -> None:
    grips, reason = GIVEN[case]
    told = [{"gripper": side, "point": point} for side, point in grips]
    plan = GraspPlan.model_validate({"name": "p", "object": "table", "grips": told})
    floor = FloorMap.of_scene(ROOM, {"table": TABLE}, {"table": np.zeros(3)})
    base = np.array([-2.0, 0.0, 0.0])
    found = GivenGrips(plan).search("table", TABLE, np.zeros(3), base, floor, rng, GraspSettings())
    assert not found.candidates
    assert reason in found.why()


@pytest.mark.parametrize("points", [{"left": (-0.375, 0.3)}, {"left": (-0.375, 0.3), "right": (-0.375, -0.1)}])
def test_given_grips_are_stood_before(points: dict, rng: np.random.Generator) -> None:
    told = [{"gripper": side, "point": point} for side, point in points.items()]
    plan = GraspPlan.model_validate({"name": "p", "object": "table", "grips": told})
    floor = FloorMap.of_scene(ROOM, {"table": TABLE}, {"table": np.zeros(3)})
    base, settings = np.array([-2.0, 0.0, 0.0]), GraspSettings()
    (found,) = GivenGrips(plan).search("table", TABLE, np.zeros(3), base, floor, rng, settings).candidates
    assert {side: place.tolist() for side, place in found.contacts.items()} == {
        side: pytest.approx(point) for side, point in points.items()
    }
    lateral = 0.3 - 0.16 if len(points) == 1 else 0.1
    assert found.base_grasp == pytest.approx([-0.375 + settings.depth - settings.home[0], lateral, 0.0])


def test_learned_physics_says_where_to_grasp() -> None:
    def model(**more: float) -> ObjectModel:
        return ObjectModel.uniform(BodyParameters(mass=33.0, **more), TABLE.footprint)

    free = grasp_model(Freedom.of(model(mu_ground=0.02)))
    rolls = grasp_model(Freedom.of(model(wheel_x=0.1, wheel_y=0.0, wheel_theta=0.4, mu_x=0.02, mu_y=0.9)))
    pinned = grasp_model(Freedom.of(model(wheel_x=-0.3, wheel_y=-0.6, mu_x=0.2, mu_y=0.2)))
    assert free.kind == "unconstrained"
    assert rolls.kind == "anisotropic"
    assert math.remainder(rolls.free_axis - 0.4, math.pi) == pytest.approx(0.0, abs=1e-9)
    assert pinned.kind == "fixed-point"
    assert pinned.anchor.tolist() == [-0.3, -0.6]


def _pulled(force: float, slip: float, rng: np.random.Generator, noise: float = 1.0) -> ConfirmedCourse:
    """Run the test of a grip that resists with a force [N] and slides by a share of the pull, tags with their noise."""
    course = ConfirmedCourse("table", GripTestSettings())
    x, table = -0.355, 0.0
    hold = Hold("table", np.array([x, 0.0]))
    tags: dict[str, Tag] = {}
    step = CourseStep(PlanarTwist(), "")
    for tick in range(600):
        now = 0.01 * tick
        if tick % 7 == 0:
            jitter = noise * 0.003 * rng.normal(size=(2, 3))
            turned = noise * math.radians(0.5) * rng.normal()
            wrist = np.array([x - 0.172, 0.0, 0.765]) + jitter[0]
            yaw = np.array([0.0, 0.0, math.sin(turned / 2), math.cos(turned / 2)])
            tags["table"] = Tag(now, np.array([table, 0.0, 0.7775]) + jitter[1], yaw)
            tags["left_gripper"] = Tag(now, wrist, np.array([0.0, 0.0, -math.sqrt(0.5), math.sqrt(0.5)]))
        wrench = noise * 0.1 * rng.normal(size=6)
        wrench[1] += 3.0  # what a sensor shows anyway
        if step.twist.moves():
            wrench[1] -= math.copysign(force, step.twist.vx)
        percept = Percept(None, dict(tags), {"left": wrench}, {"left": Grip("table", hold.contact)})
        step = course.step(now, 0.01, percept, hold, {"left": 0.0})
        x += 0.01 * step.twist.vx
        table += 0.01 * step.twist.vx * (1.0 - slip)
        if step.finished:
            assert abs(x + 0.355) < 1e-4, "put back where it was"
            return course
    raise AssertionError("not over")


def test_a_grip_that_holds_passes(rng: np.random.Generator) -> None:
    for _ in range(20):
        course = _pulled(2.0, 0.0, rng)
        assert course.confirmed
        assert course.readings["left"].force == pytest.approx(2.0, abs=0.2)


def test_a_grip_on_nothing_is_found_out(rng: np.random.Generator) -> None:
    for _ in range(20):
        with pytest.raises(ControlError, match="it holds nothing"):
            _pulled(0.0, 1.0, rng)


def test_a_grip_that_slides_is_found_out(rng: np.random.Generator) -> None:
    with pytest.raises(ControlError, match="20 mm on the edge: they slip"):
        _pulled(3.0, 1.0, rng, noise=0.0)


def test_a_grip_without_a_sensor_is_not_trusted() -> None:
    course = ConfirmedCourse("table", GripTestSettings())
    hold, grips = Hold("table", np.zeros(2)), {"left": Grip("table", np.zeros(2))}
    with pytest.raises(ControlError, match="got too few; are sensor and camera on"):
        for tick in range(600):
            course.step(0.01 * tick, 0.01, Percept(None, {}, {}, grips), hold, {})
