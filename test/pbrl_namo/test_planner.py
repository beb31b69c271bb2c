"""The planner in a room like the thesis's (figures 43 and 44): which table is moved, how, and why none is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
import shapely

from pbrl_control.constraints.classes import ModelClass
from pbrl_control.planar import compose, inverse
from pbrl_namo import planner
from pbrl_namo.beliefs import ObjectBelief, belief_of_draws
from pbrl_namo.errors import NamoError
from pbrl_namo.manipulation import ManipulationSettings
from pbrl_namo.mdp import MdpSettings
from pbrl_namo.planner import NamoPlan, plan, prior_beliefs
from pbrl_namo.regions import free_space
from pbrl_namo.scene import Movable, NamoScene
from pbrl_namo.scenes import random_office
from pbrl_namo.settings import LastResortSettings, NamoSettings

QUICK = NamoSettings(manipulation=ManipulationSettings(worlds=20))


def box(width: float, height: float, x: float = 0.0, y: float = 0.0) -> np.ndarray:
    return np.array([[-width, -height], [width, -height], [width, height], [-width, height]]) / 2.0 + [x, y]


def room(
    goal: tuple[float, float] = (5.2, 2.0), start: tuple[float, float] = (0.9, 2.0), **things: Movable
) -> NamoScene:
    """6 m by 4 m, split by a square table of 33 kg and a long one of 38 kg."""
    movable = {"square": Movable(box(0.8, 0.8), 0.75, 33.0), "long": Movable(box(0.75, 1.5), 0.75, 38.0), **things}
    poses = {"square": np.array([3.0, 0.85, 0.0]), "long": np.array([3.0, 2.8, 0.0])}
    return NamoScene.of(box(6.0, 4.0, 3.0, 2.0), {}, movable, poses, np.array([*start, 0.0]), np.array([*goal, np.nan]))


def rolling(thing: Movable) -> ObjectBelief:
    return belief_of_draws(thing, ("mass", "mu_ground"), np.array([[thing.mass, 0.02]] * 20))


def stuck(thing: Movable) -> ObjectBelief:
    return belief_of_draws(thing, ("mass", "mu_x", "mu_y", "mu_ground"), np.array([[300.0, 0.9, 0.9, 0.9]] * 20))


def pinned(thing: Movable, x: float, y: float) -> ObjectBelief:
    rng = np.random.default_rng(3)
    places = np.array([x, y]) + 0.005 * rng.standard_normal((40, 2))
    rest = np.tile([0.2, 0.25, 0.25, 0.02, thing.mass], (40, 1))
    names = ("wheel_x", "wheel_y", "wheel_theta", "mu_x", "mu_y", "mu_ground", "mass")
    return belief_of_draws(thing, names, np.hstack((places, rest)))


def beliefs_of(scene: NamoScene, **known: ObjectBelief) -> Mapping[str, ObjectBelief]:
    return {name: known.get(name, rolling(thing)) for name, thing in scene.movable.items()}


def moved_next(found: NamoPlan) -> str:
    assert found.chosen is not None, found.reason
    assert found.chosen.plan is not None
    return found.chosen.plan.object


def test_the_lighter_table_is_moved_first_where_both_roll() -> None:
    scene = room()
    found = plan(scene, beliefs_of(scene), 0, QUICK)
    assert found.start != found.goal
    assert moved_next(found) == "square"
    assert found.policy is not None
    assert found.start is not None
    assert 150.0 < found.policy.values[found.start] < 200.0


def test_a_table_that_was_found_static_is_left_and_the_other_is_moved() -> None:
    """Experiment 1."""
    scene = room()
    found = plan(scene, beliefs_of(scene, square=stuck(scene.movable["square"])), 0, QUICK)
    assert moved_next(found) == "long"


def test_a_table_with_a_locked_caster_is_turned_about_it() -> None:
    """Experiment 2."""
    scene = room()
    known = {"square": stuck(scene.movable["square"]), "long": pinned(scene.movable["long"], -0.3, 0.68)}
    found = plan(scene, beliefs_of(scene, **known), 0, QUICK)
    assert moved_next(found) == "long"
    assert found.chosen is not None
    turn = found.chosen.plan
    assert turn is not None
    assert turn.model_class == ModelClass.FIXED_POINT
    assert turn.centre == pytest.approx([-0.3, 0.68], abs=0.03)


def test_where_both_are_static_there_is_no_way_and_that_is_said() -> None:
    scene = room()
    found = plan(scene, beliefs_of(scene, **{name: stuck(thing) for name, thing in scene.movable.items()}), 0, QUICK)
    assert found.chosen is None
    assert not found.drive
    assert "'square' cannot be moved" in found.reason
    assert "'long' cannot be moved" in found.reason
    assert "\n" not in found.reason
    assert found.policy is not None
    assert found.start is not None
    assert found.policy.values[found.start] == 0.0


def test_by_the_prior_something_is_likely_to_work() -> None:
    scene = room()
    found = plan(scene, prior_beliefs(scene, 0), 0)
    assert found.chosen is not None
    assert 0.4 < found.chosen.probability < 1.0
    plan_now = found.chosen.plan
    assert plan_now is not None
    assert plan_now.works <= found.chosen.probability
    assert 1.0 < plan_now.expected_force <= plan_now.highest_force < 300.0


def test_a_goal_on_this_side_is_driven_to() -> None:
    scene = room(goal=(1.0, 3.0))
    found = plan(scene, {}, 0)
    assert found.drive
    assert found.chosen is None
    assert found.start == found.goal
    assert "drive" in found.reason


def test_a_goal_behind_a_wall_is_cut_off_whatever_is_moved() -> None:
    plain = room()
    wall = shapely.Polygon(box(0.1, 4.0, 4.2, 2.0))
    scene = NamoScene(plain.room, {"wall": wall}, plain.movable, plain.poses, plain.start, plain.goal)
    found = plan(scene, beliefs_of(scene), 0, QUICK)
    assert found.chosen is None
    assert found.goal in found.cut_off
    assert "whatever is moved" in found.reason
    assert "m^2" in found.reason


def behind_a_door(cabinet: tuple[float, float, float]) -> NamoScene:
    """A table beyond a door of 12 m by 5 m; who would grasp it through the door stands where a cabinet is."""
    walls = {"low": box(0.1, 1.6, 6.05, 0.8), "high": box(0.1, 1.6, 6.05, 4.2)}
    movable = {"table": Movable(box(0.75, 1.5), 0.7775, 33.0), "cabinet": Movable(box(0.45, 0.8), 0.7775, 35.0)}
    poses = {"table": np.array([6.55, 2.5, 0.0]), "cabinet": np.array(cabinet)}
    start, goal = np.array([1.0, 1.0, 0.0]), np.array([11.0, 2.5, np.nan])
    return NamoScene.of(box(12.0, 5.0, 6.0, 2.5), walls, movable, poses, start, goal)


def test_what_takes_the_room_to_stand_is_told_before_a_goal_is_given_up() -> None:
    closed = behind_a_door((4.7, 2.5, 0.0))
    once = NamoSettings(manipulation=QUICK.manipulation.model_copy(update={"steps": 1}))
    found = plan(closed, beliefs_of(closed), 0, once)
    assert found.goal in found.cut_off
    assert {room.blockers for room in found.rooms} == {("cabinet",)}
    assert "'cabinet' first" in found.reason
    assert "'table'" in found.reason
    assert "whatever is moved" not in found.reason
    assert "\n" not in found.reason
    free = behind_a_door((1.0, 4.2, 0.0))
    after = plan(free, beliefs_of(free), 0, QUICK)
    assert after.rooms == ()
    assert after.goal not in after.cut_off


def test_what_takes_the_room_to_stand_is_put_aside_and_the_goal_reached() -> None:
    scene, order = behind_a_door((4.7, 2.5, 0.0)), list[str]()
    been: dict[str, list[np.ndarray]] = {}
    for turn in range(6):
        found = plan(scene, beliefs_of(scene), turn, QUICK, been)
        if found.drive:
            break
        assert found.chosen is not None and found.chosen.plan is not None, found.reason
        made = found.chosen.plan
        assert made.aside == (made.object == "cabinet")
        assert made.more > 0 or not made.aside, "what is put aside opens nothing"
        assert found.rooms == () and found.reason == ""
        assert not any(np.hypot(*(made.end - pose)[:2]) < 0.05 for pose in been.get(made.object, ()))
        been.setdefault(made.object, []).append(np.array(scene.poses[made.object]))
        leave = compose(inverse(scene.poses[made.object]), made.drive_to)
        scene = scene.moved({made.object: made.end}, compose(made.end, leave))
        order.append(made.object)
    assert order[0] == "cabinet" and order[-1] == "table"
    assert found.drive


def test_what_cannot_be_moved_is_not_put_aside() -> None:
    scene = behind_a_door((4.7, 2.5, 0.0))
    for still in ("cabinet", "table"):
        found = plan(scene, beliefs_of(scene, **{still: stuck(scene.movable[still])}), 0, QUICK)
        assert found.chosen is None
        assert found.reason


@pytest.mark.parametrize("number", [0, 1, 6, 36])
def test_nothing_is_moved_again_that_has_done_its_part(number: int) -> None:
    """Openings with further obstacles lead where these alone do not."""
    scene = random_office(10, np.random.default_rng([0, 10, number]), move_needed=True)
    beliefs = beliefs_of(scene)
    for turn in range(3):
        found = plan(scene, beliefs, turn, QUICK)
        for opening in found.openings:
            free = free_space(scene, found.free.radius, leave_out=opening.then)
            ends = [found.free.regions[end].point_on_surface() for end in (opening.start, opening.end)]
            assert free.index(np.array(ends[0].coords[0])) != free.index(np.array(ends[1].coords[0]))
        if found.chosen is None or found.chosen.plan is None:
            break
        made = found.chosen.plan
        leave = compose(inverse(scene.poses[made.object]), made.drive_to)
        scene = scene.moved({made.object: made.end}, compose(made.end, leave))


@pytest.mark.parametrize(
    ("scene", "word"),
    [
        (room(goal=(3.0, 2.8)), "'long'"),
        (room(goal=(9.0, 2.0)), "goal"),
        (room(goal=(3.0, 1.6)), "goal"),
        (room(start=(2.2, 2.6)), "start"),
        (room(start=(-1.0, 2.0)), "start"),
    ],
)
def test_a_start_or_goal_that_cannot_be_is_said_in_a_line(scene: NamoScene, word: str) -> None:
    found = plan(scene, beliefs_of(scene), 0, QUICK)
    assert found.chosen is None
    assert not found.drive
    assert word in found.reason
    assert "\n" not in found.reason


def test_same_seed_same_plan() -> None:
    scene = room()
    beliefs = prior_beliefs(scene, 3)
    first, again = (plan(scene, beliefs, 3, QUICK) for _ in range(2))
    assert first.openings == again.openings
    assert first.policy is not None
    assert again.policy is not None
    assert first.policy.q.tobytes() == again.policy.q.tobytes()
    assert first.chosen is not None
    assert again.chosen is not None
    assert first.chosen.plan is not None
    assert again.chosen.plan is not None
    assert first.chosen.plan.stand.tobytes() == again.chosen.plan.stand.tobytes()
    assert first.chosen.plan.twist.tobytes() == again.chosen.plan.twist.tobytes()


def test_all_estimates_lead_to_the_same_choice_as_those_needed() -> None:
    scene = room()
    beliefs = prior_beliefs(scene, 1)
    needed = plan(scene, beliefs, 1, QUICK)
    whole = plan(scene, beliefs, 1, QUICK.model_copy(update={"mdp": MdpSettings(expand="all")}))
    assert moved_next(needed) == moved_next(whole)
    assert None in needed.estimates
    assert None not in whole.estimates
    assert needed.policy is not None
    assert whole.policy is not None
    assert needed.start is not None
    assert needed.policy.values[needed.start] == pytest.approx(whole.policy.values[needed.start])


def test_what_is_hard_to_find_is_found_before_a_goal_is_given_up() -> None:
    scene = random_office(10, np.random.default_rng([0, 10, 4]), move_needed=True)
    hasty = QUICK.model_copy(update={"last_resort": LastResortSettings(margins=())})
    given_up = plan(scene, beliefs_of(scene), 0, hasty)
    assert given_up.chosen is None and given_up.reason
    found = plan(scene, beliefs_of(scene), 0, QUICK)
    assert moved_next(found) in scene.movable
    assert found.reason == ""
    assert found.seconds["manipulation"] > given_up.seconds["manipulation"]


def test_behind_a_wall_nothing_is_looked_for_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    plain, asked = room(), []
    scene = replace(plain, fixed={"wall": shapely.Polygon(box(0.1, 4.0, 4.2, 2.0))})
    build = planner.build_roadmap
    monkeypatch.setattr(planner, "build_roadmap", lambda *given: asked.append(given) or build(*given))
    assert plan(scene, beliefs_of(scene), 0, QUICK).chosen is None
    assert len(asked) == 1


def test_harder_is_never_less_and_one_step_stays_one() -> None:
    told = NamoSettings(manipulation=ManipulationSettings(grasps=90, step_spacing=0.01, steps=1))
    first, second = told.harder()
    assert first.manipulation.grasps == 90
    assert first.manipulation.step_spacing == 0.01
    assert first.manipulation.steps == 1
    assert first.manipulation.second_grasps > told.manipulation.second_grasps
    assert first.manipulation.motion == told.manipulation.motion
    assert second.manipulation.motion.clearance == told.manipulation.motion.clearance / 2.0
    assert set(told.manipulation.radii) < set(first.manipulation.radii)
    assert NamoSettings().harder()[0].manipulation.steps > NamoSettings().manipulation.steps


def test_what_each_part_took_is_told() -> None:
    scene = room()
    found = plan(scene, beliefs_of(scene), 0, QUICK)
    assert set(found.seconds) == {"regions", "roadmap", "openings", "scene", "worlds", "manipulation", "values"}
    assert all(seconds >= 0.0 for seconds in found.seconds.values())


def test_what_nobody_believes_anything_of_is_refused() -> None:
    scene = room()
    with pytest.raises(NamoError, match="prior_belief"):
        plan(scene, {}, 0, QUICK)


def test_grippers_are_the_same_everywhere() -> None:
    grasping = QUICK.manipulation.grasping.model_copy(update={"standoff": 0.2})
    with pytest.raises(ValueError, match="alike"):
        NamoSettings(manipulation=ManipulationSettings(grasping=grasping))
