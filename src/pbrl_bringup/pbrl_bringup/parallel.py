"""Independent trials in processes of their own, each on one core; the same results whatever the number of cores.

By default the processes are a pool on this machine; inside of `sent_to` they are whatever that names.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import closing, contextmanager
from contextvars import ContextVar
from multiprocessing import active_children, get_context, parent_process
from types import FrameType
from typing import Any, TypeVar

from pbrl_bringup.processes import die_with_parent
from pbrl_bringup.terminal import progress

Result = TypeVar("Result")

UNWINDING = 2.0
"""So long [s] a process has for what it began, once it is told to end."""
THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")

Elsewhere = Callable[[Callable[..., Any], Iterable[tuple[Any, ...]]], Generator[tuple[int, Any]]]
"""Runs a trial for each tuple of arguments somewhere: yields (number, result) as they end, raises what one raised."""
_ELSEWHERE: ContextVar[Elsewhere | None] = ContextVar("elsewhere", default=None)


@contextmanager
def sent_to(elsewhere: Elsewhere) -> Iterator[None]:
    """Have `in_parallel` run its trials elsewhere than in a pool of this machine, inside the block."""
    token = _ELSEWHERE.set(elsewhere)
    try:
        yield
    finally:
        _ELSEWHERE.reset(token)


def in_parallel(trial: Callable[..., Result], arguments: Sequence[tuple[Any, ...]], what: str) -> list[Result]:
    """Run a trial for each tuple of arguments, here or where `sent_to` says, and return the results in their order.

    Args:
        trial: a function of a module, so that another process can find it.
        arguments: of each trial.
        what: plural of a trial, for the progress bar.

    Raises:
        Exception: whatever the first failing trial raised; the others are given up.
    """
    elsewhere = _ELSEWHERE.get()
    results: dict[int, Result] = {}
    if elsewhere is not None:
        with progress(what, len(arguments)) as bar, closing(elsewhere(trial, arguments)) as ended:
            for index, result in ended:
                results[index] = result
                bar(len(results))
        return [results[index] for index in range(len(arguments))]
    with (
        _one_thread_each(),
        ProcessPoolExecutor(
            len(os.sched_getaffinity(0)), mp_context=get_context("spawn"), initializer=_obey_the_parent
        ) as pool,
        progress(what, len(arguments)) as bar,
    ):
        try:
            jobs = {pool.submit(trial, *each): index for index, each in enumerate(arguments)}
            for job in as_completed(jobs):
                results[jobs[job]] = job.result()
                bar(len(results))
        except BaseException:  # Ctrl-C among them: nobody waits for what is half done
            pool.shutdown(wait=False, cancel_futures=True)
            for child in active_children():
                child.terminate()
            raise
    return [results[index] for index in range(len(arguments))]


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Have processes that are spawned inside the block use one thread each: they are the parallelism."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _obey_the_parent() -> None:
    """Leave Ctrl-C, which the terminal sends to all, to the parent; let its SIGTERM unwind the stack."""
    die_with_parent()
    parent = parent_process()
    if parent is not None and not parent.is_alive():  # it died before the tie was made
        os._exit(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _end)


def _end(number: int, frame: FrameType | None) -> None:
    """Unwind the stack; a pool takes that for the failure of one job and would go on to the next, so end soon after."""
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, UNWINDING)
    sys.exit(128 + number)
