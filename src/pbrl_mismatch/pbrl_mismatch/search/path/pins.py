"""Whether a body turned about one place of the floor throughout, and which: where it may be pinned."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.track import Track
from pbrl_model.transforms import plane_rotations

Array = NDArray[np.float64]

GIVE = 0.05
"""A pin's bushing gives less [m]: a body that moved further about every place is not pinned."""
SHARE, SCATTER = 0.7, 0.03
"""Of the draws that are placed so, and how far off [m]; the others stay as the prior has them."""


def fixed_place(track: Track) -> tuple[Array, float]:
    """Return the place (2,) in the world about which the body turned, by least squares, and how far it moved there.

    The point of the body that was over the place h when the first episode began is at

        p(t) + R(t) R(0)^T (h - p(0)),

    which is h as long as a pin does not give: linear in h.

    Args:
        track: of the body.

    Returns:
        h [m], and the root mean square of its distance from that point [m].
    """
    x, y, turn = track.seen[:, :3].T
    turned = plane_rotations(turn - turn[0])
    place = np.stack([x, y], -1)
    matrix, target = turned - np.eye(2), turned @ place[0] - place
    found, *_ = np.linalg.lstsq(matrix.reshape(-1, 2), target.reshape(-1), rcond=None)
    moved = matrix @ found - target
    return np.asarray(found, dtype=np.float64), float(np.sqrt(np.mean(np.sum(moved**2, axis=1))))


def may_be_pinned(track: Track) -> bool:
    """Tell whether a place moved no more than a bushing gives, and lies where the body or what it hangs on can be."""
    place, moved = fixed_place(track)
    size = float(np.hypot(*np.ptp(track.outline, axis=0)))
    return moved < GIVE and float(np.hypot(*(place - track.seen[:, :2].mean(axis=0)))) < size


def with_pins(
    rng: np.random.Generator, draws: Array, columns: tuple[int, int], track: Track, share: float = SHARE
) -> Array:
    """Put the pin where the body turned in a share of the draws (n, K).

    Args:
        rng: which draws, and how far off.
        draws: of a prior.
        columns: of the place.
        track: of the body.
        share: of the draws; the others stay as they are.
    """
    if not may_be_pinned(track):
        return draws
    place, _ = fixed_place(track)
    out, count = draws.copy(), int(share * len(draws))
    out[:count, list(columns)] = place + SCATTER * rng.standard_normal((count, 2))
    return out
