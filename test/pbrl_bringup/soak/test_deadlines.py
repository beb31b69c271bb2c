"""Ticks that came in time, unevenly, or too late; numbers that have grown, and those that only rose at first."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_bringup.benches.soak import GROWTH, trend_of
from pbrl_bringup.soak.deadlines import ticks_of

PERIOD, DEADLINE = 0.01, 0.1


def rows_of(simulated: np.ndarray) -> np.ndarray:
    """Return ticks whose wall clock [min] goes as the simulated one [s]."""
    return np.column_stack((np.arange(len(simulated)) * PERIOD / 60.0, simulated))


def test_even_ticks_are_all_in_time() -> None:
    ticks = ticks_of(rows_of(np.arange(1000) * PERIOD), PERIOD, DEADLINE, 0.0)
    assert (ticks.count, ticks.missed, ticks.uneven) == (999, 0.0, 0.0)
    assert ticks.longest == pytest.approx(PERIOD)


def test_a_late_tick_counts_once_a_pause_and_a_clock_set_back_do_not() -> None:
    times = np.arange(1000) * PERIOD
    times[300:] += 0.03  # uneven
    times[500:] += 0.15  # after the deadline
    times[700:] += 5.0  # nothing was commanded
    times[900:] -= times[900]  # another room
    ticks = ticks_of(rows_of(times), PERIOD, DEADLINE, 0.0)
    assert ticks.missed * ticks.count == pytest.approx(1.0)
    assert ticks.uneven * ticks.count == pytest.approx(2.0)
    assert ticks.longest == pytest.approx(0.16)


def test_nothing_commanded_misses_nothing() -> None:
    assert ticks_of(np.zeros((0, 2)), PERIOD, DEADLINE, 0.0).count == 0
    assert ticks_of(np.zeros((1, 2)), PERIOD, DEADLINE, 0.0).missed == 0.0


def test_what_rises_while_it_warms_up_has_not_grown_and_what_goes_on_rising_has() -> None:
    time = np.arange(0.0, 3600.0, 5.0)
    warm = np.minimum(100.0 + 0.1 * time, 200.0)
    assert trend_of(list(zip(time, warm, strict=True))).growth == 0.0
    assert trend_of(list(zip(time, 100.0 + 0.01 * time, strict=True))).growth > GROWTH
