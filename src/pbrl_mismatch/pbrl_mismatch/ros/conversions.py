"""What was found to and from pbrl_msgs, in pairs; no node needed."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Vector3
from pbrl_msgs.msg import Mismatch, MismatchEffect, Mismatches
from pbrl_msgs.srv import PushObject

from pbrl_mismatch.online.diagnosing import Diagnosed
from pbrl_mismatch.online.found import Found
from pbrl_mismatch.online.monitor import Alarm


def stamp_of(seconds: float) -> Time:
    """Return seconds as a stamp."""
    whole = math.floor(seconds)
    return Time(sec=whole, nanosec=min(round((seconds - whole) * 1e9), 999_999_999))


def seconds_of(stamp: Time) -> float:
    """Return a stamp as seconds."""
    return float(stamp.sec + 1e-9 * stamp.nanosec)


def effect_to_msg(effect: Mapping[str, Any]) -> MismatchEffect:
    """Return one effect of `report.json` as a message."""
    parameters, where = effect["parameters"], effect["where"]
    return MismatchEffect(
        effect=effect["effect"],
        probability=float(effect["probability"]),
        parameters=list(parameters),
        units=[each["unit"] for each in parameters.values()],
        mean=[float(each["mean"]) for each in parameters.values()],
        sd=[float(each["sd"]) for each in parameters.values()],
        where_frame=where["frame"] if where else "",
        where=[Point(x=float(x), y=float(y)) for x, y in where["shape"]] if where else [],
        when=[float(edge) for interval in effect["when"] or [] for edge in interval],
        direction=effect["direction"] or "",
    )


def effect_from_msg(message: MismatchEffect) -> dict[str, Any]:
    """Return one effect in the form of `report.json`."""
    named = zip(message.parameters, message.mean, message.sd, message.units, strict=True)
    edges = list(message.when)
    return {
        "effect": message.effect,
        "probability": message.probability,
        "parameters": {name: {"mean": mean, "sd": sd, "unit": unit} for name, mean, sd, unit in named},
        "where": {"frame": message.where_frame, "shape": [[point.x, point.y] for point in message.where]}
        if message.where_frame
        else None,
        "when": [list(pair) for pair in zip(edges[::2], edges[1::2], strict=True)] or None,
        "direction": message.direction or None,
    }


def found_to_msg(found: Found) -> Mismatch:
    """Return one object's entry as a message."""
    report, diagnosed = found.report, found.diagnosed
    return Mismatch(
        object=found.alarm.object,
        alarm=stamp_of(found.alarm.time),
        model_class=found.alarm.model_class,
        p_value=found.alarm.p_value,
        size=found.alarm.size,
        diagnosed=diagnosed is not None,
        unknown=bool(report.get("unknown", False)),
        effects=[effect_to_msg(each) for each in report.get("effects", ())],
        alternatives=[effect_to_msg(each) for each in report.get("alternatives", ())],
        verdict=found.verdict,
        report=json.dumps(_strict(report), allow_nan=False) if report else "",
        notes=list(diagnosed.notes) if diagnosed is not None else [],
    )


def found_from_msg(message: Mismatch) -> Found:
    """Return one object's entry."""
    alarm = Alarm(message.object, seconds_of(message.alarm), message.p_value, message.size, message.model_class)
    if not message.diagnosed:
        return Found(alarm)
    report = json.loads(message.report) if message.report else {}
    return Found(alarm, Diagnosed(message.object, report, message.verdict, tuple(message.notes)))


def push_to_msg(push: Mapping[str, Any]) -> PushObject.Request:
    """Return `next_experiment` of `report.json` as what is asked of a robot, or of a simulator in its place."""
    (x, y), (along, across) = push["contact_point"], push["direction"]
    return PushObject.Request(
        object=push["object"],
        contact_point=Point(x=float(x), y=float(y)),
        direction=Vector3(x=float(along), y=float(across)),
        speed=float(push["speed"]),
        duration=float(push["duration"]),
    )


def push_from_msg(request: PushObject.Request) -> dict[str, Any]:
    """Return what is asked of a robot in the form of `report.json`, its bits left out."""
    return {
        "object": request.object,
        "contact_point": [request.contact_point.x, request.contact_point.y],
        "direction": [request.direction.x, request.direction.y],
        "speed": request.speed,
        "duration": request.duration,
    }


def mismatches_to_msg(entries: Iterable[Found], stamp: float) -> Mismatches:
    """Return everything that was found as one message.

    Args:
        entries: one an object.
        stamp: when the newest changed [s].
    """
    message = Mismatches(mismatches=[found_to_msg(each) for each in entries])
    message.header.stamp = stamp_of(stamp)
    message.header.frame_id = "world"
    return message


def mismatches_from_msg(message: Mismatches) -> dict[str, Found]:
    """Return what was found by object."""
    return {each.object: found_from_msg(each) for each in message.mismatches}


def _strict(value: Any) -> Any:
    """Return a value of JSON with null for what is not a number."""
    if isinstance(value, Mapping):
        return {key: _strict(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_strict(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
