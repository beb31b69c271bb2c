"""Pieces of work on a cluster: few at a time, each result as it comes, a worker that dies costs its piece only."""

from __future__ import annotations

import itertools
import time
import uuid
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import CancelledError
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from distributed import Client, Future, KilledWorker, wait
from distributed.comm.core import CommClosedError

from pbrl_bringup.errors import BringupError
from pbrl_bringup.scale.worker import WrongWorkerError, code_of, run_piece

Result = TypeVar("Result")

LOOK = 2.0
"""So often [s] it is looked whether anybody is still working."""
PATIENCE = 60.0
"""So long [s] a cluster may be without any worker."""
SHOWN = 200
"""Characters of a piece's arguments in a message."""


@dataclass(frozen=True)
class Done(Generic[Result]):
    """What became of a piece.

    Attributes:
        index: of its arguments.
        result: what it returned.
    """

    index: int
    result: Result


@dataclass(frozen=True)
class Failed:
    """A piece that has no result.

    Attributes:
        index: of its arguments.
        error: what it raised, or a BringupError that says that its workers died of it.
    """

    index: int
    error: Exception


def run_pieces(
    client: Client, trial: Callable[..., Result], arguments: Iterable[tuple[Any, ...]]
) -> Generator[Done[Result] | Failed]:
    """Run a trial for each tuple of arguments, as many at a time as there are workers.

    Arguments are taken when a worker is free for them, so they may be endless and of any number; results are held
    by nobody after they are yielded. A piece whose worker dies is run again by another one; one of which several
    workers die (`distributed.scheduler.allowed-failures`, 3 by default) has failed.

    Args:
        client: of the cluster; workers may come and go.
        trial: a function of a module that workers can import.
        arguments: of each piece; paths and seeds, not recordings. All must be picklable.

    Yields:
        What became of each piece, in the order in which they end.

    Raises:
        BringupError: the scheduler is gone, or all workers are for a minute, or one came that has other code.
    """
    run, numbered = uuid.uuid4().hex[:12], enumerate(arguments)
    waiting: dict[Future, tuple[int, tuple[Any, ...]]] = {}
    try:
        while True:
            free = max(1, _workers(client)) - len(waiting)
            for index, each in itertools.islice(numbered, max(0, free)):
                # One piece a worker: a piece that kills its worker then never takes another piece with it.
                key = f"{getattr(trial, '__name__', 'piece')}-{run}-{index}"
                waiting[client.submit(run_piece, trial, each, code_of(), key=key, pure=False)] = (index, each)
            if not waiting:
                return
            for future in _some_done(client, list(waiting)):
                index, each = waiting.pop(future)
                yield _outcome(client, future, index, each)
                future.release()
    finally:
        if waiting:
            client.cancel(list(waiting), force=True)


def _outcome(client: Client, future: Future, index: int, arguments: tuple[Any, ...]) -> Done[Any] | Failed:
    try:
        return Done(index, future.result())
    except KilledWorker as error:
        text = repr(arguments)
        shown = text if len(text) <= SHOWN else f"{text[: SHOWN - 3]}..."
        return Failed(
            index,
            BringupError(
                f"piece {index + 1}, {shown}: expected a worker that lives, but {error.allowed_failures + 1} died of "
                "it; it may need more memory than a worker has: give workers more, or run it alone"
            ),
        )
    except WrongWorkerError as error:
        raise BringupError(str(error)) from error
    except (CancelledError, CommClosedError, TimeoutError) as error:
        if future.cancelled() or client.status != "running":
            raise _gone(client) from error
        return Failed(index, error)
    except Exception as error:
        return Failed(index, error)


def _some_done(client: Client, futures: list[Future]) -> list[Future]:
    """Wait until some of the futures are done, and return these."""
    alive = time.monotonic()
    while True:
        try:
            with client.as_current():
                return list(wait(futures, timeout=LOOK, return_when="FIRST_COMPLETED").done)
        except TimeoutError:
            if _workers(client):
                alive = time.monotonic()
            elif time.monotonic() - alive > PATIENCE:
                raise BringupError(
                    f"{_address(client)}: expected a worker, got none for {PATIENCE:g} s; start some and run the "
                    "command again"
                ) from None
        except CancelledError as error:
            raise _gone(client) from error


def _workers(client: Client) -> int:
    """Return how many workers there are now."""
    try:
        return len(client.nthreads())
    except (OSError, CancelledError, RuntimeError, TypeError, ValueError) as error:
        raise _gone(client) from error


def _address(client: Client) -> str:
    return str(client.scheduler.address) if client.scheduler is not None else "the scheduler"


def _gone(client: Client) -> BringupError:
    return BringupError(
        f"{_address(client)}: expected the scheduler to go on, but it is gone; what is finished is kept: start it "
        "and run the command again"
    )
