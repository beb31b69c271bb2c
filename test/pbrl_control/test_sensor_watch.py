"""Streams that are lost or frozen are told; a stream that is still as nothing moves is not."""

from __future__ import annotations

import numpy as np

from pbrl_control.sensor_watch import SensorWatch
from pbrl_control.settings import WatchSettings

SETTINGS = WatchSettings(lost=0.5, frozen=0.3)
DT = 0.01


def fed(values: np.ndarray, moving: bool, until: float = 0.0) -> str:
    """Return the complaint after samples 10 ms apart, `until` seconds after the last."""
    watch = SensorWatch(SETTINGS)
    for k, value in enumerate(values):
        watch.feed("wrench", DT * k, value, moving=moving)
    return watch.complaint(DT * (len(values) - 1) + until, ["wrench"])


def test_a_stream_with_news_is_trusted(rng: np.random.Generator) -> None:
    assert fed(rng.normal(size=(200, 6)), True) == ""


def test_the_same_again_and_again_while_moving_is_frozen() -> None:
    assert "frozen" in fed(np.ones((50, 6)), True)
    assert fed(np.ones((25, 6)), True) == ""


def test_the_same_again_and_again_at_rest_is_not() -> None:
    assert fed(np.ones((500, 6)), False) == ""


def test_a_change_thaws() -> None:
    values = np.ones((60, 6))
    values[50:] = 2.0
    assert fed(values, True) == ""


def test_nothing_for_long_is_lost(rng: np.random.Generator) -> None:
    values = rng.normal(size=(20, 6))
    assert fed(values, True, 0.49) == ""
    assert "none for 0.6 s" in fed(values, True, 0.6)


def test_only_what_is_needed_is_asked_for() -> None:
    watch = SensorWatch(SETTINGS)
    assert watch.complaint(5.0, []) == ""
    assert watch.complaint(5.0, ["tag 'table'"]) == "tag 'table': expected a sample, none has come yet"


def test_a_sample_that_is_no_number_is_no_change() -> None:
    assert fed(np.full((100, 6), np.nan), True) == "", "NaN is told by the controller itself"


def cut(period: float, silence: float) -> str:
    """Return what is said of a link whose samples came in a period [s], after some silence [s]."""
    watch = SensorWatch(WatchSettings(link=0.14))
    for k in range(20):
        watch.feed("tags", period * k, np.array([float(k)]), moving=False)
    return watch.cut(19 * period + silence, ["tags"])


def test_a_link_that_is_silent_is_cut_soon_and_a_slow_one_after_two_of_its_periods() -> None:
    assert cut(1 / 15, 0.13) == ""
    assert "tags: expected samples, none for 0.16 s" in cut(1 / 15, 0.16)
    assert cut(0.5, 1.0) == ""
    assert "none for 1.20 s" in cut(0.5, 1.2)


def test_a_link_that_never_was_cannot_be_cut() -> None:
    assert SensorWatch(WatchSettings()).cut(100.0, ["tags"]) == ""
