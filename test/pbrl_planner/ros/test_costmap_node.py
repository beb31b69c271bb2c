"""Costmaps over DDS: what a scan says, without robot and cart, on the map; and what is left aside, in words."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose2D, TransformStamped
from nav_msgs.msg import OccupancyGrid
from pbrl_msgs.msg import Body
from sensor_msgs.msg import LaserScan
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from pbrl_control.ros.qos import LATCHED
from pbrl_planner.costmap import LETHAL, CostField
from pbrl_planner.ros.conversions import field_from_msg, stamp_of
from pbrl_planner.ros.costmap_node import CostmapNode

LASER = np.array([0.275, 0.0, 0.0])
FAR = 1.2
"""From the laser to what stands to either side [m]."""


def scan(time: float, aside: float = FAR) -> LaserScan:
    """Half a turn: the cart 0.4 m ahead, something to either side at a distance [m]."""
    ranges = np.full(181, np.inf)
    ranges[80:101], ranges[:5], ranges[-5:] = 0.4, aside, aside
    message = LaserScan(angle_min=-np.pi / 2, angle_max=np.pi / 2, angle_increment=np.pi / 180)
    message.header.frame_id, message.header.stamp = "base_laser_link", stamp_of(time)
    message.range_min, message.range_max, message.ranges = 0.1, 30.0, ranges.tolist()
    return message


def room() -> OccupancyGrid:
    """A map of 6 by 3 m with a wall along its far end."""
    cells = np.zeros((60, 120), np.int8)
    cells[:, -2:] = 100
    message = OccupancyGrid()
    message.header.frame_id = "map"
    message.info.height, message.info.width = cells.shape
    message.info.resolution, message.info.origin.orientation.w = 0.05, 1.0
    message.data = cells.ravel().tolist()
    return message


class Mapping:
    def __init__(self, stage: Any) -> None:
        self.stage = stage
        self.node = stage.add(CostmapNode)
        self.local = stage.hear(OccupancyGrid, "/local_costmap/costmap", LATCHED)
        self.whole = stage.hear(OccupancyGrid, "/global_costmap/costmap", LATCHED)

    def look(self, **changes: float) -> CostField:
        """Scan; return the local costmap that comes of it."""
        self.stage.tick()
        message = scan(self.stage.time, **changes)
        self.stage.send("/scan", message)
        self.stage.until(lambda: self.local and self.local[-1].header.stamp == message.header.stamp)
        return field_from_msg(self.local[-1])


@pytest.fixture
def mapping(stage: Any) -> Mapping:
    made = Mapping(stage)
    stage.tell_laser("base_laser_link", LASER)
    stage.send("/map", room(), LATCHED)
    stage.track(made.node.tracker)
    return made


def test_what_is_seen_is_marked_and_the_cart_is_not(mapping: Mapping) -> None:
    field = mapping.look()
    assert field.time == pytest.approx(mapping.stage.time)
    x, y = mapping.stage.pose[:2] + LASER[:2]
    assert field.cost(x, y + FAR) == field.cost(x, y - FAR) == LETHAL
    assert field.cost(x + 0.4, y) != LETHAL and field.cost(x, y + 0.5) == 0
    assert field.cost(5.95, 1.5) in (LETHAL, 255), "outside of the window, or the map's wall"
    before = len(mapping.whole)
    # A message of the clock may be lost: time goes on until the whole floor is told of.
    mapping.stage.until(lambda: mapping.stage.tick(0.3) or len(mapping.whole) > before)
    whole = field_from_msg(mapping.whole[-1])
    assert whole.cost(x, y + FAR) == whole.cost(5.95, 1.5) == LETHAL and whole.cost(4.5, 0.5) == 0
    assert whole.time == pytest.approx(field.time), "stamped as the last scan in it"


def test_an_old_costmap_looks_old(mapping: Mapping) -> None:
    seen = mapping.look().time
    for _ in range(20):
        mapping.stage.tick(0.1)
    before = len(mapping.whole)
    mapping.stage.until(lambda: mapping.stage.tick(0.3) or len(mapping.whole) > before)
    assert field_from_msg(mapping.whole[-1]).time == pytest.approx(seen)


def test_a_place_that_is_kept_out_of_is_lethal_though_nothing_is_seen_there(mapping: Mapping) -> None:
    x, y = mapping.stage.pose[:2]
    assert mapping.look().cost(x + 0.4, y + 0.6) < LETHAL
    square = [Point(x=side_x, y=side_y) for side_x, side_y in ((0.0, 0.0), (0.2, 0.0), (0.2, 0.2), (0.0, 0.2))]
    place = Body(name="keep_out_0", footprint=square, height=3.0, pose=Pose2D(x=x + 0.3, y=y + 0.5))
    mapping.stage.tell_cart(("left", "right"), place)
    mapping.stage.until(lambda: mapping.node.tracker.kept_out)
    assert mapping.look().cost(x + 0.4, y + 0.6) == LETHAL
    before = len(mapping.whole)
    mapping.stage.until(lambda: mapping.stage.tick(0.3) or len(mapping.whole) > before)
    assert field_from_msg(mapping.whole[-1]).cost(x + 0.4, y + 0.6) == LETHAL


def test_what_was_seen_once_can_be_cleared(mapping: Mapping) -> None:
    field = mapping.look()
    x, y = mapping.stage.pose[:2] + LASER[:2]
    assert field.cost(x, y + FAR) == LETHAL
    client = mapping.stage.node.create_client(Trigger, "/costmaps/clear")
    mapping.stage.until(client.service_is_ready)
    called = client.call_async(Trigger.Request())
    mapping.stage.until(called.done)
    assert called.result().success and "cells" in called.result().message
    assert mapping.look(aside=2.0).cost(x, y + FAR) != LETHAL


def test_what_nobody_sees_any_more_can_be_forgotten(mapping: Mapping) -> None:
    x, y = mapping.stage.pose[:2] + LASER[:2]
    for _ in range(6):
        mapping.look()
    mapping.stage.pose = np.array([1.0, 1.5, np.pi])  # what is behind is not seen
    for _ in range(60):
        mapping.stage.tick(0.1)
    mapping.stage.track(mapping.node.tracker)
    assert mapping.look(aside=np.inf).cost(x, y + FAR) == LETHAL, "confirmed, it is remembered"
    client = mapping.stage.node.create_client(Trigger, "/costmaps/forget_unseen")
    mapping.stage.until(client.service_is_ready)
    called = client.call_async(Trigger.Request())
    mapping.stage.until(called.done)
    assert "nobody has seen for 5 s" in called.result().message
    assert mapping.look(aside=np.inf).cost(x, y + FAR) != LETHAL


def test_nonsense_is_left_aside_and_the_next_scan_counts(mapping: Mapping) -> None:
    strange = scan(mapping.stage.time)
    strange.header.frame_id = "nowhere"
    mapping.stage.send("/scan", strange)
    turned = scan(mapping.stage.time)
    turned.range_max = float("nan")
    mapping.stage.send("/scan", turned)
    torn = room()
    torn.data = torn.data[:100]
    mapping.stage.send("/map", torn, LATCHED)
    assert mapping.look().time == pytest.approx(mapping.stage.time)


def nod(time: float, lean: float) -> TFMessage:
    """The nodding laser 1.2 m over `base`, looking down by an angle [rad]."""
    each = TransformStamped(child_frame_id="laser_tilt_link")
    each.header.frame_id, each.header.stamp = "base", stamp_of(time)
    each.transform.translation.z = 1.2
    each.transform.rotation.y, each.transform.rotation.w = np.sin(lean / 2), np.cos(lean / 2)
    return TFMessage(transforms=[each])


def test_what_hangs_over_the_floor_is_marked_once_it_is_known_how_the_laser_stood(mapping: Mapping) -> None:
    """Beams look 0.4 rad down and end 2 m ahead, 0.42 m over the floor; 0.1 rad more, and they end on the floor."""
    place = mapping.stage.pose[:2] + np.array([2.0 * np.cos(0.4), 0.0])
    message = LaserScan(angle_min=-0.02, angle_max=0.02, angle_increment=0.01, range_min=0.1, range_max=30.0)
    message.header.frame_id, message.ranges = "laser_tilt_link", [2.0] * 5

    def sees(*frames: tuple[float, float]) -> bool:
        """Whether it is marked after a scan of now, and the laser's lean [rad] told at times from now on [s]."""
        time = mapping.stage.time
        message.header.stamp = stamp_of(time)
        mapping.stage.send("/tilt_scan", message)
        for off, lean in frames:
            mapping.stage.send("/tf", nod(time + off, lean))
        return mapping.look(aside=np.inf).cost(*place) == LETHAL

    assert not sees((-0.02, 0.3)), "/tf has not come that far"
    mapping.stage.until(lambda: sees((-0.02, 0.3), (0.02, 0.5)))
    before = len(mapping.whole)
    mapping.stage.until(lambda: mapping.look(aside=np.inf) and len(mapping.whole) > before)
    assert field_from_msg(mapping.whole[-1]).cost(*place) == LETHAL


def test_a_clock_that_begins_again_begins_the_costmaps_again(mapping: Mapping) -> None:
    for _ in range(30):
        mapping.stage.tick(0.1)
    mapping.look()
    mapping.stage.time = 0.5
    mapping.stage.track(mapping.node.tracker)
    mapping.stage.until(lambda: mapping.node.tracker.whereabouts.time < 2.0)
    field = mapping.look()
    assert field.time == pytest.approx(mapping.stage.time) and field.time < 3.0
