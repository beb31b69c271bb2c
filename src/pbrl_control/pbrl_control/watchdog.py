"""Which commands are still commands: pure, `now` is given."""

from __future__ import annotations

from collections.abc import Mapping

from pbrl_control.types import PlanarTwist


class Watchdog:
    """Keeps the last twist of each target, and forgets it when it is older than the time-out.

    A stamp from the future counts as old too: a clock that was set back must not keep the robot moving.
    """

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._last: dict[str, tuple[float, PlanarTwist]] = {}

    def feed(self, now: float, target: str, twist: PlanarTwist) -> None:
        """Take in a command that arrived at `now` [s]."""
        self._last[target] = (now, twist)

    def current(self, now: float) -> Mapping[str, PlanarTwist]:
        """Return the commands that are at most the time-out old at `now` [s]."""
        self._last = {target: entry for target, entry in self._last.items() if 0.0 <= now - entry[0] <= self._timeout}
        return {target: twist for target, (_, twist) in self._last.items()}
