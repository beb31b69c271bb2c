"""Where things of a drawing are: transforms, viewports and units of SVG (SVG 1.1, chapter 7), as affine maps."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

import numpy as np

from pbrl_control.planar import Array
from pbrl_namo.errors import NamoError

NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
LENGTH = re.compile(rf"\s*({NUMBER})\s*([a-zA-Z%]*)\s*\Z")
CALL = re.compile(r"\s*,?\s*(\w+)\s*\(([^()]*)\)")
CENTIMETRES = {"cm": 1.0, "mm": 0.1, "in": 2.54, "pt": 2.54 / 72.0, "pc": 2.54 / 6.0}
PIXEL = 2.54 / 96.0
"""Of a CSS pixel [cm]."""

SAME_SCALE = 1e-3
"""Relative difference up to which two scales count as one: drawing programs round them."""

LARGEST = 1e7
"""Largest factor or shift of a transform."""


def read_transform(text: str, what: str) -> Array:
    """Return the (3, 3) matrix of an attribute `transform`; the last one written is done first.

    Raises:
        NamoError: an unknown transform, the wrong count of numbers, or a matrix that squashes everything.
    """
    matrix, place = np.eye(3), 0
    while (found := CALL.match(text, place)) is not None:
        matrix = matrix @ _one(found.group(1), read_numbers(found.group(2), what), what)
        place = found.end()
    if text[place:].strip(" \t\r\n,"):
        raise NamoError(
            f"{what}: transform: expected matrix, translate, scale, rotate or skew, got {text[place:][:40]!r}"
        )
    if not np.abs(matrix).max() <= LARGEST or abs(np.linalg.det(matrix[:2, :2])) < 1.0 / LARGEST**2:
        raise NamoError(f"{what}: transform: expected one that can be undone, got {text[:60]!r}")
    return matrix


def _one(kind: str, n: list[float], what: str) -> Array:
    """Return the matrix of one transform with its numbers."""
    counts = {"matrix": (6,), "translate": (1, 2), "scale": (1, 2), "rotate": (1, 3), "skewX": (1,), "skewY": (1,)}
    if kind not in counts or len(n) not in counts[kind]:
        raise NamoError(f"{what}: transform: expected a known one with its numbers, got {kind!r} with {len(n)}")
    if kind == "matrix":
        return np.array([[n[0], n[2], n[4]], [n[1], n[3], n[5]], [0.0, 0.0, 1.0]])
    if kind == "translate":
        return shift_by(n[0], n[1] if len(n) > 1 else 0.0)
    if kind == "scale":
        return np.diag([n[0], n[-1], 1.0])
    angle = math.radians(n[0])
    if kind == "rotate":
        c, s = math.cos(angle), math.sin(angle)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return shift_by(n[1], n[2]) @ turn @ shift_by(-n[1], -n[2]) if len(n) > 1 else turn
    skew = np.eye(3)
    skew[(0, 1) if kind == "skewX" else (1, 0)] = math.tan(angle)
    return skew


def shift_by(x: float, y: float) -> Array:
    """Return the (3, 3) matrix of a shift."""
    matrix = np.eye(3)
    matrix[:2, 2] = x, y
    return matrix


def root_frame(attributes: Mapping[str, str], what: str) -> tuple[Array, Array, list[str]]:
    """Return the map from a drawing's units to the floor, and the drawing's sheet on the floor.

    A unit of the drawing is a centimetre: the format says so. `width` and `height` may say otherwise, by showing the
    sheet larger or smaller than its `viewBox`. Taken so: a width without a unit is in centimetres as well; one in cm,
    mm, in, pt or pc is as long as it says. But a sheet that is shown with one unit a CSS pixel is what drawing programs
    write by themselves when nobody scaled anything, and means centimetres still.

    Args:
        attributes: of the root.
        what: the drawing is, for messages.

    Returns:
        Matrix (3, 3) from the drawing to `world` [m], y up and the sheet's lower left corner at the origin; the extent
        (2,) of the sheet [m]; and what there is to know about the scale, in sentences.

    Raises:
        NamoError: there is no size, or one that cannot be.
    """
    box, notes = attributes.get("viewBox"), []
    lengths = [read_length(attributes.get(name), f"{what}: {name}") for name in ("width", "height")]
    if box is None:
        given = [length for length in lengths if length is not None]
        if len(given) < 2:
            raise NamoError(
                f"{what}: expected a viewBox, or a width and a height, got none; the room would have no end"
            )
        view = [0.0, 0.0, given[0][0], given[1][0]]
        scales = [1.0 if unit in ("", "px") else CENTIMETRES[unit] for _, unit in given]
    else:
        view = _view_box(box, what)
        shown = [_scale(length, extent) for length, extent in zip(lengths, view[2:], strict=True) if length is not None]
        scales = (shown * 2)[:2] if shown else [1.0, 1.0]
        if all(abs(scale - PIXEL) <= SAME_SCALE * PIXEL for scale in scales):
            notes.append("The sheet is drawn with one unit a CSS pixel; a unit is taken as a centimetre all the same.")
            scales = [1.0, 1.0]
        elif not attributes.get("preserveAspectRatio", "").strip().startswith("none"):
            scales = [min(scales)] * 2
    if any(abs(scale - 1.0) > SAME_SCALE for scale in scales):
        notes.append(f"The sheet is scaled: a unit of the drawing is {scales[0]:.6g} cm.")
    else:
        scales = [1.0, 1.0]  # a rounded width is no scale
    sx, sy = (scale / 100.0 for scale in scales)
    flip = np.array([[sx, 0.0, -sx * view[0]], [0.0, -sy, sy * (view[1] + view[3])], [0.0, 0.0, 1.0]])
    return flip, np.array([sx * view[2], sy * view[3]]), notes


def viewport_frame(attributes: Mapping[str, str], what: str) -> Array:
    """Return the (3, 3) matrix from the units inside a nested `svg` element to those around it.

    Raises:
        NamoError: a viewBox without a width and a height, or in units that depend on what is around it.
    """
    place = []
    for name in ("x", "y", "width", "height"):
        length = read_length(attributes.get(name), f"{what}: {name}")
        if length is not None and length[1] not in ("", "px"):
            raise NamoError(f"{what}: {name}: expected units of the drawing, got {attributes[name]!r}")
        place.append(None if length is None else length[0])
    x, y = place[0] or 0.0, place[1] or 0.0
    if "viewBox" not in attributes:
        return shift_by(x, y)
    width, height = place[2], place[3]
    if not width or not height:
        raise NamoError(f"{what}: expected a width and a height beside the viewBox, got {width} and {height}")
    view = _view_box(attributes["viewBox"], what)
    scale = np.array([width / view[2], height / view[3]])
    align = attributes.get("preserveAspectRatio", "xMidYMid").split()
    if align[0] == "none":
        return shift_by(x, y) @ np.diag([*scale, 1.0]) @ shift_by(-view[0], -view[1])
    if align[0] != "xMidYMid" or align[1:] not in ([], ["meet"]):
        raise NamoError(f"{what}: preserveAspectRatio: expected none or xMidYMid meet, got {' '.join(align)!r}")
    factor = float(scale.min())
    rest_x, rest_y = (width - factor * view[2]) / 2.0, (height - factor * view[3]) / 2.0
    return shift_by(x + rest_x, y + rest_y) @ np.diag([factor, factor, 1.0]) @ shift_by(-view[0], -view[1])


def read_length(text: str | None, what: str) -> tuple[float, str] | None:
    """Return a length as number and unit; None where there is none, or it is a share of what is not known.

    Raises:
        NamoError: it is no length.
    """
    if text is None or text.strip() in ("", "auto") or text.strip().endswith("%"):
        return None
    found = LENGTH.match(text)
    if found is None or found.group(2) not in ("", "px", *CENTIMETRES) or not abs(float(found.group(1))) <= LARGEST:
        raise NamoError(f"{what}: expected a number with px, cm, mm, in, pt, pc or no unit, got {text[:40]!r}")
    return float(found.group(1)), found.group(2)


def read_numbers(text: str, what: str) -> list[float]:
    """Return the numbers of a list with spaces or commas.

    Raises:
        NamoError: something in it is no number, or too large.
    """
    rest = re.sub(rf"{NUMBER}|[\s,]+", "", text)
    numbers = [float(number) for number in re.findall(NUMBER, text)]
    if rest or any(not abs(number) <= LARGEST for number in numbers):
        raise NamoError(f"{what}: expected numbers of at most {LARGEST:g}, got {text[:60]!r}")
    return numbers


def _view_box(text: str, what: str) -> list[float]:
    view = read_numbers(text, f"{what}: viewBox")
    if len(view) != 4 or not min(view[2:]) > 0.0:
        raise NamoError(f"{what}: viewBox: expected x, y, width and height over 0, got {text[:60]!r}")
    return view


def _scale(length: tuple[float, str], extent: float) -> float:
    """Return how many centimetres a unit is, from the length at which an extent [units] is shown."""
    return length[0] / extent * CENTIMETRES.get(length[1], 1.0)
