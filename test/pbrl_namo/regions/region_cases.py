"""Rooms that the tests of regions share."""

from __future__ import annotations

import numpy as np

from pbrl_namo.scene import Movable, NamoScene
from pbrl_namo.scenes.office import random_office


def box(x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def table(width: float = 0.75, depth: float = 1.5, height: float = 0.7775) -> Movable:
    return Movable(box(-width / 2, -depth / 2, width / 2, depth / 2), height, 33.0)


def corridor(*tables: float, height: float = 0.7775, fixed: dict[str, np.ndarray] | None = None) -> NamoScene:
    """A corridor of 12 m x 2.6 m with tables across at some x; the robot is at one end, its goal at the other."""
    names = [f"table_{number + 1}" for number in range(len(tables))]
    return NamoScene.of(
        box(0.0, 0.0, 12.0, 2.6),
        fixed or {},
        {name: table(height=height) for name in names},
        {name: np.array([x, 1.3, 0.0]) for name, x in zip(names, tables, strict=True)},
        np.array([1.0, 1.3, 0.0]),
        np.array([11.0, 1.3, np.nan]),
    )


def office(count: int, seed: int) -> NamoScene:
    return random_office(count, np.random.default_rng(seed), move_needed=True)
