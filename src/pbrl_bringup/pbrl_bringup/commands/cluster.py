"""`./pbrl cluster`: a scheduler and workers that stay, or more workers for one that runs elsewhere."""

from __future__ import annotations

import os
import sys
import threading

from pbrl_bringup.errors import BringupError
from pbrl_bringup.parallel import THREADS
from pbrl_bringup.scale.address import parse_scheduler
from pbrl_bringup.scale.cluster import LOOPBACK, started
from pbrl_bringup.terminal import output, say

WORKER = ("-m", "distributed.cli.dask_worker", "--nthreads", "1", "--no-dashboard")


def command(workers: int | None, host: str, port: int, join: str | None) -> int:
    """Keep a cluster, or workers, until Ctrl-C.

    Args:
        workers: processes; None: one for each core.
        host: address of this machine that the scheduler listens on.
        port: of the scheduler; 0: any.
        join: address of a scheduler that runs, for which workers are started; None: a scheduler of its own.

    Raises:
        BringupError: it cannot listen there, or `join` is no address.
    """
    count = len(os.sched_getaffinity(0)) if workers is None else workers
    if join is not None:
        address = parse_scheduler(join).address
        if not address:
            raise BringupError(f"--join: expected the address of a scheduler, as tcp://10.0.0.1:8786, got {join!r}")
        say(f"pbrl: {count} workers for {address}, until Ctrl-C")
        environment = os.environ | dict.fromkeys(THREADS, "1") | {"DASK_LOGGING__DISTRIBUTED": "warning"}
        os.execve(sys.executable, [sys.executable, *WORKER, address, "--nworkers", str(count)], environment)
    with started(count, host, port) as made:
        output().print(made.scheduler_address)
        if host != LOOPBACK:
            say(f"pbrl: whoever can reach {host} can run anything here as you: for a network that you trust only")
        say(f"pbrl: {count} workers; ./pbrl fit ... --scheduler {made.scheduler_address}; Ctrl-C ends them")
        try:
            threading.Event().wait()
        except KeyboardInterrupt:
            say("pbrl: stopping")
    return 0
