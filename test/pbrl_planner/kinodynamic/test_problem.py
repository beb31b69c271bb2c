"""Problems that cannot be are refused with a reason; limits and goals are what they say."""

from __future__ import annotations

import math

import numpy as np
import pytest
from push_cases import KINDS, ROBOT, ROOM, TABLE, problem
from pydantic import ValidationError

from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.navigation.floor_map import FloorMap
from pbrl_planner.errors import PlannerError
from pbrl_planner.kinodynamic import Goal, KinodynamicSettings, WrenchLimits
from pbrl_planner.kinodynamic.dynamics import PushDynamics

NAN = math.nan


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"start": np.array([NAN, 0.0, 0.0])}, "start: expected finite"),
        ({"start": np.array([0.0, math.inf, 0.0])}, "start: expected finite"),
        ({"start": np.zeros(2)}, "start: expected finite"),
        ({"contact": np.array([NAN, 0.0])}, "contact: expected finite"),
        ({"contact": np.zeros(3)}, "contact: expected finite"),
        ({"twist": np.array([0.0, 0.0, NAN])}, "twist: expected finite"),
        ({"goal": Goal(lambda pose: True, np.array([0.0, NAN, 0.0]))}, "goal: expected a finite pose"),
        ({"start": np.array([1.8, 0.0, 0.0])}, "the object would be in the walls"),
        ({"start": np.array([9.0, 0.0, 0.0])}, "the object would be in the border"),
        ({"floor": FloorMap.of(ROOM, {"sofa": TABLE})}, "the object would be in 'sofa'"),
        ({"floor": FloorMap.of(ROOM, {"sofa": 0.1 * TABLE})}, "the object would be in 'sofa'"),
        (
            {"floor": FloorMap.of(ROOM, {"lamp": 0.1 * TABLE - [0.8, 0.0]}), "holder": ROBOT},
            "the robot would be in 'lamp'",
        ),
        ({"holder": np.array([[0.0, 0.0], [1.0, NAN], [1.0, 1.0]])}, "the robot"),
        ({"holder": np.zeros((2, 2))}, "the robot"),
    ],
)
def test_a_start_that_cannot_be_is_refused(changes: dict, words: str) -> None:
    with pytest.raises(PlannerError, match=words):
        problem(**changes)


def test_a_start_off_its_hinge_is_refused_and_one_a_tag_error_off_is_not() -> None:
    with pytest.raises(PlannerError, match=r"expected the anchor 0\.700 m from its hinge, got 0\.800 m"):
        problem("hinge", start=np.array([0.0, 0.1, 0.0]))
    assert problem("hinge", start=np.array([0.0, 0.005, 0.0])).start[1] == 0.005


def test_touching_a_wall_is_no_collision_and_a_millimetre_in_it_is() -> None:
    for angle in (0.0, math.pi / 2.0, math.pi):
        half = 0.4 if angle != math.pi / 2.0 else 0.3
        assert problem(start=np.array([2.0 - half, 0.0, angle])).start[0] == 2.0 - half
        with pytest.raises(PlannerError, match="would be in the walls"):
            problem(start=np.array([2.0 - half + 1e-3, 0.0, angle]))


@pytest.mark.parametrize("values", [(0, 0, 0), (NAN, 1, 1), (1, math.inf, 1), (-1, 1, 1), (None, 1, 1)])
def test_limits_that_are_none_are_refused(values: tuple) -> None:
    with pytest.raises(PlannerError, match="limits: expected finite"):
        WrenchLimits(*values)


@pytest.mark.parametrize("changes", [{"acceleration": 0.0}, {"most": NAN}, {"torque": -1.0}, {"most": math.inf}])
def test_limits_are_not_chosen_by_numbers_that_are_none(changes: dict) -> None:
    with pytest.raises(PlannerError, match="limits: expected"):
        WrenchLimits.to_move(problem().model, **changes)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in ("hinge", "pivot")])
def test_chosen_limits_move_what_they_are_chosen_for(kind: str) -> None:
    model = ObjectModel.uniform(KINDS[kind], TABLE)
    limits = WrenchLimits.to_move(model)
    assert not PushDynamics(problem(kind, limits=limits), KinodynamicSettings()).is_stuck()
    assert limits.force_x >= model.mass * 0.5
    capped = WrenchLimits.to_move(model, most=5.0, torque=1.0)
    assert (capped.array <= [5.0, 5.0, 1.0]).all()


def test_a_goal_near_a_pose_knows_that_angles_wrap() -> None:
    goal = Goal.near(np.array([1.0, 2.0, math.pi - 0.05]), 0.1, 0.2)
    assert goal.reached(np.array([1.0, 2.09, -math.pi + 0.1]))
    assert not goal.reached(np.array([1.0, 2.11, math.pi - 0.05]))
    assert not goal.reached(np.array([1.0, 2.0, -math.pi + 0.2]))
    assert Goal.near(np.zeros(3), 0.1, math.inf).reached(np.array([0.0, 0.0, 3.0]))


@pytest.mark.parametrize(
    ("pose", "distance", "angle"), [((0, 0, NAN), 0.1, 0.1), ((0, 0), 0.1, 0.1), ((0, 0, 0), 0, 1), ((0, 0, 0), 1, NAN)]
)
def test_goals_that_are_none_are_refused(pose: tuple, distance: float, angle: float) -> None:
    with pytest.raises(PlannerError, match="goal: expected"):
        Goal.near(np.array(pose, dtype=float), distance, angle)


@pytest.mark.parametrize(
    "changes",
    [
        {"dt": NAN},
        {"time_limit": math.inf},
        {"iterations": 0},
        {"goal_bias": 1.0},
        {"shortest": 5, "longest": 4},
        {"spede": 1},
    ],
)
def test_settings_that_are_none_are_refused(changes: dict) -> None:
    with pytest.raises(ValidationError):
        KinodynamicSettings(**changes)
