"""Estimates of openings: plans that stand up to exact polygons, and to the library's forces."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from manipulation_rooms import doorway, judge, pinned, rolling, stuck, two_tables

from pbrl_control.constraints.classes import ModelClass
from pbrl_control.constraints.wrench import expected_grip_wrench
from pbrl_namo.beliefs import ObjectBelief, belief_of_draws, prior_belief
from pbrl_namo.errors import NamoError
from pbrl_namo.manipulation import CostSettings, Estimate, ManipulationSettings, estimate
from pbrl_namo.regions import Opening, build_roadmap, free_space, openings
from pbrl_namo.scene import NamoScene

QUICK = ManipulationSettings(worlds=20)


def estimated(
    scene: NamoScene,
    beliefs: Mapping[str, ObjectBelief],
    name: str,
    settings: ManipulationSettings = QUICK,
    seed: int = 0,
) -> Estimate:
    free, roadmap = free_space(scene), build_roadmap(scene, np.random.default_rng(0))
    start = free.index(scene.start[:2])
    opening = next(each for each in openings(scene, free, roadmap) if (each.start, each.object) == (start, name))
    return estimate(scene, free, roadmap, opening, beliefs, np.random.default_rng(seed), settings)


def surely(scene: NamoScene, **beliefs: ObjectBelief) -> dict[str, ObjectBelief]:
    return {name: beliefs.get(name, rolling(thing, thing.mass)) for name, thing in scene.movable.items()}


@pytest.mark.parametrize("name", ["square", "long"])
def test_what_surely_rolls_surely_opens_and_its_plan_stands_up(name: str) -> None:
    scene = two_tables()
    found = estimated(scene, surely(scene), name)
    assert found.probability == 1.0
    assert found.reason == ""
    assert found.plan is not None
    assert found.plan.works == 1.0
    assert found.plan.model_class == ModelClass.UNCONSTRAINED
    assert judge(scene, 0.52, found.plan) == ""
    assert -QUICK.cost.alpha < found.plan.reward <= found.reward < 0.0


def test_the_probability_is_the_share_of_worlds() -> None:
    scene = two_tables()
    thing = scene.movable["square"]
    half = ObjectBelief(thing.footprint, np.vstack((rolling(thing).rows[:15], stuck(thing).rows[:5])))
    found = estimated(scene, surely(scene, square=half), "square")
    assert found.probability == pytest.approx(0.75)
    assert found.plan is not None
    assert found.plan.works == pytest.approx(0.75)
    sure = estimated(scene, surely(scene), "square")
    assert found.reward == pytest.approx(0.75 * sure.reward - 0.25 * QUICK.cost.alpha, abs=0.05)


def test_a_pinned_table_is_turned_about_its_anchor() -> None:
    scene = two_tables()
    found = estimated(scene, surely(scene, long=pinned(scene.movable["long"], -0.3, 0.7, spread=0.005)), "long")
    assert found.probability == 1.0
    assert found.plan is not None
    assert found.plan.model_class == ModelClass.FIXED_POINT
    assert found.plan.centre == pytest.approx([-0.3, 0.7], abs=0.03)
    assert judge(scene, 0.52, found.plan) == ""


def test_a_static_table_opens_nothing_and_that_is_said() -> None:
    scene = two_tables()
    found = estimated(scene, surely(scene, long=stuck(scene.movable["long"])), "long")
    assert (found.probability, found.reward, found.plan) == (0.0, -QUICK.cost.alpha, None)
    assert "'long' cannot be moved" in found.reason
    assert "N" in found.reason


def test_a_table_that_turns_in_place_opens_nothing_and_it_is_said_what_was_tried() -> None:
    scene = two_tables()
    found = estimated(scene, surely(scene, square=pinned(scene.movable["square"], 0.0, 0.0)), "square")
    assert found.probability == 0.0
    assert "'square'" in found.reason


def test_the_expected_force_is_the_librarys() -> None:
    scene = two_tables()
    found = estimated(scene, surely(scene), "long")
    plan = found.plan
    assert plan is not None
    contacts = np.array([plan.contacts[side] for side in plan.sides])
    motion = QUICK.motion
    peaks = []
    for rate in (0.0, 1.0):
        base = np.max([np.hypot(*plan.twist[:2]) / motion.acceleration, abs(plan.twist[2]) / motion.yaw_acceleration])
        assert base <= motion.speed / motion.acceleration + 1e-9
        ramp = motion.speed / motion.acceleration  # of the base, which is the fastest here
        wrench = expected_grip_wrench(plan.model, scene.poses["long"], plan.twist, rate * plan.twist / ramp, contacts)
        peaks.append(float(np.hypot(wrench[:, 0], wrench[:, 1]).max()))
    assert plan.expected_force == pytest.approx(max(peaks), rel=0.02)
    assert plan.highest_force == pytest.approx(plan.expected_force)  # all draws are one


def test_more_weight_costs_more_and_too_much_is_not_to_be_had() -> None:
    scene = two_tables()
    thing = scene.movable["square"]
    rewards, forces = [], []
    for mass in (20.0, 40.0, 80.0, 160.0):
        found = estimated(scene, surely(scene, square=rolling(thing, mass, 0.15)), "square")
        assert found.plan is not None
        rewards.append(found.plan.reward)
        forces.append(found.plan.expected_force)
    assert rewards == sorted(rewards, reverse=True)
    assert forces == sorted(forces)
    heavy = estimated(scene, surely(scene, square=rolling(thing, 195.0, 0.15)), "square")
    assert heavy.probability == 0.0  # 287 N of friction are had, and no more to set out
    assert "the grips give 300 N" in heavy.reason


def test_the_robot_prefers_what_works_in_most_worlds() -> None:
    """Half of the worlds allow a shift, all of them a turn about a corner: the turn is chosen."""
    scene = two_tables()
    thing = scene.movable["long"]
    rows = np.vstack((rolling(thing, 38.0).rows[:10], pinned(thing, -0.3, 0.7).rows[:10]))
    found = estimated(scene, surely(scene, long=ObjectBelief(thing.footprint, rows)), "long")
    assert found.probability == 1.0
    assert found.plan is not None
    assert found.plan.works == 1.0
    assert found.plan.centre == pytest.approx([-0.3, 0.7], abs=0.03)


@pytest.mark.parametrize(("radii", "motions"), [((0.8, 1.6), 1), ((), 2)])
def test_where_no_policy_opens_a_way_an_arc_may_or_two_motions(radii: tuple[float, ...], motions: int) -> None:
    scene = doorway()
    beliefs = surely(scene)
    one = estimated(scene, beliefs, "desk", QUICK.model_copy(update={"second_look": False, "steps": 1}))
    two = estimated(scene, beliefs, "desk", QUICK.model_copy(update={"radii": radii}))
    assert one.probability == 0.0
    assert two.probability == 1.0
    assert two.plan is not None
    assert judge(scene, 0.52, two.plan) == ""
    assert len(two.plan.motions) == motions
    assert two.plan.duration == pytest.approx(sum(motion.duration for motion in two.plan.motions))


def test_same_seed_same_estimate_other_seed_other_worlds() -> None:
    scene = two_tables()
    beliefs = {name: prior_belief(thing, np.random.default_rng(1)) for name, thing in scene.movable.items()}
    first, again, other = (estimated(scene, beliefs, "square", seed=seed) for seed in (4, 4, 5))
    assert first.plan is not None
    assert again.plan is not None
    assert (first.probability, first.reward) == (again.probability, again.reward)
    assert first.plan.end.tobytes() == again.plan.end.tobytes()
    assert (first.probability, first.reward) != (other.probability, other.reward)


def test_further_things_that_have_to_go_make_it_less_likely_and_dearer() -> None:
    scene = two_tables()
    free, roadmap = free_space(scene), build_roadmap(scene, np.random.default_rng(0))
    start = free.index(scene.start[:2])
    assert start is not None
    plain, chain = Opening(start, 1 - start, "square"), Opening(start, 1 - start, "square", ("long",))
    beliefs = surely(scene, long=stuck(scene.movable["long"]))
    alone, impossible = (
        estimate(scene, free, roadmap, each, beliefs, np.random.default_rng(0), QUICK) for each in (plain, chain)
    )
    assert alone.probability == 1.0
    assert impossible.probability == 0.0
    both = estimate(scene, free, roadmap, chain, surely(scene), np.random.default_rng(0), QUICK)
    assert both.probability == 1.0
    assert both.reward < alone.reward - 0.4 * QUICK.cost.alpha
    assert both.plan is not None
    assert judge(scene, 0.52, both.plan, then=("long",)) == ""


def test_missing_and_foreign_beliefs_are_refused() -> None:
    scene = two_tables()
    with pytest.raises(NamoError, match="expected one of 'square', got long"):
        estimated(scene, {"long": rolling(scene.movable["long"])}, "square")
    with pytest.raises(NamoError, match="got one of another"):
        estimated(scene, surely(scene, square=rolling(scene.movable["long"])), "square")
    bare = belief_of_draws(
        scene.movable["square"], ("hinge_x", "hinge_y", "hinge_radius"), np.array([[3.0, 0.85, 1.0]])
    )
    with pytest.raises(NamoError, match="hinge"):
        estimated(scene, surely(scene, square=bare), "square")


def test_a_dearer_second_makes_a_longer_way_dearer() -> None:
    scene = two_tables()
    cheap = estimated(scene, surely(scene), "square", QUICK.model_copy(update={"cost": CostSettings(time=400.0)}))
    dear = estimated(scene, surely(scene), "square", QUICK.model_copy(update={"cost": CostSettings(time=10.0)}))
    assert dear.reward < cheap.reward


def test_what_cannot_be_grasped_opens_nothing() -> None:
    scene = two_tables()
    free, roadmap = free_space(scene), build_roadmap(scene, np.random.default_rng(0))
    none = type(roadmap)(**{**roadmap.__dict__, "grasps": dict.fromkeys(roadmap.grasps, ())})
    once = QUICK.model_copy(update={"steps": 1})
    found = estimate(scene, free, none, Opening(0, 1, "long"), surely(scene), np.random.default_rng(0), once)
    assert found.probability == 0.0
    assert "no grasp" in found.reason
