"""Before an alarm: whether the last windows would have been foretold by another model, or another draw of this one.

A test sees a posterior as a Gaussian around one place, at which it linearises. What the place does not show cannot be
found so: how much force a wheel bears that has never slipped is known from below alone, and where the mean holds and
the wheel slips, no slope says that less would do. So draws are asked themselves, those first that come nearest to what
was heard. A model has failed only if none of them foretells it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.online.evidence import Array, Noise
from pbrl_mismatch.online.options import MonitorOptions
from pbrl_mismatch.online.reading import Reading
from pbrl_mismatch.online.watch import ReadingTest
from pbrl_mismatch.online.windows import Grid
from pbrl_mismatch.search.objective import Objective

Looked = tuple[float, dict[Grid, Cuts]]
"""When a look was [s], and its windows."""
RANKED, ASKED = 200, 2
"""Draws of each reading that are simulated over what was heard, and of those the nearest, which are tested on it."""
WORTH = math.log(RANKED)
"""By which a draw must do better than an alarm asks for: it is one of so many [nat]."""


def run(tests: Iterable[ReadingTest], looked: Looked, *, counts: bool) -> None:
    """Let every reading take in what ends at a moment, and learn from what lies back."""
    end, cuts = looked
    for test in tests:
        for grid, window in cuts.items():
            test.take(grid, window, end, counts=counts)
        test.settle(end)


def replayed(
    readings: Sequence[Reading], looks: Sequence[Looked], noise: Noise, options: MonitorOptions
) -> list[ReadingTest]:
    """Return tests of readings after looks that were before; `noise` is what was known before them."""
    tests = [ReadingTest(each, options, noise) for each in readings]
    for looked in looks:
        run(tests, looked, counts=True)
    return tests


def as_adjusted(test: ReadingTest) -> Reading:
    """Return a reading as its test has adjusted it."""
    return replace(test.reading, mean=test.coordinates, covariance=test.covariance)


def nearest_draws(reading: Reading, heard: Sequence[Cuts], options: MonitorOptions) -> list[Reading]:
    """Return a reading around each of the draws that come nearest to what was heard.

    Args:
        reading: with its draws.
        heard: windows, the last ones and others long before: a draw that bends to the last ones alone is none.
        options: of the watch.
    """
    rows = np.unique(np.linspace(0, len(reading.draws) - 1, RANKED).astype(int))
    draws = reading.draws[rows]
    off = np.zeros(len(draws))
    for window in heard:
        off += _misfit(Objective(reading.hypothesis, window, options.sensor_floor), draws)
    return [replace(reading, mean=draws[k]) for k in np.argsort(off, kind="stable")[:ASKED]]


def _misfit(objective: Objective, draws: Array) -> Array:
    rest = objective.at_rest(len(draws))
    return objective.misfit(objective.residual(draws, rest), rest).sum(axis=1)
