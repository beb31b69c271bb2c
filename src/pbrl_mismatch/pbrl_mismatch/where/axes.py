"""The frames in which a left-out wrench may keep its direction: the floor's, the body's, and the motion's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.unknown.features import STILL, along_motion
from pbrl_mismatch.unknown.samples import Samples

Array = NDArray[np.float64]

FRAMES = ("world", "body", "velocity")
PARTS = {
    "world": ("x", "y", "moment"),
    "body": ("ahead", "left", "moment"),
    "velocity": ("along", "left", "moment with the turn"),
}
"""What the three numbers of a wrench in each frame are."""


def axes_of(samples: Samples, frame: str) -> Array:
    """Return (N, 3, 3) what a wrench of one [N, N, N m] in each of a frame's parts is in world axes.

    Near rest the motion has no direction, and what goes with it fades.

    Args:
        samples: N moments.
        frame: one of `FRAMES`.
    """
    if frame == "velocity":
        way = along_motion(samples)
        turn = samples.spin / np.sqrt(samples.spin**2 + (STILL / samples.gyration) ** 2)
    elif frame == "body":
        way = np.stack([np.cos(samples.heading), np.sin(samples.heading)], -1)
        turn = np.ones(len(samples))
    else:
        way, turn = np.tile([1.0, 0.0], (len(samples), 1)), np.ones(len(samples))
    axes = np.zeros((len(samples), 3, 3))
    axes[:, :2, 0], axes[:, 0, 1], axes[:, 1, 1], axes[:, 2, 2] = way, -way[:, 1], way[:, 0], turn
    return axes
