"""A window that rolls over the floor by whole cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def roll(layer: NDArray, rows: int, columns: int, blank: float) -> None:
    """Move a layer's content (rows, columns, ...) by so many cells towards its corner, in place; `blank` comes in."""
    moved = np.full_like(layer, blank)
    height, width = layer.shape[:2]
    if abs(rows) < height and abs(columns) < width:
        to = slice(max(-rows, 0), height - max(rows, 0)), slice(max(-columns, 0), width - max(columns, 0))
        source = slice(max(rows, 0), height + min(rows, 0)), slice(max(columns, 0), width + min(columns, 0))
        moved[to] = layer[source]
    layer[:] = moved
