"""Mutations of ROS messages: any value that the wire can carry, in any field."""

from __future__ import annotations

import array
import copy
import math
import re
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import numpy as np

from pbrl_bringup.fuzz.hostile import NUMBERS, TEXTS

_SEQUENCE = re.compile(r"sequence<(?P<of>[^,>]+)(?:, *\d+)?>")
_ARRAY = re.compile(r"(?P<of>[^\[\]]+)\[(?P<count>\d+)\]")
_WHOLE = re.compile(r"(?P<sign>u?)int(?P<bits>8|16|32|64)|octet|byte|char")
LENGTHS = (0, 1, 2, 3, 5, 100, 20_000)
"""Of sequences."""
LARGEST = 1_000_000
"""Letters of all texts of one: more of them no middleware carries."""


def mutate_message(message: Any, rng: np.random.Generator) -> Any:
    """Return a message with one to five fields set to something hostile; the one given stays as it is."""
    found = copy.deepcopy(message)
    for _ in range(int(rng.integers(1, 6))):
        places = list(_places(found))
        if not places:
            break
        holder, name, kind = places[rng.integers(len(places))]
        setattr(holder, name, _hostile(kind, getattr(holder, name), rng))
    return found


def _places(message: Any, depth: int = 0) -> Iterator[tuple[Any, str, str]]:
    """Yield holder, field and type of every field, of the first and last messages of sequences as well."""
    for name, kind in message.get_fields_and_field_types().items():
        yield message, name, kind
        value = getattr(message, name)
        inside = [value] if hasattr(value, "get_fields_and_field_types") else []
        if isinstance(value, list) and value and hasattr(value[0], "get_fields_and_field_types"):
            inside = [value[0], value[-1]] if len(value) > 1 else value
        if depth < 8:
            for each in inside:
                yield from _places(each, depth + 1)


def _hostile(kind: str, value: Any, rng: np.random.Generator) -> Any:
    """Return a hostile value of a field's type."""
    sequence, fixed = _SEQUENCE.fullmatch(kind), _ARRAY.fullmatch(kind)
    if sequence or fixed:
        return _many(sequence, fixed, value, rng)
    return _one(kind, value, rng)


def _many(sequence: Any, fixed: Any, value: Any, rng: np.random.Generator) -> Any:
    """Return a sequence: longer, shorter, or with a hostile value in it."""
    kind = (sequence or fixed)["of"]
    values = list(value)
    draw = rng.random()
    if fixed is None and draw < 0.5:
        length = int(rng.choice(LENGTHS))
        added = _one(kind, None, rng)
        fresh = values[:length] + [added] * (length - len(values[:length]))
        values = fresh[: _most(kind, added)]
    elif fixed is None and draw < 0.6 and values:
        values = values[::-1] + values
    elif values:
        for _ in range(int(rng.integers(1, 4))):
            values[rng.integers(len(values))] = _one(kind, values[0], rng)
    if isinstance(value, array.array):
        return array.array(value.typecode, values)
    return np.array(values, dtype=value.dtype) if isinstance(value, np.ndarray) else values


def _most(kind: str, added: Any) -> int | None:
    """Return how many of a text or message a sequence may hold: what is long itself is not there thousands of times."""
    if isinstance(added, str):
        return LARGEST // max(len(added), 1)
    return min(300, LARGEST // len(repr(added)) + 2) if "/" in kind else None


def _one(kind: str, value: Any, rng: np.random.Generator) -> Any:
    if kind == "boolean":
        return bool(rng.random() < 0.5)
    if kind in ("double", "float"):
        return _float(kind, rng)
    if whole := _WHOLE.fullmatch(kind):
        if kind in ("octet", "byte"):
            return bytes([int(rng.integers(256))])
        bits = int(whole["bits"] or 8)
        low, high = (0, 2**bits - 1) if whole["sign"] or kind == "char" else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        return int(rng.choice(np.array([low, high, 0, 1, min(high, 10**9), low + 1, min(high, 65536)], dtype=object)))
    if kind.startswith(("string", "wstring")):
        text = TEXTS[rng.integers(len(TEXTS))].replace("\0", "")
        return (str(value or "") + text) if rng.random() < 0.2 else text
    fresh = default(kind)
    if value is not None and rng.random() < 0.5:
        fresh = copy.deepcopy(value)
    fields = list(fresh.get_fields_and_field_types().items())
    name, inner = fields[rng.integers(len(fields))]
    setattr(fresh, name, _hostile(inner, getattr(fresh, name), rng))
    return fresh


def _float(kind: str, rng: np.random.Generator) -> float:
    number = float(np.clip(NUMBERS[rng.integers(len(NUMBERS))], -1.7e308, 1.7e308)) if rng.random() < 0.8 else math.nan
    if kind == "float" and math.isfinite(number) and abs(number) > 3.4e38:
        return math.copysign(math.inf, number)
    return number


def default(kind: str) -> Any:
    """Return an empty message of a type, such as `geometry_msgs/Point`."""
    package, name = kind.split("/")[0], kind.split("/")[-1]
    return getattr(import_module(f"{package}.msg"), name)()
