"""Real-time priority of a process, as ros2_control's controller manager takes it; Linux only."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from pbrl_control.errors import ControlError


def take_priority(priority: int) -> None:
    """Schedule every thread of this process first in, first out, before all that has no such priority.

    Threads that are made later inherit it. What never waits would hold up a core: it is for loops that sleep.

    Args:
        priority: 1 to 99; 0 leaves everything as it is.

    Raises:
        ControlError: the system does not allow it.
    """
    if not priority:
        return
    try:
        for thread in sorted(int(entry.name) for entry in Path("/proc/self/task").iterdir()):
            with suppress(ProcessLookupError):  # one that ended meanwhile
                os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        raise ControlError(
            f"priority: expected to be allowed SCHED_FIFO {priority}, got {error.strerror}; allow `rtprio` in "
            f"/etc/security/limits.conf, or leave priority at 0"
        ) from error
