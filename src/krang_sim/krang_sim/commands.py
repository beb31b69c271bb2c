"""Velocity commands and the watchdog over them: what nobody repeats stops."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from krang_sim.errors import KrangError

Array = NDArray[np.float64]

TIMEOUT = 0.2
"""Age [s] at which a command no longer counts."""


class CommandWatchdog:
    """The last command of each group, zero once it is older than `TIMEOUT`."""

    def __init__(self, groups: Mapping[str, int]) -> None:
        """Start with every group at zero.

        Args:
            groups: number of values by group name.
        """
        self._size = dict(groups)
        self._values: dict[str, tuple[float, Array]] = {}

    def set(self, group: str, values: Sequence[float], time: float) -> None:
        """Take a command that came at `time` [s].

        Raises:
            KrangError: a wrong number of values, or one that is not finite; the command before stays.
        """
        if len(values) != self._size[group]:
            raise KrangError(
                f"{group} command: expected {self._size[group]} values, got {len(values)}; send one a joint"
            )
        if not all(math.isfinite(value) for value in values):
            raise KrangError(f"{group} command: expected finite values, got {list(values)}; send zeros to stop")
        self._values[group] = (time, np.array(values, dtype=float))

    def current(self, group: str, time: float) -> Array:
        """Give the command in force at `time` [s]; zeros where none is."""
        given, values = self._values.get(group, (-math.inf, np.zeros(0)))
        return values if time - given < TIMEOUT else np.zeros(self._size[group])
