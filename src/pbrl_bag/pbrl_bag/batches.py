"""Decodes the messages of one stream in one go, where they lie alike: stamped poses and wrenches.

A recording of ten minutes has some hundred thousand of them, and most of the time of reading went into taking them
apart one by one. Whatever does not lie exactly as expected is left to the decoder that follows the schema.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pbrl_bag.decoding import NANOSECONDS
from pbrl_bag.encoding import HEADER
from pbrl_bag.types import Array

KINDS: dict[str, tuple[Literal["pose", "wrench"], int]] = {
    "geometry_msgs/msg/PoseStamped": ("pose", 7),
    "geometry_msgs/msg/WrenchStamped": ("wrench", 6),
}
"""What a type carries after its header, and how many numbers that are."""

_START = struct.Struct("<4siII")  # CDR's own header, seconds, nanoseconds, length of frame_id
_SECONDS, _NANOSECONDS, _LENGTH, _FRAME = 4, 8, 12, 16  # where they begin
_DOUBLE = 8


@dataclass(frozen=True)
class Batch:
    """Messages of one topic.

    Attributes:
        kind: what they carry.
        time: (n,) stamps [s].
        frame: of all of them, without a leading slash.
        values: (n, 7) position [m] and quaternion x y z w, or (n, 6) force [N] and torque [N m].
    """

    kind: Literal["pose", "wrench"]
    time: Array
    frame: str
    values: Array


def batch_of(type_name: str, data: Sequence[bytes]) -> Batch | None:
    """Decode messages of one type, or return None where they do not lie alike.

    Args:
        type_name: as the schema says.
        data: CDR of each message, in order.
    """
    if type_name not in KINDS or not data or len(data[0]) < _START.size:
        return None
    kind, count = KINDS[type_name]
    header, _, _, length = _START.unpack_from(data[0])
    begin = _FRAME + length
    begin += (4 - begin) % _DOUBLE  # numbers lie at multiples of their size, counted after CDR's own header
    size = begin + _DOUBLE * count
    if header != HEADER or length < 1 or any(len(each) != size for each in data):
        return None
    table = np.frombuffer(b"".join(data), np.uint8).reshape(len(data), size)
    alike = np.r_[0:_SECONDS, _LENGTH : _FRAME + length]
    if (table[:, alike] != table[0, alike]).any():
        return None
    try:
        frame = bytes(data[0][_FRAME : _FRAME + length - 1]).decode()
    except UnicodeDecodeError:
        return None
    seconds = _column(table, _SECONDS, "<i4").astype(np.float64)
    time = seconds + _column(table, _NANOSECONDS, "<u4").astype(np.float64) / NANOSECONDS
    values = np.ascontiguousarray(table[:, begin:]).view("<f8").astype(np.float64)
    return Batch(kind, time, frame.lstrip("/"), values)


def _column(table: np.ndarray, begin: int, kind: str) -> np.ndarray:
    """Return the numbers of four bytes that begin at a byte of each row."""
    return np.ascontiguousarray(table[:, begin : begin + 4]).view(kind)[:, 0]
