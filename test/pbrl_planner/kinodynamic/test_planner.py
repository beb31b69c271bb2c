"""Plans keep what they promise: the replay, the floor, the limits, the goal, the seed and the time."""

from __future__ import annotations

import math
import threading

import numpy as np
import pytest
from ompl import util as ou
from push_cases import HINGE, KINDS, POST, QUICK, ROBOT, ROOM, assert_keeps_the_laws, problem

from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.navigation.floor_map import FloorMap
from pbrl_control.planar import rotation
from pbrl_model.parameters import BodyParameters
from pbrl_planner.errors import PlannerError
from pbrl_planner.kinodynamic import Goal, KinodynamicSettings, PushProblem, WrenchLimits, plan_push

NEVER = Goal(lambda pose: False)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_plan_is_what_the_world_model_does_is_free_and_within_limits(kind: str, seed: int) -> None:
    asked = problem(kind, floor=FloorMap.of(ROOM, POST))
    found = plan_push(asked, seed=seed, settings=QUICK)
    assert found.plan is not None, found.reason
    assert found.reason == ""
    assert found.iterations <= QUICK.iterations
    assert_keeps_the_laws(asked, found.plan)


def test_what_holds_the_object_stays_free_too() -> None:
    narrow = {"beside": np.array([[-1.4, 0.45], [-0.2, 0.45], [-0.2, 0.7], [-1.4, 0.7]])}
    asked = problem(floor=FloorMap.of(ROOM, {**narrow, **POST}), holder=ROBOT)
    found = plan_push(asked, seed=1, settings=QUICK)
    assert found.plan is not None, found.reason
    assert_keeps_the_laws(asked, found.plan)


def test_a_hinged_object_stays_on_its_circle_and_a_pivot_on_its_point() -> None:
    for kind, centre, anchor, radius in (
        ("hinge", HINGE, (0.0, -0.3), 0.7),
        ("pivot", (-0.4, -0.3), (-0.4, -0.3), 0.0),
    ):
        found = plan_push(problem(kind), seed=3, settings=QUICK)
        assert found.plan is not None
        anchors = np.array([pose[:2] + rotation(float(pose[2])) @ anchor for pose in found.plan.poses])
        assert np.abs(np.hypot(*(anchors - centre).T) - radius).max() < 1e-3
        assert np.ptp(found.plan.poses, axis=0).max() > 0.3, "and it moved"


def test_a_wheel_that_bites_rolls_one_way_only() -> None:
    asked = problem("fixed wheel")  # it grips with 98 N, the robot pushes with 42 N at most
    found = plan_push(asked, seed=1, settings=QUICK)
    assert found.plan is not None
    for _, _, theta, vx, vy, omega in found.plan.states:
        vx, vy = rotation(theta).T @ [vx, vy]
        across = -math.sin(0.5) * vx + math.cos(0.5) * (vy + 0.3 * omega)
        assert abs(across) < 1e-9


def test_the_same_seed_gives_the_same_bytes_whatever_was_planned_before() -> None:
    first = plan_push(problem(), seed=5, settings=QUICK)
    plan_push(problem("hinge"), seed=9, settings=QUICK)
    ou.RNG.setSeed(77)
    again = plan_push(problem(), seed=5, settings=QUICK)
    other = plan_push(problem(), seed=6, settings=QUICK)
    assert first.plan is not None
    assert again.plan is not None
    assert other.plan is not None
    assert first.plan.states.tobytes() == again.plan.states.tobytes()
    assert first.plan.wrenches.tobytes() == again.plan.wrenches.tobytes()
    assert (first.iterations, first.propagations) == (again.iterations, again.propagations)
    assert first.plan.wrenches.tobytes() != other.plan.wrenches.tobytes()


def test_searches_at_once_in_two_threads_give_what_they_give_alone() -> None:
    alone = [plan_push(problem(), seed=seed, settings=QUICK).plan for seed in (1, 2)]
    together: dict[int, bytes] = {}

    def search(seed: int) -> None:
        plan = plan_push(problem(), seed=seed, settings=QUICK).plan
        assert plan is not None
        together[seed] = plan.states.tobytes()

    threads = [threading.Thread(target=search, args=(seed,)) for seed in (1, 2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for seed, plan in zip((1, 2), alone, strict=True):
        assert plan is not None
        assert together[seed] == plan.states.tobytes()


@pytest.mark.parametrize(
    "parameters",
    [
        BodyParameters(20.0, mu_ground=0.8),
        BodyParameters(400.0, wheel_x=0.3, mu_x=0.1, mu_y=0.1, mu_ground=0.05),
        BodyParameters(20.0, wheel_x=-0.4, mu_x=0.9, mu_y=0.9, hinge_x=0.4, hinge_radius=0.0, anchor_x=0.4),
    ],
    ids=["feet", "heavy, on casters and a locked one", "hinged with its brake on"],
)
def test_a_static_object_is_said_not_to_move_before_any_search(parameters: BodyParameters) -> None:
    model = ObjectModel.uniform(parameters, problem().model.footprint)
    found = plan_push(problem(model=model, goal=NEVER), seed=1, settings=QUICK)
    assert found.plan is None
    assert found.reason.startswith("no motion")
    assert found.iterations == 0
    assert found.seconds < 0.5


@pytest.mark.parametrize(("share", "moves"), [(0.99, False), (1.01, True)])
def test_an_object_is_static_up_to_its_friction_and_not_beyond(share: float, moves: bool) -> None:
    weight = 20.0 * 9.81 * 0.2
    model = ObjectModel.uniform(BodyParameters(20.0, mu_ground=0.2), problem().model.footprint)
    push = WrenchLimits(share * weight, 0.0, 0.0)
    few = KinodynamicSettings(iterations=20)
    found = plan_push(problem(model=model, limits=push, goal=NEVER), seed=1, settings=few)
    assert found.reason.startswith("no motion") is not moves


def test_an_object_walled_in_is_not_planned_for_and_the_reason_says_so() -> None:
    x, y = 0.4, 0.3
    cell = FloorMap.of(np.array([[-x, -y], [x, -y], [x, y], [-x, y]]), {})
    found = plan_push(problem(floor=cell, goal=NEVER), seed=1, settings=KinodynamicSettings(iterations=200))
    assert found.plan is None
    assert "each control tried leads into something" in found.reason


def test_the_time_limit_is_kept_and_named() -> None:
    found = plan_push(problem(goal=NEVER), seed=1, settings=KinodynamicSettings(time_limit=0.2, iterations=10**9))
    assert found.plan is None
    assert "0.2 s" in found.reason
    assert 0.2 <= found.seconds < 0.4


def test_the_iterations_are_kept_and_named() -> None:
    found = plan_push(problem(goal=NEVER), seed=1, settings=KinodynamicSettings(iterations=50))
    assert found.iterations == 50
    assert "50 iterations" in found.reason
    assert found.states <= 51


def test_an_object_that_is_there_already_needs_no_control() -> None:
    found = plan_push(problem(goal=Goal.near(np.zeros(3))), seed=1)
    assert found.plan is not None
    assert found.plan.wrenches.shape == (0, 3)
    assert found.plan.poses.shape == (1, 3)
    assert found.plan.duration == 0.0
    assert found.plan.largest_force == 0.0
    assert found.plan.cost.work == 0.0


def test_an_object_that_slides_through_its_goal_is_braked_there() -> None:
    asked = problem("free", twist=np.array([0.2, 0.0, 0.1]), goal=Goal.near(np.zeros(3), 0.3, 0.3))
    found = plan_push(asked, seed=1, settings=QUICK)
    assert found.plan is not None
    assert found.iterations == 0
    assert len(found.plan.wrenches) > 0
    assert_keeps_the_laws(asked, found.plan)


def test_a_plan_need_not_end_at_rest() -> None:
    settings = QUICK.model_copy(update={"come_to_rest": False})
    asked = problem("free")
    found = plan_push(asked, seed=2, settings=settings)
    assert found.plan is not None
    assert_keeps_the_laws(asked, found.plan, settings)
    assert np.hypot(*found.plan.states[-1, 3:5]) > QUICK.rest_speed


def test_components_that_the_robot_cannot_exert_stay_zero() -> None:
    asked = problem(limits=WrenchLimits(30.0, 0.0, 0.0), goal=Goal(lambda pose: float(pose[0]) > 0.5))
    found = plan_push(asked, seed=1, settings=QUICK)
    assert found.plan is not None
    assert not found.plan.wrenches[:, 1:].any()
    assert_keeps_the_laws(asked, found.plan)


def test_yaw_beyond_half_a_turn_comes_back_within_it() -> None:
    asked = problem(
        "free", start=np.array([0.0, 0.0, 3.1 + 4.0 * math.pi]), goal=Goal(lambda pose: -3.0 < pose[2] < -2.0)
    )
    found = plan_push(asked, seed=1, settings=QUICK)
    assert found.plan is not None
    assert_keeps_the_laws(asked, found.plan)
    assert np.abs(found.plan.poses[:, 2]).max() <= math.pi


def test_what_the_goal_raises_comes_through_and_harms_no_later_search() -> None:
    calls = []

    def breaks(pose: np.ndarray) -> bool:
        calls.append(pose)
        if len(calls) == 20:
            raise RuntimeError("the map is gone")
        return False

    before = ou.getLogLevel()
    with pytest.raises(RuntimeError, match="the map is gone"):
        plan_push(problem(goal=Goal(breaks)), seed=1)
    assert ou.getLogLevel() == before
    assert plan_push(problem(), seed=1, settings=QUICK).plan is not None


def test_a_goal_that_changes_its_mind_is_refused() -> None:
    poses: list[bytes] = []

    def once(pose: np.ndarray) -> bool:
        poses.append(pose.tobytes())
        return poses.count(poses[-1]) == 1 and len(poses) > 10

    with pytest.raises(PlannerError, match="one answer for one pose"):
        plan_push(problem(goal=Goal(once)), seed=1, settings=QUICK.model_copy(update={"come_to_rest": False}))


def test_too_fast_a_start_and_seeds_that_are_none_are_refused() -> None:
    asked: PushProblem = problem(twist=np.array([0.5, 0.0, 0.0]))
    with pytest.raises(PlannerError, match=r"twist: expected at most 0\.35 m/s"):
        plan_push(asked, seed=1)
    for seed in (0, -1, 1.5, 2**32, True, math.nan):
        with pytest.raises(PlannerError, match="seed: expected"):
            plan_push(problem(), seed=seed)  # type: ignore[arg-type]
