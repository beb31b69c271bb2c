"""Outlines out of SVG path data: lines as they are, curves as chords (SVG 1.1, section 8.3 and appendix F.6)."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field

import numpy as np

from pbrl_control.planar import Array
from pbrl_namo.errors import NamoError

CHORDS = 24
"""Chords that a Bezier curve, or a quarter of an ellipse, is flattened to."""

MOST_POINTS = 50_000
"""Points that one path may have."""

LARGEST = 1e9
"""Largest coordinate, in units of the drawing."""

TOKEN = re.compile(r"[\s,]*([A-Za-z]|[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)")
FLAG = re.compile(r"[\s,]*([01])")
ARGUMENTS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}


@dataclass
class Outline:
    """One part of a path that is drawn without lifting the pen.

    Attributes:
        points: (x, y) in units of the drawing.
        closed: it ends where it began by a command, not by chance.
        curved: some of it is chords of a curve.
    """

    points: list[tuple[float, float]] = field(default_factory=list)
    closed: bool = False
    curved: bool = False

    def array(self) -> Array:
        """Return the points (n, 2)."""
        return np.array(self.points, dtype=float).reshape(-1, 2)


def parse_path(data: str, what: str) -> list[Outline]:
    """Return the outlines of a path.

    Args:
        data: attribute `d`.
        what: the path is, for messages.

    Raises:
        NamoError: it is no path data, or its numbers or their count are beyond all measure.
    """
    return _Pen(data, what).draw()


def ellipse_outline(cx: float, cy: float, rx: float, ry: float) -> Outline:
    """Return an ellipse about a point, as an outline of chords."""
    angles = np.linspace(0.0, 2.0 * math.pi, 4 * CHORDS, endpoint=False)
    points = list(zip((cx + rx * np.cos(angles)).tolist(), (cy + ry * np.sin(angles)).tolist(), strict=True))
    return Outline(points, closed=True, curved=True)


class _Pen:
    """Goes through the commands of a path and notes where it has been."""

    def __init__(self, data: str, what: str) -> None:
        self._data, self._what, self._place = data, what, 0
        self._here = self._start = (0.0, 0.0)
        self._control: tuple[float, float] | None = None  # last one of the curve before, for smooth ones
        self._outlines: list[Outline] = []
        self._count = 0

    def draw(self) -> list[Outline]:
        command = ""
        before = ""
        while (token := self._peek()) is not None:
            if token.isalpha():
                self._place = self._end
                command = token
                if command.upper() not in ARGUMENTS:
                    self._fail(f"expected one of the commands {' '.join(ARGUMENTS)}, got {command!r}")
            elif command in ("", "Z", "z"):
                self._fail(f"expected a command, got {token!r}")
            if not self._outlines and command.upper() != "M":
                self._fail(f"expected a path that begins with M, got {command!r}")
            self._do(command, before)
            before = command.upper()
            command = {"M": "L", "m": "l"}.get(command, command)
        return [outline for outline in self._outlines if len(outline.points) > 1]

    def _do(self, command: str, before: str) -> None:
        """Do one command, with its arguments."""
        kind, relative = command.upper(), command.islower()
        base = self._here if relative else (0.0, 0.0)
        if kind == "Z":
            self._outlines[-1].closed = True
            self._here, self._control = self._start, None
            return
        numbers = self._numbers(kind)
        x, y = self._here
        if kind in "HV":
            numbers = [numbers[0] + base[0], y] if kind == "H" else [x, numbers[0] + base[1]]
            base = (0.0, 0.0)
        pairs = numbers[5:] if kind == "A" else numbers
        points = [(pairs[i] + base[0], pairs[i + 1] + base[1]) for i in range(0, len(pairs), 2)]
        if kind == "M":
            self._start = self._here = points[0]
            self._outlines.append(Outline([self._here]))
            self._control = None
            return
        if self._outlines[-1].closed:  # drawn on without a move: a new outline begins where the last one did
            self._outlines.append(Outline([self._here]))
        if kind in "ST":
            smooth = self._control is not None and before in ("CS" if kind == "S" else "QT")
            cx, cy = self._control if smooth and self._control else self._here
            points.insert(0, (2.0 * x - cx, 2.0 * y - cy))
        if kind in "LHV":
            self._add(points)
        elif kind in "CSQT":
            self._add(_bezier([self._here, *points]), curved=True)
        else:
            self._add(_arc(self._here, points[0], numbers[:5]), curved=True)
        self._control = points[-2] if kind in "CSQT" else None
        self._here = points[-1]

    def _add(self, points: list[tuple[float, float]], *, curved: bool = False) -> None:
        self._count += len(points)
        if self._count > MOST_POINTS:
            self._fail(f"expected at most {MOST_POINTS} points, got more")
        if any(not abs(value) <= LARGEST for point in points for value in point):
            self._fail(f"expected coordinates of at most {LARGEST:g}, got {points[-1]}")
        self._outlines[-1].points += points
        self._outlines[-1].curved |= curved

    def _peek(self) -> str | None:
        """Return the next token without taking it; None at the end."""
        found = TOKEN.match(self._data, self._place)
        if found is None:
            rest = self._data[self._place :].strip(" \t\r\n,")
            if rest:
                self._fail(f"expected a command or a number, got {rest[:20]!r}")
            return None
        self._end = found.end()
        return found.group(1)

    def _numbers(self, kind: str) -> list[float]:
        """Take the arguments of one command; flags of an arc may be written without a space."""
        found: list[float] = []
        for index in range(ARGUMENTS[kind]):
            flag = FLAG.match(self._data, self._place) if kind == "A" and index in (3, 4) else None
            token = self._peek() if flag is None else flag.group(1)
            if token is None or token.isalpha():
                self._fail(f"expected {ARGUMENTS[kind]} numbers after {kind}, got {len(found)}")
            assert token is not None
            self._place = self._end if flag is None else flag.end()
            value = float(token)
            if not abs(value) <= LARGEST:
                self._fail(f"expected numbers of at most {LARGEST:g}, got {token[:20]}")
            found.append(value)
        return found

    def _fail(self, fault: str) -> None:
        raise NamoError(f"{self._what}: path: {fault}")


def _bezier(controls: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return chords of a Bezier curve of any degree by de Casteljau, its first point left out; lines stay lines."""
    share = np.linspace(0.0, 1.0, CHORDS + 1)[1:, None, None]
    points = np.broadcast_to(np.array(controls), (CHORDS, len(controls), 2))
    while points.shape[1] > 1:
        points = points[:, :-1] + share * (points[:, 1:] - points[:, :-1])
    return [*map(tuple, points[:-1, 0].tolist()), controls[-1]]


def _arc(start: tuple[float, float], end: tuple[float, float], told: list[float]) -> list[tuple[float, float]]:
    """Return chords of an elliptic arc, its first point left out; told: rx, ry, rotation [deg], large, sweep."""
    rx, ry, tilt = abs(told[0]), abs(told[1]), math.radians(told[2])
    if rx == 0.0 or ry == 0.0 or start == end:
        return [end]
    turn = complex(math.cos(tilt), math.sin(tilt))
    half = (complex(*start) - complex(*end)) / 2.0 / turn
    x, y = half.real / rx, half.imag / ry
    stretch = max(1.0, math.hypot(x, y))  # radii that are too small to reach are made to
    x, y, rx, ry = x / stretch, y / stretch, rx * stretch, ry * stretch
    square = x * x + y * y
    off = math.sqrt(max(0.0, 1.0 - square) / square) * (-1.0 if told[3] == told[4] else 1.0)
    cx, cy = off * y, -off * x
    first, last = math.atan2(y - cy, x - cx), math.atan2(-y - cy, -x - cx)
    sweep = (last - first) % (2.0 * math.pi) if told[4] else -((first - last) % (2.0 * math.pi))
    count = max(2, math.ceil(abs(sweep) / (math.pi / 2.0) * CHORDS))
    middle = (complex(*start) + complex(*end)) / 2.0
    angles = first + sweep * np.arange(1, count) / count
    points = middle + turn * (rx * (cx + np.cos(angles)) + 1j * ry * (cy + np.sin(angles)))
    return [*zip(points.real.tolist(), points.imag.tolist(), strict=True), end]
