"""A process thinks: it answers, dies, is ended with its job, and does not outlive whoever asked."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import fake_thoughts
import pytest

from pbrl_namo.executive import Lost, ProcessThinker

WAIT = 60.0
"""An answer takes at most so long [s], on a machine that has other work too."""


Polled = Callable[[ProcessThinker], Any]


@pytest.fixture
def thinker() -> Iterator[ProcessThinker]:
    thinker = ProcessThinker(fake_thoughts.make)
    yield thinker
    thinker.close()


def test_nobody_waits_while_it_thinks_and_an_answer_is_given_once(thinker: ProcessThinker, polled: Polled) -> None:
    assert thinker.poll() is None
    thinker.begin("who")
    assert thinker.poll() is None, "it cannot have begun yet"
    assert polled(thinker) != os.getpid()
    assert thinker.poll() is None


def test_a_job_may_be_larger_than_a_pipe(thinker: ProcessThinker, polled: Polled) -> None:
    thinker.begin("x" * 10_000_000)
    assert polled(thinker) == 10_000_000


def test_one_process_answers_one_job_after_the_other(thinker: ProcessThinker, polled: Polled) -> None:
    thinker.begin("who")
    first = polled(thinker)
    thinker.begin("who")
    assert polled(thinker) == first


def test_a_process_that_dies_is_a_loss_and_the_next_one_lives(thinker: ProcessThinker, polled: Polled) -> None:
    thinker.begin("die")
    answer = polled(thinker)
    assert isinstance(answer, Lost)
    assert answer.reason.endswith("exit code 3")
    thinker.begin("word")
    assert polled(thinker) == 4


def test_what_cannot_be_sent_is_a_loss(thinker: ProcessThinker, polled: Polled) -> None:
    thinker.begin(lambda: None)
    answer = polled(thinker)
    assert isinstance(answer, Lost)
    assert "lambda" in answer.reason
    thinker.begin("word")
    assert polled(thinker) == 4


def test_a_job_that_is_dropped_ends_and_the_next_one_does_not_wait_for_it(
    thinker: ProcessThinker, polled: Polled
) -> None:
    thinker.begin("who")
    ended = os.pidfd_open(polled(thinker))
    assert thinker._worker is not None and thinker._worker._done_ahead.poll(WAIT)
    thinker.begin("sleep")
    begun(thinker)
    thinker.begin("word")
    assert gone(ended)
    assert polled(thinker) == 4


def test_while_it_compiles_a_job_that_is_dropped_is_done_and_its_answer_thrown_away(polled: Polled) -> None:
    thinker = ProcessThinker(fake_thoughts.make, fake_thoughts.forever)
    try:
        thinker.begin("who")
        before = polled(thinker)
        thinker.begin("nap")
        begun(thinker)
        thinker.begin("sleep")
        thinker.drop()  # it has not been sent yet, and never is
        thinker.begin("who")
        assert polled(thinker) == before
        assert thinker.poll() is None
    finally:
        thinker.close()


def test_one_that_is_stuck_in_a_dropped_job_is_ended_with_the_next(polled: Polled) -> None:
    thinker = ProcessThinker(fake_thoughts.make, fake_thoughts.shortly)
    try:
        thinker.begin("sleep")
        begun(thinker)
        thinker.drop()  # it still compiles
        assert thinker._worker is not None and thinker._worker._done_ahead.poll(WAIT)
        thinker.begin("word")  # waits for the one before
        thinker.begin("word")
        assert polled(thinker) == 4
    finally:
        thinker.close()


def begun(thinker: ProcessThinker) -> None:
    """Wait until a job is on its way: one that is not is called off, and nothing else happens."""
    until = time.monotonic() + WAIT
    while thinker._future is not None and not thinker._future.running():
        assert time.monotonic() < until
        time.sleep(0.001)


def test_it_is_not_left_behind_by_one_who_is_killed() -> None:
    with subprocess.Popen(
        [sys.executable, str(Path(fake_thoughts.__file__))], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as asks:
        assert asks.stdout is not None
        thinking = os.pidfd_open(int(asks.stdout.readline()))
        assert not select.select([thinking], [], [], 0.0)[0]
        asks.kill()
    assert gone(thinking)


def gone(process: int) -> bool:
    """Wait until a process has ended, by its file descriptor."""
    try:
        return bool(select.select([process], [], [], WAIT)[0])
    finally:
        os.close(process)
