"""The rival that refits the baseline and no more: where its residual stays too large, something is wrong."""

from __future__ import annotations

import time

import numpy as np
from scipy.stats import chi2

from pbrl_bringup.rivals.claim import Claim, Given, heldout_error
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.search.heldout import settle
from pbrl_mismatch.search.objective import Objective

WINDOW = 2.0
"""Over which residuals are added up [s]; the unknown start of a shorter one hides what is wrong."""
LEVEL = 0.01
"""Share of the windows of a right model that are claimed wrong."""


def refit(given: Given) -> Claim:
    """Claim the windows in which the refitted baseline misses the poses by more than their noise (chi-square)."""
    started = time.process_time()
    cuts = cut_windows(given.track, WINDOW)
    objective = Objective(given.hypothesis, cuts, given.floor)
    z = settle(objective, given.coordinates)
    misfit = np.sum(objective.residual(given.coordinates, z)[0] ** 2, axis=1) + np.sum(z[0] ** 2, axis=1)
    seen = np.count_nonzero(cuts.weight.reshape(len(cuts), -1), axis=1)
    wrong = misfit > chi2.isf(LEVEL, np.maximum(seen, 1))
    chosen = given.samples.inside([])
    for start, steps in zip(cuts.start[wrong], cuts.span[wrong, 1], strict=True):
        chosen |= (given.samples.time >= start) & (given.samples.time < start + steps * given.track.dt)
    heldout = heldout_error(given, lambda state: np.zeros((len(state), 3)))
    spent = time.process_time() - started
    return Claim("refit", given.samples.intervals(chosen), {}, heldout, spent)
