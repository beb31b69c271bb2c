"""Compiled: a heap of whole numbers with four children a node: half the levels of one with two.

An entry is one int64, the key in its upper bits and what it belongs to in the lower ones, so that a comparison is one
instruction and equal keys come out in one order.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Long = NDArray[np.int64]


@njit(cache=True, inline="always")
def heap_push(heap: Long, size: int, entry: int) -> int:
    """Put an entry in; the heap has room for it. Return the new size."""
    place = size
    while place > 0:
        parent = (place - 1) >> 2
        above = heap[parent]
        if above <= entry:
            break
        heap[place] = above
        place = parent
    heap[place] = entry
    return size + 1


@njit(**LEAF)
def heap_pop(heap: Long, size: int) -> int:
    """Take the least entry out, which the caller has read from `heap[0]`. Return the new size."""
    size -= 1
    if size > 0:
        _sift_down(heap, size, 0, heap[size])
    return size


@njit(**LEAF)
def heapify(heap: Long, size: int) -> None:
    """Make a heap of the first `size` entries."""
    for place in range((size - 2) >> 2, -1, -1):
        _sift_down(heap, size, place, heap[place])


@njit(cache=True, inline="always")
def _sift_down(heap: Long, size: int, place: int, entry: int) -> None:
    while True:
        child = 4 * place + 1
        if child >= size:
            break
        least, value = child, heap[child]
        for other in range(child + 1, min(child + 4, size)):
            if heap[other] < value:
                least, value = other, heap[other]
        if value >= entry:
            break
        heap[place] = value
        place = least
    heap[place] = entry
