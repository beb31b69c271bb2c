"""Compiled: the exact Euclidean distance transform, and costs by distance."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Byte = NDArray[np.uint8]
Int = NDArray[np.int32]


@njit(cache=True)
def distances(lethal: Byte, found: Int) -> None:
    """Write squared distances to the nearest cell that is not 0; there has to be one.

    Args:
        lethal: (rows, columns).
        found: (rows, columns), out [cells^2].
    """
    rows, columns = lethal.shape
    far = rows + columns
    up = np.empty((rows, columns), dtype=np.int64)
    for j in range(columns):
        up[0, j] = 0 if lethal[0, j] else far
    for i in range(1, rows):
        for j in range(columns):
            up[i, j] = 0 if lethal[i, j] else min(up[i - 1, j] + 1, far)
    for i in range(rows - 2, -1, -1):
        for j in range(columns):
            up[i, j] = min(up[i, j], up[i + 1, j] + 1)
    owner = np.empty(columns, dtype=np.int64)
    begin = np.empty(columns, dtype=np.int64)
    for i in range(rows):
        g = up[i]
        last = 0
        owner[0] = begin[0] = 0
        for u in range(1, columns):
            while last >= 0:
                t, s = begin[last], owner[last]
                if (t - s) ** 2 + g[s] ** 2 <= (t - u) ** 2 + g[u] ** 2:
                    break
                last -= 1
            if last < 0:
                last = 0
                owner[0], begin[0] = u, 0
            else:
                s = owner[last]
                first = 1 + (u * u - s * s + g[u] ** 2 - g[s] ** 2) // (2 * (u - s))
                if first < columns:
                    last += 1
                    owner[last], begin[last] = u, first
        for u in range(columns - 1, -1, -1):
            s = owner[last]
            found[i, u] = (u - s) ** 2 + g[s] ** 2
            if u == begin[last]:
                last -= 1


@njit(**LEAF)
def spread(squared: Int, table: Byte, inscribed: int, cells: Byte) -> None:
    """Write costs by squared distance where they are more than what is there, 255 giving way to `inscribed` and more.

    Args:
        squared: (rows, columns) [cells^2].
        table: (n,) cost by squared distance; beyond it there is none.
        inscribed: cost from which an unknown cell is known to be closed.
        cells: (rows, columns) 0 or 255, in and out.
    """
    for i in range(squared.shape[0]):
        for j in range(squared.shape[1]):
            if squared[i, j] < len(table):
                cost = table[squared[i, j]]
                if cells[i, j] != 255 or cost >= inscribed:
                    cells[i, j] = cost
