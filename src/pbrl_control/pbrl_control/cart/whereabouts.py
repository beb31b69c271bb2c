"""Where the base is in `map`, without jumps: dead reckoning, led back slowly to what a localiser says."""

from __future__ import annotations

from collections import deque

import numpy as np

from pbrl_control.planar import Array, compose, inverse, wrap

REMEMBERED = 1.0
"""[s] of odometry: a localiser's readings come late."""
GAIN = 0.1
"""Share of a localiser's correction that is taken over with each reading."""


class Whereabouts:
    """Pose of `base` in `map`.

    The local controller follows its plan in a frame that must not jump (thesis 4.5.5: the odometric one). This frame is
    `map` itself as far as the localiser's slow errors go, and as smooth as odometry at each reading: a tenth of the
    difference is taken over, at the place of the robot, where a turn of the frame moves nothing.
    """

    def __init__(self) -> None:
        self._past: deque[tuple[float, Array]] = deque()
        self._twist = np.zeros(3)
        self._odom: Array | None = None
        self._readings = 0

    @property
    def time(self) -> float:
        """Of the last odometry [s]; -inf: none yet."""
        return self._past[-1][0] if self._past else -np.inf

    def moved(self, time: float, pose: Array, twist: Array) -> None:
        """Take in odometry: pose (3,) in `odom`, twist (3,) in `base`, `time` [s]."""
        self._past.append((time, np.array(pose, dtype=float)))
        self._twist = np.array(twist, dtype=float)
        while self._past[0][0] < time - REMEMBERED:
            self._past.popleft()

    def localised(self, time: float, pose: Array) -> None:
        """Take in a localiser's pose (3,) in `map` of the time `time` [s]."""
        then = self._odometry(time)
        if then is None:
            return
        self._readings += 1
        told = np.asarray(pose, dtype=float)
        if self._odom is None:
            self._odom = compose(told, inverse(then))
            return
        # The first readings are averaged: nothing is known before them.
        gain = max(GAIN, 1.0 / self._readings)
        believed = compose(self._odom, then)
        off = told - believed
        off[2] = wrap(off[2])
        self._odom = compose(believed + gain * off, inverse(then))

    def pose(self, time: float) -> Array | None:
        """Return the pose (3,) in `map` at a time [s] within the last second or a little ahead; None: not known."""
        then = self._odometry(time)
        return None if then is None or self._odom is None else compose(self._odom, then)

    def _odometry(self, time: float) -> Array | None:
        """Return odometry's pose (3,) at a time: between readings linear, after the last one by the twist."""
        if not self._past:
            return None
        last, pose = self._past[-1]
        if time >= last:
            return compose(pose, self._twist * min(time - last, 0.1))
        earlier = self._past[0]
        for reading in self._past:
            if reading[0] >= time:
                break
            earlier = reading
        if reading[0] <= earlier[0]:
            return earlier[1].copy()
        share = (time - earlier[0]) / (reading[0] - earlier[0])
        step = reading[1] - earlier[1]
        step[2] = wrap(step[2])
        return earlier[1] + max(share, 0.0) * step
