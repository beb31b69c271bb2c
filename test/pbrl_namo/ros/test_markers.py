"""What is drawn: everything that the status speaks of, where it is, and nothing that is over."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message, serialize_message
from visualization_msgs.msg import Marker, MarkerArray

from pbrl_control.planar import compose
from pbrl_namo.executive import Choice, Move, NamoStatus, State
from pbrl_namo.regions import free_space
from pbrl_namo.ros.markers import CUT_OFF, HERE, WANTED, Drawing, Floor, draw, poses_along
from pbrl_namo.scene import Movable, NamoScene

SHAPE = np.array([[-0.375, -1.45], [0.375, -1.45], [0.375, 1.45], [-0.375, 1.45]])
ROOM = np.array([[-3.0, -1.5], [3.0, -1.5], [3.0, 1.5], [-3.0, 1.5]])
SCENE = NamoScene.of(
    ROOM, {}, {"table": Movable(SHAPE)}, {"table": np.zeros(3)}, np.array([-2.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0])
)
FLOOR = Floor(SCENE, free_space(SCENE, 0.52).regions)
MOVE = Move(
    "table",
    ((np.array([0.1, 0.0, 0.0]), 5.0),),
    np.array([-0.375, 0.0]),
    0,
    1,
    np.zeros((0, 2)),
    (),
    40.0,
    None,
    "free",
)
STATUS = NamoStatus(
    State.CLEAR,
    "moving",
    False,
    False,
    np.array([2.0, 0.0, math.nan]),
    "table",
    0,
    1,
    2,
    (),
    (Choice("table", 0, 1, 0.75, -12.5), Choice("gone", 0, 1, 0.5, -1.0)),
    math.nan,
    60.0,
    25.0,
    {},
    dict.fromkeys(State, 0.0),
    (),
)


def by_name(markers: list[Marker]) -> dict[tuple[str, int], Marker]:
    found = {(marker.ns, marker.id): marker for marker in markers}
    assert len(found) == len(markers), "two markers of one name: RViz shows one of them"
    return found


def corners(marker: Marker) -> np.ndarray:
    return np.array([[point.x, point.y] for point in marker.points])


def test_regions_are_drawn_where_they_are_and_coloured_by_what_they_are_for() -> None:
    assert len(FLOOR.regions) == 2
    found = by_name(draw(replace(STATUS, cut_off=()), MOVE, FLOOR))
    for number, color in ((0, HERE), (1, WANTED)):
        marker = found["namo/regions", number]
        assert marker.color == color
        points = corners(marker)
        assert len(points) % 2 == 0, "a list of lines has two ends for each"
        np.testing.assert_allclose([*points.min(axis=0), *points.max(axis=0)], FLOOR.regions[number].bounds, atol=1e-12)
        assert found["namo/region_names", number].text == f"region {number}"
    cut = by_name(draw(replace(STATUS, target=-1, cut_off=(1,)), MOVE, FLOOR))
    assert cut["namo/regions", 1].color == CUT_OFF


def test_regions_of_another_plan_bear_no_numbers() -> None:
    found = by_name(draw(replace(STATUS, regions=5), MOVE, FLOOR))
    assert ("namo/regions", 0) in found
    assert not [name for name in found if name[0] == "namo/region_names"]


def test_a_hole_in_a_region_is_drawn_too() -> None:
    small = NamoScene.of(
        4.0 * ROOM, {}, {"table": Movable(0.5 * SHAPE)}, {"table": np.zeros(3)}, np.array([-5.0, 0, 0]), np.zeros(3)
    )
    (region,) = free_space(small, 0.52).regions
    marker = by_name(draw(replace(STATUS, regions=1), None, Floor(small, (region,))))["namo/regions", 0]
    edges = len(region.exterior.coords) - 1 + sum(len(ring.coords) - 1 for ring in region.interiors)
    assert len(region.interiors) == 1
    assert len(marker.points) == 2 * edges


def test_q_values_stand_on_what_is_there() -> None:
    found = by_name(draw(STATUS, MOVE, FLOOR))
    (values,) = [marker for (ns, _), marker in found.items() if ns == "namo/values"]
    assert values.text == "table\n0 to 1: Q -12.5, p 0.75"
    assert (values.pose.position.x, values.pose.position.y) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_the_chosen_obstacle_its_way_and_its_forces() -> None:
    found = by_name(draw(STATUS, MOVE, FLOOR))
    assert len(corners(found["namo/chosen", 0])) == 5
    np.testing.assert_allclose(
        corners(found["namo/planned", 0]), corners(found["namo/chosen", 0]) + np.array([0.5, 0.0])
    )
    np.testing.assert_allclose(corners(found["namo/planned", 1])[[0, -1]], [[0.0, 0.0], [0.5, 0.0]])
    text = found["namo/forces", 0].text.splitlines()
    assert text == ["table: free", "expected 40 N", "limit 60 N", "felt 25 N"]
    follower = by_name(draw(replace(STATUS, expected_force=33.0, felt_force=math.nan), MOVE, FLOOR))
    assert follower["namo/forces", 0].text.splitlines() == ["table: free", "expected 33 N", "limit 60 N"]


@pytest.mark.parametrize(
    ("status", "move"),
    [
        (replace(STATUS, object=""), MOVE),
        (STATUS, None),
        (replace(STATUS, object="gone"), replace(MOVE, object="gone")),
    ],
)
def test_what_is_not_at_hand_or_not_there_is_not_drawn(status: NamoStatus, move: Move | None) -> None:
    names = {ns for ns, _ in by_name(draw(status, move, FLOOR))}
    assert not names & {"namo/chosen", "namo/planned", "namo/forces"}


def test_before_the_first_plan_there_is_the_goal_only() -> None:
    (goal,) = draw(STATUS, None, None)
    assert (goal.ns, goal.type) == ("namo/goal", Marker.CYLINDER)
    (heading,) = draw(replace(STATUS, goal=np.array([1.0, 2.0, math.pi / 2])), None, None)
    assert heading.type == Marker.ARROW
    np.testing.assert_allclose(corners(heading), [[1.0, 2.0], [1.0, 2.5]], atol=1e-12)


def test_a_way_of_constant_twist_is_an_arc_however_it_is_cut() -> None:
    twist, pose = np.array([0.1, -0.05, 0.4]), np.array([1.0, 2.0, 0.7])
    whole = poses_along(replace(MOVE, segments=((twist, 2.0),)), pose)
    parts = poses_along(replace(MOVE, segments=((twist, 0.55), (twist, 1.45))), pose)
    np.testing.assert_allclose(whole[-1], parts[-1], atol=1e-12)
    np.testing.assert_allclose(whole[0], pose)
    # The point that stays where it is while the thing turns.
    centre = np.array([-twist[1], twist[0]]) / twist[2]
    still = [compose(each, np.array([*centre, 0.0]))[:2] for each in whole]
    np.testing.assert_allclose(still, np.tile(still[0], (len(still), 1)), atol=1e-12)
    assert whole[-1, 2] == pytest.approx(pose[2] + 0.8)


def test_what_is_over_is_taken_away_and_nothing_of_others() -> None:
    drawing = Drawing()
    first = drawing.update(draw(STATUS, MOVE, FLOOR), Time(sec=1))
    assert all(marker.action == Marker.ADD for marker in first.markers)
    second = drawing.update(draw(STATUS, None, None), Time(sec=2))
    gone = {(marker.ns, marker.id) for marker in second.markers if marker.action == Marker.DELETE}
    assert gone == {(marker.ns, marker.id) for marker in first.markers} - {("namo/goal", 0)}
    assert {marker.ns.split("/")[0] for marker in second.markers} == {"namo"}
    third = drawing.update(draw(STATUS, None, None), Time(sec=3))
    assert [marker.action for marker in third.markers] == [Marker.ADD]
    assert drawing.update([], Time()).markers[0].action == Marker.DELETE
    assert drawing.update([], Time()).markers == []


def test_all_of_it_can_be_shown() -> None:
    message = Drawing().update(draw(STATUS, MOVE, FLOOR), Time(sec=5))
    again = deserialize_message(serialize_message(message), MarkerArray)
    assert len(again.markers) == len(message.markers)
    for marker in again.markers:
        assert (marker.header.frame_id, marker.header.stamp.sec) == ("world", 5)
        assert marker.pose.orientation.w == 1.0
        assert marker.color.a > 0.0
        assert marker.scale.x > 0.0 or marker.type == Marker.TEXT_VIEW_FACING
