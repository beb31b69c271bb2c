"""Encodes messages as CDR by their definition, without rclpy: any object with the right attributes will do.

A type is compiled once into a few steps: nested messages are flattened, and neighbours of one size
(the seven numbers of a pose) are packed in one go.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from operator import attrgetter
from typing import Any

import numpy as np

from pbrl_bag.errors import BagError
from pbrl_bag.schema import PRIMITIVES, Field, fields_of

HEADER = b"\x00\x01\x00\x00"  # CDR, little endian
FORMATS = {
    "bool": "?", "byte": "B", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H",
    "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
SIZES = {name: struct.calcsize(code) for name, code in FORMATS.items()}
_PADDING = [bytes(n) for n in range(8)]
_LENGTH = struct.Struct("<I")

Step = Callable[[bytearray, Any], None]


class Encoder:
    """Encodes messages of any installed type."""

    def __init__(self) -> None:
        self._steps: dict[str, tuple[Step, ...]] = {}

    def encode(self, type_name: str, message: Any) -> bytes:
        """Return a message as CDR, little endian, with its four bytes of header.

        Raises:
            BagError: the type is not installed, or the message does not fit it.
        """
        steps = self.steps_of(type_name)
        buffer = bytearray(HEADER)
        try:
            for step in steps:
                step(buffer, message)
        except (AttributeError, TypeError, ValueError, OverflowError, struct.error) as error:
            raise BagError(
                f"expected a {type_name}, got {type(message).__name__} that does not fit: {error}"
            ) from error
        return bytes(buffer)

    def steps_of(self, type_name: str) -> tuple[Step, ...]:
        """Return the compiled steps of a type.

        Raises:
            BagError: it is not installed, or has fields of type wstring.
        """
        if type_name not in self._steps:
            self._steps[type_name] = tuple(self._compile(type_name))
        return self._steps[type_name]

    def _compile(self, type_name: str) -> Iterator[Step]:
        """Yield the steps of a type, runs of equally wide numbers joined."""
        run: list[tuple[str, Field]] = []
        for path, field in _flat(type_name, ""):
            joins = not field.array and field.type in FORMATS and field.type != "byte"
            if run and not (joins and SIZES[field.type] == SIZES[run[0][1].type]):
                yield _numbers(run)
                run = []
            if joins:
                run.append((path, field))
            else:
                yield self._single(type_name, path, field)
        if run:
            yield _numbers(run)

    def _single(self, type_name: str, path: str, field: Field) -> Step:
        """Return the step of one string, byte, array, or empty message."""
        get = attrgetter(path) if path else (lambda _: 0)
        if field.type == "wstring":
            raise BagError(f"{type_name}: {path}: wstring is not supported; use string")
        if not field.array:
            return _string(get) if field.type == "string" else _byte(get)
        if field.type in FORMATS:
            return _number_array(get, field)
        write: Step = _put_string if field.type == "string" else self._nested(field.type)
        return _array(get, field, write)

    def _nested(self, type_name: str) -> Step:
        """Return a step that writes a whole message of another type."""
        steps = self.steps_of(type_name)

        def write(buffer: bytearray, message: Any) -> None:
            for step in steps:
                step(buffer, message)

        return write


def _flat(type_name: str, prefix: str) -> Iterator[tuple[str, Field]]:
    """Yield (dotted path, field) of a type, nested messages opened unless they are in an array."""
    fields = fields_of(type_name)
    if not fields:  # an empty message takes one byte on the wire
        yield "", Field("", "byte", False, None)
    for field in fields:
        if field.type in PRIMITIVES or field.array:
            yield prefix + field.name, field
        else:
            yield from _flat(field.type, f"{prefix}{field.name}.")


def _align(buffer: bytearray, size: int) -> None:
    """Pad so that the next value lies at a multiple of its size, counted after the header."""
    buffer += _PADDING[(4 - len(buffer)) % size]


def _numbers(run: list[tuple[str, Field]]) -> Step:
    """Return a step that packs neighbouring numbers of one size."""
    pack = struct.Struct("<" + "".join(FORMATS[field.type] for _, field in run)).pack
    size = SIZES[run[0][1].type]
    get = attrgetter(*(path for path, _ in run))
    single = len(run) == 1

    def write(buffer: bytearray, message: Any) -> None:
        _align(buffer, size)
        buffer.extend(pack(get(message)) if single else pack(*get(message)))

    return write


def _byte(get: Callable[[Any], Any]) -> Step:
    """Return a step for `byte`, which rclpy gives as bytes of length one."""

    def write(buffer: bytearray, message: Any) -> None:
        value = get(message)
        buffer.append(value[0] if isinstance(value, bytes) else value)

    return write


def _string(get: Callable[[Any], Any]) -> Step:
    """Return a step for a string."""
    return lambda buffer, message: _put_string(buffer, get(message))


def _put_string(buffer: bytearray, value: Any) -> None:
    """Write a string: length with its final zero, text, zero."""
    if not isinstance(value, str):
        raise TypeError(f"expected text, got {value!r}")
    data = value.encode()
    _put_length(buffer, len(data) + 1)
    buffer += data
    buffer.append(0)


def _put_length(buffer: bytearray, length: int) -> None:
    """Write the length of a sequence."""
    _align(buffer, 4)
    buffer += _LENGTH.pack(length)


def _number_array(get: Callable[[Any], Any], field: Field) -> Step:
    """Return a step for an array of numbers, of fixed length or not."""
    kind, size = np.dtype("<" + FORMATS[field.type]), SIZES[field.type]

    def write(buffer: bytearray, message: Any) -> None:
        value = get(message)
        if isinstance(value, list) and value and isinstance(value[0], bytes):
            value = b"".join(value)
        data = np.frombuffer(value, kind) if isinstance(value, bytes) else np.asarray(value, dtype=kind).ravel()
        _check_length(field, len(data))
        if field.length is None:
            _put_length(buffer, len(data))
        if len(data):
            _align(buffer, size)
            buffer.extend(data.tobytes())

    return write


def _array(get: Callable[[Any], Any], field: Field, put: Step) -> Step:
    """Return a step for an array of strings or messages."""

    def write(buffer: bytearray, message: Any) -> None:
        values = get(message)
        _check_length(field, len(values))
        if field.length is None:
            _put_length(buffer, len(values))
        for value in values:
            put(buffer, value)

    return write


def _check_length(field: Field, length: int) -> None:
    """Raise a ValueError where an array of fixed length has another one."""
    if field.length is not None and length != field.length:
        raise ValueError(f"{field.name}: expected {field.length} entries, got {length}")
