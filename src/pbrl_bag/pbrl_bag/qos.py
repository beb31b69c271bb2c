"""Quality of service as rosbag2 writes it: a plain value that a bag keeps for each topic."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from pbrl_bag.errors import BagError

INFINITE = 9223372036 * 1_000_000_000 + 854775807  # [ns] what rmw says for "no limit"
CHOICES = {
    "history": ("keep_last", "keep_all", "system_default", "unknown"),
    "reliability": ("reliable", "best_effort", "system_default", "unknown"),
    "durability": ("volatile", "transient_local", "system_default", "unknown"),
    "liveliness": ("automatic", "manual_by_topic", "system_default", "unknown"),
}
# Bags of version 8 and before give the numbers of rmw's enums.
_NUMBERS = {
    "history": {0: "system_default", 1: "keep_last", 2: "keep_all", 3: "unknown"},
    "reliability": {0: "system_default", 1: "reliable", 2: "best_effort", 3: "unknown"},
    "durability": {0: "system_default", 1: "transient_local", 2: "volatile", 3: "unknown"},
    "liveliness": {0: "system_default", 1: "automatic", 3: "manual_by_topic", 4: "unknown"},
}


@dataclass(frozen=True)
class Qos:
    """How a topic was offered; times in nanoseconds."""

    history: str = "keep_last"
    depth: int = 10
    reliability: str = "reliable"
    durability: str = "volatile"
    deadline: int = INFINITE
    lifespan: int = INFINITE
    liveliness: str = "automatic"
    liveliness_lease_duration: int = INFINITE

    def __post_init__(self) -> None:
        for key, known in CHOICES.items():
            if getattr(self, key) not in known:
                raise BagError(f"QoS: {key}: expected one of {', '.join(known)}, got {getattr(self, key)!r}")

    def to_metadata(self) -> dict[str, Any]:
        """Return the form of metadata.yaml, version 9."""
        values: dict[str, Any] = {}
        for field in fields(self):
            value = getattr(self, field.name)
            values[field.name] = _time(value) if field.name in _TIMES else value
        return {**values, "avoid_ros_namespace_conventions": False}


_TIMES = ("deadline", "lifespan", "liveliness_lease_duration")

DEFAULT = Qos()
LATCHED = Qos(depth=1, durability="transient_local")
LATCHED_TOPICS = frozenset(
    {"/tf_static", "/robot_description", "/scene", "/grasps", "/object_models", "/mismatches", "/push/status"}
)


def default_qos(topic: str) -> Qos:
    """Return how the contract offers a topic."""
    return LATCHED if topic in LATCHED_TOPICS else DEFAULT


def qos_from_metadata(entry: Mapping[str, Any]) -> Qos:
    """Read one entry of offered_qos_profiles, of bag version 9 (names) or older (numbers).

    Raises:
        BagError: a policy that rosbag2 does not know.
    """
    values: dict[str, Any] = {"depth": int(entry.get("depth", 10))}
    for key, numbers in _NUMBERS.items():
        value = entry.get(key, getattr(DEFAULT, key))
        values[key] = numbers.get(value, "unknown") if isinstance(value, int) else str(value)
    for key in _TIMES:
        time = entry.get(key)
        values[key] = INFINITE if time is None else int(time["sec"]) * 1_000_000_000 + int(time["nsec"])
    return Qos(**values)


def _time(nanoseconds: int) -> dict[str, int]:
    """Return a duration as rosbag2 writes it."""
    return {"sec": nanoseconds // 1_000_000_000, "nsec": nanoseconds % 1_000_000_000}
