"""Velocity commands and the watchdog over them: what nobody repeats stops."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bullet_sim.errors import SimError

Array = NDArray[np.float64]


class CommandWatchdog:
    """The last command of each group, zero once it is too old."""

    def __init__(self, groups: Mapping[str, int], *, timeout: float, refusal: type[SimError] = SimError) -> None:
        """Start with every group at zero.

        Args:
            groups: number of values by group name.
            timeout: age [s] at which a command no longer counts.
            refusal: the error for a command that is none.
        """
        self._size, self._timeout, self._refusal = dict(groups), timeout, refusal
        self._values: dict[str, tuple[float, Array]] = {}

    def set(self, group: str, values: Sequence[float], time: float) -> None:
        """Take a command that came at `time` [s].

        Raises:
            SimError: a wrong number of values, or one that is not finite; the command before stays.
        """
        if len(values) != self._size[group]:
            raise self._refusal(
                f"{group} command: expected {self._size[group]} values, got {len(values)}; send one a joint"
            )
        if not all(math.isfinite(value) for value in values):
            raise self._refusal(f"{group} command: expected finite values, got {list(values)}; send zeros to stop")
        self._values[group] = (time, np.array(values, dtype=float))

    def current(self, group: str, time: float) -> Array:
        """Give the command in force at `time` [s]; zeros where none is."""
        given, values = self._values.get(group, (-math.inf, np.zeros(0)))
        return values if time - given < self._timeout else np.zeros(self._size[group])

    def fresh(self, group: str, time: float) -> bool:
        """Say whether a command is in force at `time` [s], be it zeros."""
        return group in self._values and time - self._values[group][0] < self._timeout
