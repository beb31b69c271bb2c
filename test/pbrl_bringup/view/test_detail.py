"""Levels of detail lose no extreme, and what is thinned are samples of the stream."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pbrl_bringup.view.detail import band, gap_of, inside, thinned


@st.composite
def streams(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, float, float, int]:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count = draw(st.integers(1, 400))
    steps = rng.choice([0.01, 0.01, 0.01, 5.0, 1e-4], count)
    time = np.cumsum(steps)
    start, end = np.sort(rng.uniform(-1.0, time[-1] + 1.0, 2))
    return time, rng.normal(size=(count, 3)), float(start), float(end), draw(st.integers(2, 60))


@given(streams())
def test_a_band_reaches_from_the_least_to_the_greatest(drawn: tuple) -> None:
    time, values, start, end, most = drawn
    found, there = band(time, values, start, end, most), inside(time, start, end)
    assert len(found.time) <= 2 * most and np.all(np.diff(found.time) > 0.0) and np.all(found.low <= found.high)
    if there.start == there.stop:
        assert len(found.time) == 0
        return
    assert np.array_equal(found.low.min(axis=0), values[there].min(axis=0))
    assert np.array_equal(found.high.max(axis=0), values[there].max(axis=0))
    if found.high is found.low:
        assert np.array_equal(found.low, values[there])


@given(streams())
def test_every_sample_lies_in_the_band_of_its_cell(drawn: tuple) -> None:
    time, values, start, end, most = drawn
    found, there = band(time, values, start, end, most), inside(time, start, end)
    if found.high is found.low:
        return
    width = (time[there][-1] - time[there][0]) / most
    for t, row in zip(time[there], values[there], strict=True):
        near = np.abs(found.time - t) <= 0.5 * width * (1 + 1e-9)
        assert near.any()
        assert np.all(row >= found.low[near].min(axis=0)) and np.all(row <= found.high[near].max(axis=0))


@given(streams())
def test_thinned_are_samples_with_first_and_last(drawn: tuple) -> None:
    time, _, start, end, most = drawn
    rows, there = thinned(time, start, end, most), inside(time, start, end)
    assert len(rows) <= most and np.all(np.diff(rows) > 0)
    if there.stop > there.start:
        assert rows[0] == there.start and rows[-1] == there.stop - 1
    within = np.flatnonzero((time >= start) & (time <= end))
    assert set(within) <= set(range(there.start, there.stop)), "one more on each side, none fewer"


@pytest.mark.parametrize(("step", "gap"), [(0.01, 0.5), (1 / 15, 8 / 15), (2.0, 16.0)])
def test_a_gap_is_longer_than_what_is_usual(step: float, gap: float) -> None:
    assert gap_of(np.arange(100) * step) == pytest.approx(gap)
    assert gap_of(np.array([3.0])) == 0.5
