"""Parameter rows simulated over windows: the compiled kernel with its buffers made and its threads kept apart."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.kernels.columns import WIDTH
from pbrl_mismatch.kernels.motion_kernel import simulate_parallel, simulate_serial
from pbrl_model.rollout import KERNEL_LOCK, plain

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def poses(
    rows: Array,
    cuts: Cuts,
    told: Array | None = None,
    extra: Array | None = None,
    asked: Mask | None = None,
    *,
    parallel: bool = False,
) -> Array:
    """Simulate every row over every window.

    Args:
        rows: (P, WIDTH) parameter rows.
        cuts: W windows.
        told: (P, W, 6) start states; None: as smoothed.
        extra: (P, W, K, 3) added wrench in the body's axes, straight between K knots [N, N, N m]; None: none.
        asked: (P, W) which windows of which rows are simulated; None: all.
        parallel: on all cores; otherwise on this one, and other threads may simulate beside it. The bytes are the same.

    Returns:
        (P, W, N, 3) poses of the body's frame as tags would see it; zero where they were not asked.

    Raises:
        MismatchError: a shape does not fit.
    """
    count, windows = len(rows), len(cuts)
    if rows.ndim != 2 or rows.shape[1] != WIDTH:
        raise MismatchError(f"simulation: expected rows of {WIDTH} columns, got shape {rows.shape}")
    starts = np.broadcast_to(cuts.told, (count, windows, 6)) if told is None else told
    if starts.shape != (count, windows, 6):
        raise MismatchError(f"simulation: expected starts of shape {(count, windows, 6)}, got {starts.shape}")
    added = np.zeros((1, 1, 1, 3)) if extra is None else extra
    track = cuts.track
    out = np.zeros((count, *cuts.place.shape, 3))
    arguments = (
        plain(rows),
        plain(starts),
        plain(np.broadcast_to(added, (count, windows, *added.shape[2:]))),
        track.felt,
        track.mount,
        track.seen,
        track.clock,
        cuts.span,
        cuts.pivot,
        track.body,
        track.outline,
        track.feet,
        cuts.place,
        np.ones((count, windows), dtype=np.bool_) if asked is None else asked,
        out,
    )
    if parallel:
        with KERNEL_LOCK:
            simulate_parallel(*arguments)
    else:
        simulate_serial(*arguments)
    return out
