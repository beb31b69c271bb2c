"""Krang's velocity commands and the watchdog over them."""

from __future__ import annotations

from collections.abc import Mapping

from bullet_sim import commands
from krang_sim.errors import KrangError

TIMEOUT = 0.1
"""Age [s] at which a command no longer counts: ten of a controller's that runs at 100 Hz."""


class CommandWatchdog(commands.CommandWatchdog):
    """The last command of each group, zero once it is older than `TIMEOUT`; refuses with a KrangError."""

    def __init__(self, groups: Mapping[str, int]) -> None:
        super().__init__(groups, timeout=TIMEOUT, refusal=KrangError)
