"""Where robot and cart have come from: the way back, where somebody wants to get out whom they shut in."""

from __future__ import annotations

import numpy as np

from pbrl_control.planar import Array, wrap

STEP = 0.05
"""Between two poses that are kept, and back along which nothing is won [m, rad]."""
LEAST = 0.3
"""Way back that makes room for nobody where it is shorter [m]."""
KEPT = 2000
"""Poses."""


HEADWAY = np.array([0.75, 1.0])
"""How far from where they were they have got on, in place [m] or by turning [rad]: who follows somebody who steps back,
a hand's breadth at a time, has not."""


class Headway:
    """Whether robot and cart get on."""

    def __init__(self) -> None:
        self._from: Array | None = None

    def at(self, pose: Array) -> bool:
        """Take in where they are (4,); return whether they have got on since the last time that they had."""
        if self._from is None:
            self._from = np.array(pose, dtype=float)
        moved = np.array([np.hypot(*(pose - self._from)[:2]), abs(wrap(float(pose[2] - self._from[2])))])
        if (moved < HEADWAY).all():
            return False
        self._from = np.array(pose, dtype=float)
        return True


class Trail:
    """Poses (4,) of robot and cart, one after the other."""

    def __init__(self) -> None:
        self._poses: list[Array] = []
        self._here: Array | None = None

    def at(self, pose: Array) -> None:
        """Take in where they are (4,) [m, m, rad, rad]."""
        self._here = np.array(pose, dtype=float)
        if self._poses:
            moved = pose - self._poses[-1]
            moved[2] = wrap(float(moved[2]))
            if np.hypot(*moved[:2]) < STEP and np.abs(moved[2:]).max() < STEP:
                return
        self._poses = [*self._poses[1 - KEPT :], np.array(pose, dtype=float)]

    def back(self, way: float) -> Array | None:
        """Return poses (n, 4) from where they are back along where they came, as far as asked for; those are forgotten.

        Args:
            way: [m] of the base.

        Returns:
            None where there is next to no way back.
        """
        poses = np.array(self._poses[::-1]).reshape(-1, 4)
        if self._here is not None and (self._here != poses[0]).any():
            poses = np.vstack((self._here, poses))
        passed = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))))
        if not len(poses) or passed[-1] < LEAST:
            return None
        count = min(int(np.searchsorted(passed, way)) + 1, len(poses))
        self._poses, self._here = list(poses[count - 1 :][::-1]), None
        back = poses[:count].copy()
        # Headings beside each other, not a turn apart.
        back[:, 2] = np.unwrap(back[:, 2])
        return back
