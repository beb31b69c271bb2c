"""How casters were turned when a recording began, sought one after the other along the path.

Which way a caster comes about depends on where it began: its turn has several tops, and a climb ends in the next one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.effects.caster_swivel import HEADINGS
from pbrl_mismatch.search.hypothesis import Hypothesis
from pbrl_mismatch.search.path.along import Along
from pbrl_mismatch.search.path.climb import likelihood

Array = NDArray[np.float64]

ANGLES, SWEEPS = 12, 2
"""So many turns of each caster are compared, and each so many times."""


def turned(along: Along, hypothesis: Hypothesis, starts: Array) -> Array:
    """Return starts (n, K) with every caster turned as makes the path likeliest, the others as they are.

    Args:
        along: windows along a path.
        hypothesis: what is free; without casters nothing changes.
        starts: (n, K).
    """
    found = hypothesis.believable(starts)
    columns = [hypothesis.columns.index(column) for column in HEADINGS if column in hypothesis.columns]
    ways = np.arange(ANGLES) * (2.0 * np.pi / ANGLES)
    for k in columns * SWEEPS:
        trial = found[:, None].repeat(ANGLES, axis=1)
        trial[:, :, k] += ways
        if k == columns[0]:
            trial[:, :, columns[1:]] -= ways[:, None]  # the others are told from the first, and stay where they are
        trial[:, :, columns] = np.remainder(trial[:, :, columns] + np.pi, 2.0 * np.pi) - np.pi
        flat = trial.reshape(-1, trial.shape[-1])
        misfit = np.sum(along.residual(hypothesis.rows(flat)) ** 2, axis=2)
        prior = np.sum(((flat - hypothesis.mean) / hypothesis.spread) ** 2, axis=1)
        density = (likelihood(along, misfit) - 0.5 * prior).reshape(len(found), ANGLES)
        found = trial[np.arange(len(found)), np.argmax(density, axis=1)]
    return found
