"""Who has not been heard for too long: streams and services that nothing can be done without, on a clock as told."""

from __future__ import annotations

from collections.abc import Iterable

OWN_DELAY = 0.5
"""A look that comes later than this after the last one says that the looking process stood still, not others [s]."""


class Liveness:
    """Watches streams.

    Args:
        names: of what is watched, in words that fit "nothing of ... for 1.2 s".
        patience: silence that counts as absence [s].
    """

    def __init__(self, names: Iterable[str], patience: float) -> None:
        self._patience = patience
        self._names = tuple(names)
        self._heard: dict[str, float] = {}
        self._looked: float | None = None

    def begin(self, now: float) -> None:
        """Watch from now on: until the patience is over everybody counts as present."""
        self._heard = dict.fromkeys(self._names, now)
        self._looked = now

    def heard(self, name: str, now: float) -> None:
        """Take in a sign of life."""
        if name in self._heard:
            self._heard[name] = max(now, self._heard[name])

    def complaint(self, now: float) -> str:
        """Return who is gone and for how long, in one line; empty where nobody is, or nobody is watched."""
        late = 0.0 if self._looked is None else now - self._looked
        self._looked = now
        if late > OWN_DELAY:
            # What has come meanwhile is still in the queues: whoever was present then is given the time to be read.
            self._heard = {
                name: now if self._looked_alive(time, now - late) else time for name, time in self._heard.items()
            }
        elif late < 0.0:  # the clock was set back, as by a simulator begun anew
            self._heard = {name: min(time, now) for name, time in self._heard.items()}
        gone = [f"{name} for {now - time:.0f} s" for name, time in self._heard.items() if now - time > self._patience]
        return f"nothing of {', '.join(gone)}" if gone else ""

    def _looked_alive(self, heard: float, looked: float) -> bool:
        return looked - heard <= self._patience
