"""Messages of navigation among movable obstacles: every message goes through its wire form first."""

from __future__ import annotations

import math

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose2D, PoseStamped
from pbrl_msgs.msg import Body, ObjectModel, Scene
from rclpy.serialization import deserialize_message, serialize_message

from pbrl_model.errors import ModelError
from pbrl_model.parameters import UNITS
from pbrl_namo.errors import NamoError
from pbrl_namo.executive import Account, Choice, Event, NamoStatus, State
from pbrl_namo.executive.account import Change
from pbrl_namo.ros import conversions

CORNERS = ((-0.5, -0.4), (0.5, -0.4), (0.5, 0.4), (-0.5, 0.4))


def wired(message):
    return deserialize_message(serialize_message(message), type(message))


def status(**changes) -> NamoStatus:
    plain = {
        "state": State.CLEAR,
        "sentence": "moving",
        "finished": False,
        "success": False,
        "goal": np.array([5.0, -1.0, math.nan]),
        "object": "table_a",
        "region": 0,
        "target": 1,
        "regions": 3,
        "cut_off": (2,),
        "choices": (Choice("table_a", 0, 1, 0.75, -12.5), Choice("table_b", 0, 2, np.float64(0.5), np.float64(-30.0))),
        "expected_force": 40.0,
        "force_limit": np.float64(60.0),
        "felt_force": math.nan,
        "rows": {},
        "seconds": {**dict.fromkeys(State, 0.0), State.LOOK: 1.5},
        "notes": ("table_c is left alone",),
    }
    return NamoStatus(**{**plain, **changes})


def scene(mass: float = 33.0, movable: bool = True) -> Scene:
    points = [Point(x=x, y=y) for x, y in CORNERS]
    return Scene(bodies=[Body(name="table_a", footprint=points, height=0.75, nominal_mass=mass, movable=movable)])


def model(names: tuple[str, ...] = ("mass", "mu_ground"), rows: int = 3, **changes) -> ObjectModel:
    samples = np.tile([30.0, 0.02][: len(names)], rows).tolist()
    plain = {
        "object": "table_a",
        "model_class": "free",
        "parameters": list(names),
        "units": [UNITS[name] for name in names],
        "draws": rows,
        "samples": samples,
    }
    return wired(ObjectModel(**{**plain, **changes}))


def test_a_status_reaches_the_wire_whole() -> None:
    account = Account(planning_seconds=2.5, learning_seconds=7.0)
    account.note(Change(1.0, State.PLANNING, Event.PLANNED, State.GET_GRASP_POINT, "planned"))
    account.note(Change(2.0, State.CLEAR, Event.STALLED, State.UPDATE_MODEL, "stalled"))
    account.note(Change(3.0, State.UPDATE_MODEL, Event.UPDATED, State.RELEASE, "updated"))
    message = wired(conversions.status_to_msg(status(), account, Time(sec=4)))
    assert (message.header.stamp.sec, message.header.frame_id) == (4, "world")
    assert (message.state, message.sentence, message.object) == ("ClearObstacle", "moving", "table_a")
    assert (message.finished, message.success) == (False, False)
    assert (message.goal.x, message.goal.y) == (5.0, -1.0)
    assert math.isnan(message.goal.theta)
    assert (message.region, message.target_region, message.regions, list(message.cut_off)) == (0, 1, 3, [2])
    assert list(message.opening_object) == ["table_a", "table_b"]
    assert (list(message.opening_from), list(message.opening_to)) == ([0, 0], [1, 2])
    assert (list(message.opening_probability), list(message.opening_value)) == ([0.75, 0.5], [-12.5, -30.0])
    assert (message.expected_force, message.force_limit) == (40.0, 60.0)
    assert math.isnan(message.felt_force)
    assert (message.plans, message.surprises, message.updates, message.repairs, message.openings) == (1, 1, 1, 0, 0)
    assert (message.planning_seconds, message.learning_seconds) == (2.5, 7.0)
    assert dict(zip(message.state_names, message.state_seconds, strict=True)) == {"Look": 1.5, "ClearObstacle": 0.0}
    assert list(message.notes) == ["table_c is left alone"]


def test_nothing_planned_reaches_the_wire_too() -> None:
    bare = status(region=-1, target=-1, regions=0, cut_off=(), choices=(), object="", notes=(), state=State.LOOK)
    message = wired(conversions.status_to_msg(bare, Account(), Time()))
    assert (message.region, message.target_region, list(message.opening_object)) == (-1, -1, [])


def test_a_goal_of_any_heading_stays_one() -> None:
    goal = conversions.goal_from_pose2d(wired(Pose2D(x=1.0, y=2.0, theta=math.nan)))
    np.testing.assert_array_equal(goal, [1.0, 2.0, math.nan])


@pytest.mark.parametrize("numbers", [(math.nan, 0.0, 0.0), (0.0, math.inf, 0.0), (0.0, 0.0, math.inf)])
def test_a_goal_that_is_no_place_is_refused(numbers: tuple[float, ...]) -> None:
    x, y, theta = numbers
    with pytest.raises(NamoError, match="expected"):
        conversions.goal_from_pose2d(Pose2D(x=x, y=y, theta=theta))


def drawn(yaw: float = 0.3, frame: str = "world", length: float = 1.0) -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id = frame
    message.pose.position.x, message.pose.position.y = 1.0, -2.0
    message.pose.orientation.z, message.pose.orientation.w = length * math.sin(yaw / 2), length * math.cos(yaw / 2)
    return wired(message)


@pytest.mark.parametrize("yaw", [0.0, 0.3, -3.0, math.pi])
def test_a_goal_drawn_by_a_person_keeps_its_heading(yaw: float) -> None:
    np.testing.assert_allclose(conversions.goal_from_pose(drawn(yaw)), [1.0, -2.0, yaw], atol=1e-12)


@pytest.mark.parametrize(
    ("message", "word"),
    [(drawn(frame="map"), "'map'"), (drawn(frame=""), "''"), (drawn(length=0.0), "length 0"), (PoseStamped(), "''")],
)
def test_a_goal_in_another_frame_or_without_a_heading_is_refused(message: PoseStamped, word: str) -> None:
    with pytest.raises(NamoError, match=word):
        conversions.goal_from_pose(message)


def test_a_quaternion_that_is_none_is_refused() -> None:
    with pytest.raises(NamoError, match="quaternion"):
        conversions.goal_from_pose(drawn(length=math.nan))


def test_a_goal_in_words() -> None:
    np.testing.assert_array_equal(conversions.goal_from_text("5.0 -1"), [5.0, -1.0, math.nan])
    np.testing.assert_array_equal(conversions.goal_from_text("5.0, 0, 1.5"), [5.0, 0.0, 1.5])


@pytest.mark.parametrize("text", ["", "5", "1 2 3 4", "here", "1 there", "nan 0", "inf 0"])
def test_words_that_are_no_goal_are_refused(text: str) -> None:
    with pytest.raises(NamoError, match="goal"):
        conversions.goal_from_text(text)


def test_masses_by_name() -> None:
    assert conversions.masses_from_msg(wired(scene())) == {"table_a": 33.0}
    assert math.isnan(conversions.masses_from_msg(wired(scene(math.nan)))["table_a"])


def test_what_others_have_learned_is_believed() -> None:
    belief = conversions.belief_from_msg(model(), wired(scene()))
    assert belief is not None
    np.testing.assert_array_equal(belief.footprint, CORNERS)
    (found,) = belief.models(np.random.default_rng(0), 1)
    assert (found.parameters.mass, found.parameters.mu_ground) == (30.0, 0.02)


def test_no_more_draws_are_kept_than_are_needed() -> None:
    belief = conversions.belief_from_msg(model(rows=3 * conversions.KEPT_DRAWS), scene())
    assert belief is not None
    assert len(belief.rows) == conversions.KEPT_DRAWS


@pytest.mark.parametrize("where", [Scene(), scene(movable=False)])
def test_of_what_is_not_there_or_built_in_nothing_is_believed(where: Scene) -> None:
    assert conversions.belief_from_msg(model(), where) is None


@pytest.mark.parametrize(
    "message",
    [
        model(samples=[1.0]),
        model(units=["kg", "kg"]),
        model(parameters=["mass", "colour"]),
        model(samples=[math.nan] * 6),
        model(samples=[-1.0, 0.02] * 3),
    ],
)
def test_a_model_that_is_none_is_refused(message: ObjectModel) -> None:
    with pytest.raises((ModelError, NamoError)):
        conversions.belief_from_msg(message, scene())
