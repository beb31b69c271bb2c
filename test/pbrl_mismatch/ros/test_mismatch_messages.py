"""What was found survives the wire."""

from __future__ import annotations

from typing import Any

from pbrl_msgs.msg import Mismatches
from pbrl_msgs.srv import PushObject
from rclpy.serialization import deserialize_message, serialize_message

from pbrl_mismatch.online.diagnosing import Diagnosed
from pbrl_mismatch.online.found import Found
from pbrl_mismatch.online.monitor import Alarm
from pbrl_mismatch.ros.conversions import (
    effect_from_msg,
    effect_to_msg,
    mismatches_from_msg,
    mismatches_to_msg,
    push_from_msg,
    push_to_msg,
    seconds_of,
    stamp_of,
)

ALARM = Alarm("table", 12.25, 1e-4, 5.5, "wheel")
PATCH: dict[str, Any] = {
    "effect": "floor_patch",
    "probability": 0.75,
    "parameters": {
        "patch_mu": {"mean": 0.2, "sd": 0.01, "unit": "1"},
        "patch_x": {"mean": 1.0, "sd": 0.5, "unit": "m"},
    },
    "where": {"frame": "world", "shape": [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]},
    "when": [[1.0, 2.0], [3.0, 4.5]],
    "direction": "against the velocity",
}
PLAIN: dict[str, Any] = {
    **PATCH,
    "effect": "viscous_drag",
    "parameters": {},
    "where": None,
    "when": None,
    "direction": None,
}
REPORT = {"mismatch": True, "p_value": 1e-9, "effects": [PATCH], "alternatives": [PLAIN], "unknown": False}


def test_an_effect_comes_back() -> None:
    for effect in (PATCH, PLAIN):
        assert effect_from_msg(effect_to_msg(effect)) == effect


def test_what_was_found_comes_back_over_the_wire() -> None:
    entries = (
        Found(ALARM),
        Found(Alarm("desk", 3.0, 0.01, 2.0, "free"), Diagnosed("desk", REPORT, "desk: floor_patch", ("a note",))),
        Found(Alarm("shelf", 3.0, 0.01, 2.0, "free"), Diagnosed("shelf", {}, "shelf: not diagnosed: too short")),
    )
    message = deserialize_message(serialize_message(mismatches_to_msg(entries, 20.5)), Mismatches)
    back = mismatches_from_msg(message)
    assert tuple(back[name] for name in ("desk", "shelf")) == entries[1:]
    assert back["table"] == entries[0]
    assert [each.diagnosed for each in message.mismatches] == [False, True, True]
    assert message.header.frame_id == "world" and seconds_of(message.header.stamp) == 20.5
    assert message.mismatches[0].report == "" and not message.mismatches[0].effects


def test_stamps_are_seconds() -> None:
    for seconds in (0.0, 1.5, 1234567.123456789):
        assert abs(seconds_of(stamp_of(seconds)) - seconds) < 1e-6
    assert stamp_of(0.9999999999).nanosec == 999_999_999


def test_a_push_that_is_asked_for_survives_the_wire() -> None:
    push = {
        "object": "table",
        "contact_point": [-0.35, 0.5875],
        "direction": [0.6, -0.8],
        "speed": 0.12,
        "duration": 2.0,
    }
    wire = serialize_message(push_to_msg({**push, "expected_bits": 0.5}))
    assert push_from_msg(deserialize_message(wire, PushObject.Request)) == push
