"""How fast a robot went, from where it was heard to be."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def fastest(way: Sequence[tuple[float, np.ndarray]], begin: float, end: float) -> float:
    """Return the greatest speed between two times [m/s], over a tenth of a second each; poses by time [s]."""
    times = np.array([time for time, _ in way])
    places = np.array([pose[:2] for _, pose in way])
    grid = np.arange(begin, end + 1e-9, 0.1)
    at = np.column_stack([np.interp(grid, times, places[:, k]) for k in (0, 1)])
    return float(np.hypot(*np.diff(at, axis=0).T).max() / 0.1)
