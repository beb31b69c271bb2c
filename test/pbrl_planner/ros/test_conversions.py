"""Messages there and back, through the wire's format; and what is none, in words."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TransformStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from pbrl_msgs.msg import CartPath
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from pbrl_planner.costmap import INSCRIBED, LETHAL, UNKNOWN, CostField
from pbrl_planner.errors import PlannerError
from pbrl_planner.ros.conversions import (
    HEARD,
    TOLD,
    field_from_msg,
    field_to_msg,
    map_from_msg,
    motion_from_msg,
    path_from_msg,
    path_to_msg,
    planar_pose,
    pose_in_map,
    pose_to_msg,
    scan_from_msg,
    stamp_of,
)
from pbrl_planner.ros.frames import Frames, NotYetError


def over_the_wire(message: Any) -> Any:
    return deserialize_message(serialize_message(message), type(message))


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(11)


def test_costs_are_told_as_nav2_tells_them_and_none_gets_cheaper_than_its_neighbour() -> None:
    assert TOLD[[0, INSCRIBED, LETHAL, UNKNOWN]].tolist() == [0, 99, 100, -1]
    free = TOLD[:INSCRIBED]
    assert free.min() == 0 and free.max() == 98 and (np.diff(free) >= 0).all()
    back = HEARD[TOLD.view(np.uint8)]
    assert back[[0, INSCRIBED, LETHAL, UNKNOWN]].tolist() == [0, INSCRIBED, LETHAL, UNKNOWN]
    assert (back <= np.arange(256)).all() and (np.arange(256) - back <= 3).all()
    assert (TOLD[back] == TOLD).all(), "what is told again is told alike"
    assert HEARD[101:255].tolist() == [UNKNOWN] * 154, "what nobody tells is not known"


@pytest.mark.parametrize("resolution", [0.025, 0.05, 0.1, 1 / 30])
def test_costmaps_come_back(resolution: float, rng: np.random.Generator) -> None:
    cells = HEARD[TOLD[rng.integers(0, 256, (7, 11))].view(np.uint8)]
    sent = CostField(cells, resolution, (-3.25, 4.5), 12.34)
    got = field_from_msg(over_the_wire(field_to_msg(sent)))
    assert np.array_equal(got.cells, cells) and got.origin == sent.origin
    assert got.resolution == pytest.approx(resolution, rel=1e-6) and got.time == pytest.approx(12.34, abs=1e-9)
    never = field_from_msg(field_to_msg(CostField(cells, resolution, (0.0, 0.0), -math.inf)))
    assert never.time == -math.inf


@pytest.mark.parametrize("resolution", [0.025, 0.05])
def test_a_cells_size_is_what_was_meant_and_not_its_float(resolution: float) -> None:
    message = field_to_msg(CostField(np.zeros((3, 3), np.uint8), resolution, (0.0, 0.0), 1.0))
    assert field_from_msg(over_the_wire(message)).resolution == resolution


def test_paths_come_back(rng: np.random.Generator) -> None:
    headings, bends = np.cumsum(rng.uniform(-0.5, 0.9, 40)), rng.uniform(-0.4, 0.4, 40)
    poses = np.column_stack((rng.normal(0, 5, (40, 2)), headings, bends))
    got = path_from_msg(over_the_wire(path_to_msg(poses, 3.0)))
    turns = (got[:, 2] - poses[:, 2]) / (2 * np.pi)
    assert np.allclose(turns, round(turns[0]), atol=1e-9), "headings go on without jumps"
    assert np.allclose(got[:, [0, 1, 3]], poses[:, [0, 1, 3]])


def test_stamps_are_exact_and_nothing_before_time() -> None:
    assert (stamp_of(1.0000000009).sec, stamp_of(1.0000000009).nanosec) == (1, 1)
    assert stamp_of(0.9999999999).sec == 1 and stamp_of(-math.inf).sec == stamp_of(-1.0).nanosec == 0


def leaning() -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id = "map"
    message.pose.orientation.x = message.pose.orientation.w = math.sqrt(0.5)
    return message


def test_what_is_no_pose_on_the_floor_is_refused() -> None:
    with pytest.raises(PlannerError, match="upright"):
        pose_in_map(leaning(), "goal")
    empty = PoseStamped()
    empty.header.frame_id, empty.pose.orientation.w = "map", 0.0
    with pytest.raises(PlannerError, match="length 1, got length 0"):
        pose_in_map(empty, "goal")
    away = PoseStamped(pose=pose_to_msg(np.array([math.inf, 0.0, 0.0])))
    with pytest.raises(PlannerError, match="finite"):
        planar_pose(away.pose, "goal")
    with pytest.raises(PlannerError, match="frame 'map', got ''"):
        pose_in_map(away, "goal")


def test_what_is_no_map_is_refused() -> None:
    message = OccupancyGrid()
    message.info.origin.orientation.w = 1.0
    with pytest.raises(PlannerError, match="one at least"):
        map_from_msg(message)
    message.info.width = message.info.height = 2
    message.data = [0, 0, 0]
    with pytest.raises(PlannerError, match=r"2 by 2 cells.*got 3"):
        map_from_msg(message)
    message.data = [0, 0, 0, 100]
    with pytest.raises(PlannerError, match="resolution"):
        map_from_msg(message)
    message.info.resolution = 0.1
    assert map_from_msg(message).cells.tolist() == [[0, 0], [0, 100]]
    message.header.frame_id = "odom"
    with pytest.raises(PlannerError, match="frame 'map', got 'odom'"):
        field_from_msg(message)
    message.header.frame_id = "map"
    message.info.origin.orientation.z = message.info.origin.orientation.w = math.sqrt(0.5)
    with pytest.raises(PlannerError, match="turned"):
        field_from_msg(message)


def test_what_is_no_scan_path_or_odometry_is_refused() -> None:
    with pytest.raises(PlannerError, match="span"):
        scan_from_msg(LaserScan(ranges=[1.0], range_min=2.0, range_max=1.0))
    with pytest.raises(PlannerError, match="frame 'map'"):
        path_from_msg(CartPath())
    short = path_to_msg(np.zeros((3, 4)), 1.0)
    short.articulation = [0.0]
    with pytest.raises(PlannerError, match="got 1 for 3"):
        path_from_msg(short)
    wild = Odometry()
    wild.pose.pose.orientation.w = 1.0
    wild.twist.twist.linear.x = math.nan
    with pytest.raises(PlannerError, match="finite twist"):
        motion_from_msg(wild)


def frame(parent: str, child: str, x: float, yaw: float = 0.0, lean: float = 0.0) -> TransformStamped:
    each = TransformStamped(child_frame_id=child)
    each.header.frame_id = parent
    each.transform.translation.x = x
    q = each.transform.rotation
    q.z, q.w = math.sin(yaw / 2) * math.cos(lean / 2), math.cos(yaw / 2) * math.cos(lean / 2)
    q.x, q.y = math.cos(yaw / 2) * math.sin(lean / 2), math.sin(yaw / 2) * math.sin(lean / 2)
    return each


def test_frames_are_chained_from_base_to_the_sensor() -> None:
    frames = Frames()
    with pytest.raises(PlannerError, match="'laser': expected its place in 'base'"):
        frames.planar("laser", "base")
    frames.hear(
        TFMessage(transforms=[frame("base", "mast", 1.0, math.pi / 2), frame("mast", "laser", 0.5, math.pi / 2)])
    )
    assert frames.planar("laser", "base") == pytest.approx([1.0, 0.5, math.pi])
    frames.hear(TFMessage(transforms=[frame("mast", "laser", 0.5, 0.0, lean=0.3)]))
    with pytest.raises(PlannerError, match="level"):
        frames.planar("laser", "base")
    frames.hear(TFMessage(transforms=[frame("laser", "mast", 0.0)]))
    with pytest.raises(PlannerError, match="expected its place"):
        frames.planar("laser", "base")  # a ring


def test_of_a_frame_that_moves_the_pose_at_a_time_lies_between_two() -> None:
    frames = Frames()
    frames.hear(TFMessage(transforms=[frame("base", "mast", 1.0)]))

    def nod(time: float, lean: float) -> None:
        each = frame("mast", "laser", 0.5 + time, lean=lean)
        each.header.stamp = stamp_of(time)
        frames.hear_moving(TFMessage(transforms=[each]))

    nod(1.0, 0.2)
    with pytest.raises(NotYetError, match=r"heard it until 1\.000 s"):
        frames.pose("laser", "base", 1.01)
    nod(1.02, 0.4)
    found = frames.pose("laser", "base", 1.005)
    assert found[:3, 3] == pytest.approx([2.505, 0.0, 0.0]) and math.acos(found[1, 1]) == pytest.approx(0.25)
    assert math.acos(frames.pose("laser", "base")[1, 1]) == pytest.approx(0.4), "the newest, where no time is told"
    with pytest.raises(PlannerError, match="nobody has said it"):
        frames.pose("laser", "base", 0.9)
    nod(9.0, 0.2)
    with pytest.raises(PlannerError, match="nobody has said it"):
        frames.pose("laser", "base", 5.0)  # too long between two
    nod(0.5, 0.3)  # the clock has begun again
    assert math.acos(frames.pose("laser", "base", 0.5)[1, 1]) == pytest.approx(0.3)
    with pytest.raises(NotYetError):
        frames.pose("laser", "base", 1.0)
