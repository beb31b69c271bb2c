"""Between plain values and rclpy: message classes, quality of service."""

from __future__ import annotations

import importlib
from collections.abc import Sequence

from ament_index_python.resources import get_resource
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy

from pbrl_bag.errors import BagError
from pbrl_bag.qos import INFINITE, Qos

HISTORY = {"keep_last": HistoryPolicy.KEEP_LAST, "keep_all": HistoryPolicy.KEEP_ALL}
RELIABILITY = {"reliable": ReliabilityPolicy.RELIABLE, "best_effort": ReliabilityPolicy.BEST_EFFORT}
DURABILITY = {"volatile": DurabilityPolicy.VOLATILE, "transient_local": DurabilityPolicy.TRANSIENT_LOCAL}
LIVELINESS = {"automatic": LivelinessPolicy.AUTOMATIC, "manual_by_topic": LivelinessPolicy.MANUAL_BY_TOPIC}
DEEP = 1000  # messages a recorder may lag behind on one topic


def message_class(type_name: str) -> type:
    """Return the generated class of a message type.

    Raises:
        BagError: its package is not sourced.
    """
    package, _, name = type_name.partition("/msg/")
    try:
        if not get_resource("rosidl_interfaces", package):  # a stranger's word: no other module is loaded for it
            raise LookupError(f"a package {package!r} without messages")
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, ValueError, LookupError, OSError) as error:
        raise BagError(
            f"message type {type_name!r}: expected it in package {package!r}, got: {error}; "
            "source the workspace that has the package"
        ) from error


def qos_from_profile(profile: QoSProfile) -> Qos:
    """Return a profile, such as discovery tells of, as a plain value."""
    return Qos(
        history=_name(HISTORY, profile.history),
        depth=profile.depth,
        reliability=_name(RELIABILITY, profile.reliability),
        durability=_name(DURABILITY, profile.durability),
        deadline=_nanoseconds(profile.deadline),
        lifespan=_nanoseconds(profile.lifespan),
        liveliness=_name(LIVELINESS, profile.liveliness),
        liveliness_lease_duration=_nanoseconds(profile.liveliness_lease_duration),
    )


def profile_from_qos(qos: Qos) -> QoSProfile:
    """Return a plain value as a profile to publish with; what is unknown stays at its default."""
    profile = QoSProfile(
        history=HISTORY.get(qos.history, HistoryPolicy.KEEP_LAST),
        depth=max(qos.depth, 1),
        reliability=RELIABILITY.get(qos.reliability, ReliabilityPolicy.RELIABLE),
        durability=DURABILITY.get(qos.durability, DurabilityPolicy.VOLATILE),
        liveliness=LIVELINESS.get(qos.liveliness, LivelinessPolicy.AUTOMATIC),
    )
    for key in ("deadline", "lifespan", "liveliness_lease_duration"):
        if getattr(qos, key) != INFINITE:
            setattr(profile, key, Duration(nanoseconds=getattr(qos, key)))
    return profile


def profile_that_hears(offered: Sequence[Qos]) -> QoSProfile:
    """Return a profile to subscribe with that every one of the publishers can serve.

    Reliable only if all are, latched only if all are: a stricter request would not be connected.
    """
    reliable = all(qos.reliability == "reliable" for qos in offered)
    latched = all(qos.durability == "transient_local" for qos in offered)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=DEEP,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def _name(policies: dict[str, object], policy: object) -> str:
    """Return a policy's name."""
    return next((name for name, known in policies.items() if known == policy), "unknown")


def _nanoseconds(duration: Duration) -> int:
    """Return a duration in nanoseconds; 0, which rmw reads as "not said", and what is capped are infinite."""
    return min(int(duration.nanoseconds), INFINITE) or INFINITE
