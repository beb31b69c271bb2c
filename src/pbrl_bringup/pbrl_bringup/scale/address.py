"""What `--scheduler` can say: a cluster of this machine's own, or the address of somebody's scheduler."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass

from pbrl_bringup.errors import BringupError

LOCAL = "local"
"""A cluster of this machine, a worker for each core."""
OWN = re.compile(rf"{LOCAL}(?::(\d{{1,9}}))?")
REMOTE = re.compile(r"(?:(?P<protocol>\w+)://)?(?P<host>\[[0-9a-fA-F:.%]+\]|[^\s:/\[\]]+):(?P<port>\d{1,9})/?")
PROTOCOLS = ("tcp", "tls")
MOST_WORKERS = 1024
EXPECTED = "expected local, local:WORKERS or the address of a Dask scheduler, as tcp://127.0.0.1:8786"


@dataclass(frozen=True)
class Scheduler:
    """Where pieces of work go.

    Attributes:
        address: of a scheduler that runs, with its protocol; empty: one is started on this machine.
        workers: processes of a cluster of this machine; 0 where there is an address.
    """

    address: str
    workers: int


def parse_scheduler(text: str) -> Scheduler:
    """Read what `--scheduler` was given.

    Raises:
        BringupError: it is neither `local`, `local:WORKERS` nor an address.
    """
    if local := OWN.fullmatch(text):
        workers = len(os.sched_getaffinity(0)) if local[1] is None else int(local[1])
        if not 1 <= workers <= MOST_WORKERS:
            raise BringupError(f"--scheduler {text}: expected 1 to {MOST_WORKERS} workers, got {workers}")
        return Scheduler("", workers)
    remote = REMOTE.fullmatch(text)
    if remote is None:
        raise BringupError(f"--scheduler: {EXPECTED}, got {text[:80]!r}")
    protocol, port = remote["protocol"] or "tcp", int(remote["port"])
    if protocol not in PROTOCOLS or not 0 < port < 65536:
        what = f"the protocol {protocol!r}" if protocol not in PROTOCOLS else f"the port {port}"
        raise BringupError(f"--scheduler: {EXPECTED}, got {what} in {text[:80]!r}")
    return Scheduler(f"{protocol}://{remote['host']}:{port}", 0)
