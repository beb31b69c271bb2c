"""What every search with OMPL needs: its seed, silence, and an end by iterations, by time, or both.

OMPL has one generator of seeds and one log level a process. To a seed that is set a second time it objects that
sampling will not be deterministic. It is, in every planner, space and sampler made afterwards, and each search makes
its own. Within a session nobody else may set the seed: sessions of several threads wait for each other.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from ompl import base as ob
from ompl import util as ou

from pbrl_planner.errors import PlannerError

_ONE_AT_A_TIME = threading.RLock()


@contextmanager
def seeded(seed: int) -> Iterator[None]:
    """Start OMPL's random numbers anew from a seed above zero, and keep OMPL quiet while a search runs.

    Raises:
        PlannerError: the seed is not a whole number from 1 to 2^32 - 1.
    """
    if isinstance(seed, bool) or not 0 < seed < 2**32 or int(seed) != seed:
        raise PlannerError(f"seed: expected a whole number from 1 to 2^32 - 1, got {seed!r}")
    with _ONE_AT_A_TIME:
        level = ou.getLogLevel()
        ou.setLogLevel(ou.LogLevel.LOG_NONE)
        try:
            ou.RNG.setSeed(int(seed))
            yield
        finally:
            ou.setLogLevel(level)


class Budget:
    """Ends a search after so many iterations or so much time, and says which it was.

    Args:
        iterations: most that are begun.
        seconds: from now on.

    Attributes:
        used: iterations begun.
        timed_out: the time ended it.
    """

    def __init__(self, iterations: int, seconds: float) -> None:
        self._most = iterations
        self._begin = time.monotonic()
        self._limit = seconds
        self.used = 0
        self.timed_out = False

    @property
    def elapsed(self) -> float:
        """Time since the start [s]."""
        return time.monotonic() - self._begin

    def is_spent(self) -> bool:
        """Say whether to stop; called once before each iteration, counts it if there is to be one."""
        if self.elapsed >= self._limit:
            self.timed_out = True
            return True
        if self.used >= self._most:
            return True
        self.used += 1
        return False

    def condition(self) -> ob.PlannerTerminationCondition:
        """Return it as what OMPL asks before each iteration."""
        return ob.PlannerTerminationCondition(self.is_spent)
