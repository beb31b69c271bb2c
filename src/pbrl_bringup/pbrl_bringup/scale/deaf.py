"""What workers of a cluster of ours load first: a terminal sends Ctrl-C to all, but only the command ends by it."""

from __future__ import annotations

import signal

from distributed import Worker


def dask_setup(worker: Worker) -> None:
    """Leave Ctrl-C to the command, which ends its workers; Dask calls this at a worker's start."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
