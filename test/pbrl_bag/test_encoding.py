"""CDR by our own hand against rclpy's and mcap_ros2's, for every type that we record."""

from __future__ import annotations

import importlib
import math
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from mcap_ros2._dynamic import generate_dynamic
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pbrl_bag import BagError
from pbrl_bag.encoding import SIZES, Encoder
from pbrl_bag.schema import PRIMITIVES, fields_of, message_definition

PBRL = ["Body", "Grasp", "Grasps", "ObjectModel", "ObjectModels", "Scene"]
TYPES = [f"pbrl_msgs/msg/{name}" for name in PBRL] + [
    "builtin_interfaces/msg/Time",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/Twist",
    "geometry_msgs/msg/TwistStamped",
    "geometry_msgs/msg/WrenchStamped",
    "nav_msgs/msg/Odometry",
    "rcl_interfaces/msg/Log",
    "rcl_interfaces/msg/ParameterEvent",
    "rosgraph_msgs/msg/Clock",
    "sensor_msgs/msg/CameraInfo",
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/LaserScan",
    "std_msgs/msg/Empty",
    "std_msgs/msg/Float64MultiArray",
    "std_msgs/msg/String",
    "std_msgs/msg/UInt8MultiArray",
    "tf2_msgs/msg/TFMessage",
    "visualization_msgs/msg/MarkerArray",
]


def class_of(name: str) -> type:
    package, _, short = name.partition("/msg/")
    return getattr(importlib.import_module(f"{package}.msg"), short)


def filled(name: str, rng: np.random.Generator, depth: int = 0) -> Any:
    """An instance with random content; arrays of 0 to 3 entries."""
    message = class_of(name)()
    for field in fields_of(name):
        n = field.length if field.length is not None else int(rng.integers(0, 4))
        values = [value_of(field.type, rng, depth) for _ in range(n if field.array else 1)]
        if field.type == "byte" and field.array:
            values = [bytes([value]) if isinstance(value, int) else value for value in values]
        setattr(message, field.name, values if field.array else values[0])
    return message


def value_of(kind: str, rng: np.random.Generator, depth: int) -> Any:
    if kind not in PRIMITIVES:
        return filled(kind, rng, depth + 1)
    if kind == "string":
        return "".join(rng.choice(list("abcäé☃ "), size=int(rng.integers(0, 9))))
    if kind == "bool":
        return bool(rng.integers(0, 2))
    if kind == "byte":
        return bytes([int(rng.integers(0, 256))])
    if kind == "char":
        return int(rng.integers(0, 128))
    if kind.startswith("float"):
        return float(np.float32(rng.normal()))
    bits = 8 * SIZES[kind]
    low, high = (0, 2**bits) if kind.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1))
    return int(rng.integers(low, high, dtype=np.uint64 if low == 0 else np.int64))


@pytest.mark.parametrize("name", TYPES)
def test_rclpy_reads_what_we_write(name: str) -> None:
    rng = np.random.default_rng(7)
    encoder = Encoder()
    for _ in range(8):
        message = filled(name, rng)
        assert deserialize_message(encoder.encode(name, message), class_of(name)) == message


@pytest.mark.parametrize("name", TYPES)
def test_rosbags_reads_what_we_write_to_the_last_byte(name: str) -> None:
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(message_definition(name), name))
    rng = np.random.default_rng(11)
    for _ in range(4):
        data = Encoder().encode(name, filled(name, rng))
        assert bytes(store.serialize_cdr(store.deserialize_cdr(data, name), name))[: len(data)] == data


@pytest.mark.parametrize("name", [name for name in TYPES if name.startswith("pbrl_msgs")])
def test_a_decoded_message_encodes_to_the_same_bytes(name: str) -> None:
    """Attribute access is all that is asked for: a decoded message is as good as an instance."""
    decode = generate_dynamic(name, message_definition(name))[name]
    encoder = Encoder()
    data = encoder.encode(name, filled(name, np.random.default_rng(3)))
    assert encoder.encode(name, decode(data)) == data
    assert encoder.encode(name, decode(serialize_message(deserialize_message(data, class_of(name))))) == data


def test_nan_and_a_byte_survive() -> None:
    body = class_of("pbrl_msgs/msg/Body")(nominal_mass=math.nan)
    back = deserialize_message(Encoder().encode("pbrl_msgs/msg/Body", body), type(body))
    assert math.isnan(back.nominal_mass)
    status = DiagnosticStatus(level=DiagnosticStatus.ERROR, name="x")
    data = Encoder().encode("diagnostic_msgs/msg/DiagnosticStatus", status)
    assert deserialize_message(data, DiagnosticStatus) == status


@pytest.mark.parametrize("thing", [object(), None, class_of("std_msgs/msg/String")(data="x")])
def test_a_message_of_another_type_is_refused(thing: object) -> None:
    with pytest.raises(BagError, match="expected a geometry_msgs/msg/PoseStamped, got"):
        Encoder().encode("geometry_msgs/msg/PoseStamped", thing)
