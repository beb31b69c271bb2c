"""Has the executive's jobs answered by a process of its own: who plans or learns there holds up nobody here."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Future
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from typing import Any

from pbrl_namo.executive.jobs import Lost
from pbrl_namo.executive.thinker import one_line

Make = Callable[[], Callable[[Any], Any]]
"""Called once in the process; returns what answers there. A function of a module, so that the process can find it."""


def nothing() -> None:
    """Do nothing ahead."""


class ProcessThinker:
    """Has the work done by a process of its own; one that has died is made anew, one whose job is dropped is ended.

    Not ended is one that still compiles: that would be lost, and a job that waits for a compiler for longer than
    somebody's patience would never be done. Its answer is thrown away, and the next job waits for it.

    A thread instead would share one interpreter with whoever ticks and listens, and each would take the other's time;
    nor can it be ended, so that the next job would wait for one that nobody wants.

    Args:
        make: see `Make`.
        ahead: done there besides, from then on: what a later job will need.
    """

    def __init__(self, make: Make, ahead: Callable[[], None] = nothing) -> None:
        self._make, self._ahead = make, ahead
        self._worker: _Worker | None = None
        self._future: Future[Any] | None = None

    def start(self) -> None:
        """Make the process, which then is ready when the first job comes."""
        if self._worker is None or not self._worker.lives:
            self._worker = _Worker(self._make, self._ahead)

    def begin(self, job: Any) -> None:
        """See `Thinker.begin`; a job is whatever can be pickled and is understood there."""
        self.drop()
        self.start()
        assert self._worker is not None
        self._future = self._worker.ask(job)

    def poll(self) -> Any | None:
        """See `Thinker.poll`."""
        future = self._future
        if future is None or not future.done():
            return None
        self._future = None
        return future.result()

    def drop(self) -> None:
        """See `Thinker.drop`."""
        future, self._future = self._future, None
        if future is None or future.done():
            return
        future.cancel()  # it may still wait for one that was dropped before, and would never be sent
        if self._worker is not None and self._worker.ready:
            self.close()

    def close(self) -> None:
        """End the process, whatever it is at."""
        if self._worker is not None:
            self._worker.end()
        self._worker = self._future = None


class _Worker:
    """One process, and the thread that waits for it: what is sent may be more than a pipe takes at once."""

    def __init__(self, make: Make, ahead: Callable[[], None]) -> None:
        context = get_context("spawn")
        self._ours, theirs = context.Pipe()
        # Not an event: its semaphores have names, which outlive a parent that is killed.
        self._done_ahead, done = context.Pipe(duplex=False)
        self._turn = threading.Lock()
        told = (make, ahead, theirs, done)
        self._process = context.Process(target=_work, args=told, name="thinking", daemon=True)
        self._process.start()
        theirs.close()  # so that a read ends where the process does
        done.close()

    @property
    def lives(self) -> bool:
        return self._process.is_alive()

    @property
    def ready(self) -> bool:
        """Whether all is done that was to be done ahead."""
        return self._done_ahead.poll()

    def ask(self, job: Any) -> Future[Any]:
        """Have something answered; the future fails never: it is `Lost` where the process dies."""
        future: Future[Any] = Future()
        threading.Thread(target=self._ask, args=(job, future), name="asking", daemon=True).start()
        return future

    def end(self) -> None:
        self._process.kill()
        self._process.join()
        self._done_ahead.close()

    def _ask(self, job: Any, future: Future[Any]) -> None:
        with self._turn:
            if future.set_running_or_notify_cancel():
                future.set_result(self._answer(job))

    def _answer(self, job: Any) -> Any:
        try:
            self._ours.send(job)
            return self._ours.recv()
        except (EOFError, OSError):
            self._process.join()
            return Lost(f"the process that thinks ended with exit code {self._process.exitcode}")
        except Exception as error:  # something that cannot be pickled
            return Lost(one_line(error))


def _work(make: Make, ahead: Callable[[], None], pipe: Connection, done: Connection) -> None:
    """Answer what comes through a pipe until it is closed, or the parent ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C, which the terminal sends to all, is the parent's
    threading.Thread(target=_end_with_parent, daemon=True).start()
    answer = make()
    threading.Thread(target=_do_ahead, args=(ahead, done), daemon=True).start()
    while True:
        try:
            job = pipe.recv()
        except EOFError:
            return
        pipe.send(answer(job))


def _do_ahead(ahead: Callable[[], None], done: Connection) -> None:
    """Do what is to be done ahead, and say so by the pipe's end."""
    with done:
        ahead()


def _end_with_parent() -> None:
    """End this process, whatever it is at, as soon as its parent has ended: a killed one closes nothing."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
