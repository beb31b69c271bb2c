"""When something comes or goes, sought all over the recording.

While a body neither speeds up nor turns, a load is not felt: between such times its moment has a top each, and a climb
ends on the one that it began on.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOMENTS = 24
"""So many, evenly over the recording."""


def at_moments(found: Array, column: int, clock: Array) -> Array:
    """Return starts (n + MOMENTS, K): those that were found, and the first of them at other moments.

    Args:
        found: (n, K) coordinates, likeliest first.
        column: of the moment [s] among them.
        clock: (T,) times of the recording [s].
    """
    other = found[:1].repeat(MOMENTS, axis=0)
    other[:, column] = clock[0] + (np.arange(MOMENTS) + 0.5) / MOMENTS * (clock[-1] - clock[0])
    return np.concatenate([found, other])
