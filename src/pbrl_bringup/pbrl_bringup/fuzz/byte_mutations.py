"""Mutations of any file: bits, lengths, pieces of other files, numbers in text and in binary."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np

from pbrl_bringup.fuzz.hostile import NUMBERS, TEXTS

MOST_BYTES = 1 << 20
"""Of an input; what grows beyond it is cut."""
_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
_WIDTHS = (1, 2, 4, 8)


def mutate_bytes(data: bytes, rng: np.random.Generator, others: Sequence[bytes]) -> bytes:
    """Return a file with one to four things done to it.

    Args:
        data: a file.
        rng: draws what is done.
        others: files of which pieces may be taken.
    """
    for _ in range(1 + int(rng.integers(4))):
        data = _ALL[rng.integers(len(_ALL))](data, rng, others)
    return data[:MOST_BYTES]


def mutate_text(data: bytes, rng: np.random.Generator, others: Sequence[bytes]) -> bytes:
    """Return a text with something done to it that mostly leaves it one that can be decoded."""
    for _ in range(1 + int(rng.integers(4))):
        data = _TEXTUAL[rng.integers(len(_TEXTUAL))](data, rng, others)
    return data[:MOST_BYTES]


def _place(data: bytes, rng: np.random.Generator) -> int:
    return int(rng.integers(len(data) + 1))


def _flip(data: bytes, rng: np.random.Generator, _: Sequence[bytes]) -> bytes:
    found = bytearray(data)
    for _number in range(int(rng.integers(1, 9))):
        if found:
            found[rng.integers(len(found))] ^= 1 << int(rng.integers(8))
    return bytes(found)


def _byte(data: bytes, rng: np.random.Generator, _: Sequence[bytes]) -> bytes:
    at = _place(data, rng)
    return data[:at] + bytes([int(rng.choice([0, 1, 10, 13, 34, 47, 60, 127, 128, 255]))]) + data[at + 1 :]


def _truncate(data: bytes, rng: np.random.Generator, _: Sequence[bytes]) -> bytes:
    return data[: _place(data, rng)]


def _cut(data: bytes, rng: np.random.Generator, _: Sequence[bytes]) -> bytes:
    at, length = _place(data, rng), int(rng.geometric(0.02))
    return data[:at] + data[at + length :]


def _repeat(data: bytes, rng: np.random.Generator, _: Sequence[bytes]) -> bytes:
    at, length, times = _place(data, rng), int(rng.geometric(0.02)), int(rng.choice([2, 3, 50, 1000]))
    return data[:at] + data[at : at + length] * times + data[at + length :]


def _splice(data: bytes, rng: np.random.Generator, others: Sequence[bytes]) -> bytes:
    other = others[int(rng.integers(len(others)))] if others else data
    at, start, length = _place(data, rng), _place(other, rng), int(rng.geometric(0.005))
    skip = length if rng.random() < 0.5 else 0
    return data[:at] + other[start : start + length] + data[at + skip :]


def _integer(data: bytes, rng: np.random.Generator, _: Sequence[bytes]) -> bytes:
    """Put a hostile number over some bytes, as binary formats have lengths and counts."""
    width = int(rng.choice(_WIDTHS))
    value = int(rng.choice([0, 1, 2**7, 2**15, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**62, 2**63 - 1])) % 256**width
    if rng.random() < 0.2:
        value = 256**width - 1
    at = _place(data, rng)
    return data[:at] + value.to_bytes(width, "little" if rng.random() < 0.7 else "big") + data[at + width :]


def _float(data: bytes, rng: np.random.Generator, _: Sequence[bytes]) -> bytes:
    at, value = _place(data, rng), rng.choice([np.nan, np.inf, -np.inf, 1e308, -1.0, 0.0, 1e30])
    return data[:at] + np.float64(value).tobytes() + data[at + 8 :]


def _number_in_text(data: bytes, rng: np.random.Generator, _: Sequence[bytes]) -> bytes:
    """Put a hostile number in the place of one that is written in digits."""
    places = list(_NUMBER.finditer(data[:MOST_BYTES]))
    if not places:
        return _flip(data, rng, ())
    place = places[rng.integers(len(places))]
    return data[: place.start()] + written(NUMBERS[rng.integers(len(NUMBERS))]).encode() + data[place.end() :]


def _text(data: bytes, rng: np.random.Generator, _: Sequence[bytes]) -> bytes:
    at, text = _place(data, rng), TEXTS[rng.integers(len(TEXTS))]
    return data[:at] + text.encode("utf-8", "surrogatepass") + data[at + (len(text) if rng.random() < 0.5 else 0) :]


def written(number: float) -> str:
    """Return a number in digits, however many it takes."""
    return f"1{'0' * 400}" if isinstance(number, int) and number == 10**400 else str(number)


_ALL: tuple[Callable[[bytes, np.random.Generator, Sequence[bytes]], bytes], ...] = (
    *(_flip, _byte, _truncate, _cut, _repeat, _splice, _integer, _float, _number_in_text, _number_in_text, _text),
)
_TEXTUAL: tuple[Callable[[bytes, np.random.Generator, Sequence[bytes]], bytes], ...] = (
    *(_truncate, _cut, _repeat, _splice, _number_in_text, _number_in_text, _number_in_text, _text),
)
