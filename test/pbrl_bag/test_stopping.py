"""Signals in long work: they end it at once, in the main thread, and leave the handlers as they were."""

from __future__ import annotations

import os
import signal
import threading

import pytest

from pbrl_bag.ros.stopping import SIGNALS, ended_by_signals


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_ends_long_work(number: signal.Signals) -> None:
    before = [signal.getsignal(each) for each in SIGNALS]
    with pytest.raises(KeyboardInterrupt), ended_by_signals():
        os.kill(os.getpid(), number)
        pytest.fail("went on")
    assert [signal.getsignal(each) for each in SIGNALS] == before


def test_handlers_come_back_after_an_error() -> None:
    before = [signal.getsignal(each) for each in SIGNALS]
    with pytest.raises(ZeroDivisionError), ended_by_signals():
        raise ZeroDivisionError
    assert [signal.getsignal(each) for each in SIGNALS] == before


def test_another_thread_runs_to_its_end_and_touches_no_handler() -> None:
    before = [signal.getsignal(each) for each in SIGNALS]
    seen = []

    def work() -> None:
        with ended_by_signals():
            seen.extend(signal.getsignal(each) for each in SIGNALS)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == before
