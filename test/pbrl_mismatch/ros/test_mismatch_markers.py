"""What RViz is shown of a mismatch: arrows as long as forces are large, places in their frames, not what is gone."""

from __future__ import annotations

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message, serialize_message
from visualization_msgs.msg import Marker, MarkerArray

from pbrl_mismatch.online.diagnosing import Diagnosed
from pbrl_mismatch.online.found import Found
from pbrl_mismatch.online.monitor import Alarm
from pbrl_mismatch.ros.markers import LONGEST, mismatch_markers

ALARM = Alarm("table", 3.0, 1e-4, 5.0, "free")
SHAPE = [[1.0, 0.0], [1.2, 0.0], [1.1, 0.2]]


def named(frame: str) -> dict[str, object]:
    return {"effect": "floor_patch", "where": {"frame": frame, "shape": SHAPE}}


def drawn(*entries: Found) -> list[Marker]:
    message = mismatch_markers(entries, Time(sec=7))
    return list(deserialize_message(serialize_message(message), MarkerArray).markers)


def test_arrows_are_as_long_as_forces_are_large_and_point_their_way() -> None:
    forces = ((1.0, 2.0, 3.0, 0.0), (1.5, 2.0, 0.0, -6.0))
    _, lines, caption = drawn(Found(ALARM, Diagnosed("table", {}, "table: a patch is left out", (), None, forces)))
    points = np.array([[point.x, point.y] for point in lines.points]).reshape(2, 3, 2, 2)
    shafts = points[:, 0, 1] - points[:, 0, 0]
    np.testing.assert_allclose(shafts, [[0.5 * LONGEST, 0.0], [0.0, -LONGEST]], atol=1e-9)
    np.testing.assert_allclose(points[:, 1:, 1], np.repeat(points[:, :1, 1], 2, axis=1))  # heads end at the tips
    assert caption.text.startswith("table: a patch is left out") and "6 N" in caption.text
    assert {lines.header.frame_id, caption.header.frame_id} == {"world"} and lines.header.stamp.sec == 7


def test_a_place_is_drawn_closed_and_in_its_frame() -> None:
    report = {"effects": [named("world"), named("table"), {"effect": "wrench_bias", "where": None}]}
    _, *places = drawn(Found(ALARM, Diagnosed("table", report, "said")))
    assert [each.header.frame_id for each in places] == ["world", "table"]
    assert all(len(each.points) == 4 and each.points[0] == each.points[-1] for each in places)
    assert len({(each.ns, each.id) for each in places}) == 2


def test_what_is_gone_is_taken_away_and_an_alarm_alone_draws_nothing() -> None:
    assert [each.action for each in drawn()] == [Marker.DELETEALL]
    assert [each.action for each in drawn(Found(ALARM))] == [Marker.DELETEALL]
