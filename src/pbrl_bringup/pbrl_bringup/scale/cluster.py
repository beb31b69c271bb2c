"""A Dask cluster for the length of a block: one of this machine, or somebody's that runs already."""

from __future__ import annotations

import asyncio
import logging
import os
import socket
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import dask
from distributed import Client, LocalCluster, rpc
from distributed.security import Security

from pbrl_bringup.errors import BringupError
from pbrl_bringup.parallel import THREADS
from pbrl_bringup.scale.address import Scheduler, parse_scheduler
from pbrl_bringup.scale.worker import OneOfOurs, WrongWorkerError, code_of
from pbrl_bringup.terminal import say

ANSWER = 5.0
"""So long [s] a scheduler has to answer."""
FIRST_WORKER = 60.0
"""So long [s] is waited for a first worker."""
LOOPBACK = "127.0.0.1"
DEAF = "pbrl_bringup.scale.deaf"
LOGGERS = ("distributed", "tornado", "asyncio")


@contextmanager
def cluster(where: str) -> Iterator[Client]:
    """Yield a client of a cluster, which is checked; a cluster that was started for it ends with the block.

    Args:
        where: `local`, `local:WORKERS`, or the address of a scheduler.

    Raises:
        BringupError: `where` is none of these; no scheduler or worker answers; a worker has other code or threads.
    """
    chosen = parse_scheduler(where)
    with _quiet(), _own(chosen) if not chosen.address else _found(chosen) as client:
        _check(client, chosen)
        yield client


@contextmanager
def _own(chosen: Scheduler) -> Iterator[Client]:
    with started(chosen.workers) as made, Client(made, set_as_default=False) as client:
        yield client


@contextmanager
def started(workers: int, host: str = LOOPBACK, port: int = 0) -> Iterator[LocalCluster]:
    """Start a cluster, whose workers are started again where they die; it ends with the block.

    Args:
        workers: processes of one thread each.
        host: address of this machine on which it listens; whoever can reach it can run anything.
        port: of the scheduler; 0: any.

    Raises:
        BringupError: it cannot listen there.
    """
    # A nanny sets these before its worker starts, when nothing is loaded yet.
    alone = dict.fromkeys(THREADS, "1") | {"DASK_LOGGING__DISTRIBUTED": "critical"}
    place = {"dashboard": False, "dashboard_address": f"{host}:0"}
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        with socket.create_server((host, port), family=family):
            pass  # Dask would leave half of a cluster behind where this fails
    except OSError as error:
        raise BringupError(
            f"expected to listen on {host}, port {port or 'any'}, got: {error.strerror}; choose another --host, --port"
        ) from error
    with (
        _quiet(),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host=host,
            scheduler_port=port,
            dashboard_address=None,
            scheduler_kwargs=place,
            silence_logs=logging.CRITICAL,
            env=alone,
            preload=[DEAF],
        ) as made,
    ):
        yield made


@contextmanager
def _found(chosen: Scheduler) -> Iterator[Client]:
    """Connect to a scheduler that runs."""
    try:
        # A client waits for ever for what accepts connections and says nothing, so ask first who it is.
        kind = asyncio.run(asyncio.wait_for(_kind(chosen.address), ANSWER))
    except Exception as error:  # whatever listens there may say anything
        said = "none in time" if isinstance(error, TimeoutError) else str(error) or type(error).__name__
        raise _no_scheduler(chosen, said) from error
    if kind != "Scheduler":
        raise _no_scheduler(chosen, f"the address of a {kind}")
    with Client(chosen.address, timeout=ANSWER, set_as_default=False) as client:
        yield client


async def _kind(address: str) -> str:
    async with rpc(address, timeout=ANSWER, connection_args=Security().get_connection_args("client")) as there:
        return str((await there.identity())["type"])


def _no_scheduler(chosen: Scheduler, got: str) -> BringupError:
    return BringupError(
        f"--scheduler {chosen.address}: expected a Dask scheduler that answers within {ANSWER:g} s, got {got}; "
        "start one (docs/scale.md), or say --scheduler local"
    )


def _check(client: Client, chosen: Scheduler) -> None:
    """Wait for a first worker, and see that all that are there, or come, are like this process.

    Raises:
        BringupError: none comes, or one is not.
    """
    named = f"--scheduler {chosen.address or 'local'}"
    if not client.nthreads():
        say(f"pbrl: {named} has no worker yet; one is waited for, {FIRST_WORKER:g} s at most")
    try:
        client.wait_for_workers(1, timeout=FIRST_WORKER)
    except TimeoutError as error:
        raise BringupError(
            f"{named}: expected at least one worker within {FIRST_WORKER:g} s, got none; "
            "start some beside it (docs/scale.md)"
        ) from error
    try:
        client.register_plugin(OneOfOurs(code_of()))
    except WrongWorkerError as error:
        raise BringupError(f"{named}: {error}") from error
    except ImportError as error:
        raise BringupError(
            f"{named}: expected workers started in the environment of ./pbrl, got one that says: {error}; "
            "see docs/scale.md"
        ) from error


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep what Dask says of itself off the terminal: what a person has to know is raised."""
    before = {name: logging.getLogger(name).level for name in LOGGERS}
    for name in LOGGERS:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings(), dask.config.set({"distributed.comm.retry.count": 0}):
            warnings.filterwarnings("ignore", module="distributed")
            yield
    finally:
        for name, level in before.items():
            logging.getLogger(name).setLevel(level)


def process_ids(client: Client) -> dict[str, int]:
    """Return the process of each worker, by address."""
    return dict(client.run(os.getpid))
