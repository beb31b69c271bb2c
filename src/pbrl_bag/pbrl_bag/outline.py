"""What makes an outline of a body, and a name: told in words where it is none."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import ArrayLike

from pbrl_bag.types import Array

LARGEST = 100.0  # [m] a corner further than this from the body's tag is a slip of unit or sign
MOST_CORNERS = 1000  # every edge is held against every other
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,99}")


def fault_of_name(name: str) -> str:
    """Say what is wrong with a body's name, which is part of topics and of file names; nothing if all is well."""
    if _NAME.fullmatch(name):
        return ""
    return (
        f"expected a name of letters, digits and underscores, 100 at most, that starts with a letter, got {name[:60]!r}"
    )


def fault_of_outline(corners: ArrayLike) -> str:
    """Say what is wrong with the corners (k, 2) [m] of a footprint; nothing if all is well."""
    points = np.asarray(corners, dtype=np.float64)
    if len(points) < 3:
        return f"expected at least 3 corners, got {len(points)}"
    if len(points) > MOST_CORNERS:
        return f"expected at most {MOST_CORNERS} corners, got {len(points)}"
    if not np.isfinite(points).all():
        return "expected finite numbers, got NaN or infinity"
    if np.abs(points).max() > LARGEST:
        return f"expected corners within {LARGEST:g} m of the body's origin, got {np.abs(points).max():.4g} m"
    following = np.roll(points, -1, axis=0)
    area = 0.5 * float(_cross(points, following).sum())
    if crossing := _crossing(points, following):
        return f"expected an outline that does not cross itself, got edges {crossing[0]} and {crossing[1]} that do"
    if area <= 0.0:
        return f"expected counter-clockwise corners, got an area of {area:.4g} m^2"
    return ""


def _cross(a: Array, b: Array) -> Array:
    """Return the third component of the cross product of plane vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _crossing(start: Array, end: Array) -> tuple[int, int] | None:
    """Return the first two edges, counted from 1, that cross properly; None where none do."""
    for i in range(len(start)):
        one, other, from_there = end[i] - start[i], end[i + 1 :] - start[i + 1 :], start[i] - start[i + 1 :]
        sides = _cross(one, -from_there) * _cross(one, end[i + 1 :] - start[i])
        back = _cross(other, from_there) * _cross(other, end[i] - start[i + 1 :])
        found = np.flatnonzero((sides < 0.0) & (back < 0.0))
        if len(found):
            return i + 1, i + 2 + int(found[0])
    return None
