"""A trajectory as the course of a manipulation: it sets out where the object is, and says what it expects to feel."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.constraints.wrench import total_wrench
from pbrl_control.errors import ControlError
from pbrl_control.percept import Grip, Percept, Tag
from pbrl_control.trajectories.course import TrajectoryCourse
from pbrl_control.trajectories.trajectory_plan import TrajectoryPlan
from pbrl_control.types import Hold
from pbrl_model.kernel import GRAVITY
from pbrl_model.parameters import BodyParameters

TABLE = np.array([[-0.375, -0.75], [0.375, -0.75], [0.375, 0.75], [-0.375, 0.75]])
PLAN = TrajectoryPlan.model_validate(
    {
        "name": "t",
        "object": "table",
        "grips": [{"gripper": "left", "point": [-0.375, 0.2]}, {"gripper": "right", "point": [-0.375, -0.2]}],
        "waypoints": [[0.6, 0.0, 0.0]],
    }
)
GRIPS = {side: Grip("table", np.array([-0.375, y])) for side, y in (("left", 0.2), ("right", -0.2))}
HOLD = Hold("table", np.array([-0.375, 0.2]))
CALM = {"left": 0.0, "right": 0.0}
START = np.array([1.0, 2.0, 0.5])


def seen(now: float, pose: np.ndarray) -> Percept:
    quaternion = np.array([0.0, 0.0, np.sin(pose[2] / 2), np.cos(pose[2] / 2)])
    return Percept(None, {"table": Tag(now, np.array([pose[0], pose[1], 0.78]), quaternion)}, {}, GRIPS, {})


def test_it_sets_out_from_where_the_object_is() -> None:
    course = TrajectoryCourse(PLAN)
    assert course.follower is None
    step = course.step(0.0, 0.01, seen(0.0, START), HOLD, CALM)
    assert course.follower is not None
    np.testing.assert_allclose(course.follower.trajectory.at(0.0).pose, START, atol=1e-9)
    assert not step.finished
    assert step.expected == {}, "nothing is known of the object"


def test_without_a_tag_it_waits_at_rest() -> None:
    step = TrajectoryCourse(PLAN).step(0.0, 0.01, Percept(None, {}, {}, GRIPS, {}), HOLD, CALM)
    assert not step.twist.moves()


def test_with_a_model_that_is_none_it_does_not_set_out() -> None:
    course = TrajectoryCourse(PLAN)
    course.refused = "model of 'table': expected a mass above zero"
    with pytest.raises(ControlError, match="expected a mass above zero"):
        course.step(0.0, 0.01, seen(0.0, START), HOLD, CALM)
    assert course.follower is None


def test_with_a_model_it_says_what_the_grips_have_to_apply() -> None:
    model = ObjectModel.uniform(BodyParameters(mass=30.0, mu_ground=0.05), TABLE)
    course = TrajectoryCourse(PLAN, model)
    pose, now = START.copy(), 0.0
    for _ in range(300):
        step = course.step(now, 0.01, seen(now, pose), HOLD, CALM)
        twist, c, s = step.twist.array(), np.cos(pose[2]), np.sin(pose[2])
        pose = pose + 0.01 * np.array([c * twist[0] - s * twist[1], s * twist[0] + c * twist[1], twist[2]])
        now += 0.01
    contacts = np.array([GRIPS[side].contact for side in sorted(step.expected)])
    whole = total_wrench(contacts, np.array([step.expected[side] for side in sorted(step.expected)]), model.com)
    np.testing.assert_allclose(whole, [0.05 * 30.0 * GRAVITY, 0.0, 0.0], atol=0.3)


def test_what_ends_it_early_is_raised() -> None:
    course = TrajectoryCourse(PLAN)
    course.step(0.0, 0.01, seen(0.0, START), HOLD, CALM)
    with pytest.raises(ControlError, match="lost tag"):
        course.step(5.0, 0.01, seen(0.0, START), HOLD, CALM)
