"""Where two wheels begin in place of one: climbed from in short simulations, since the path says nothing of them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.fitted import Fitted, scene_of, tops
from pbrl_mismatch.search.hypothesis import Hypothesis
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.path.splits import with_splits

Array = NDArray[np.float64]

STARTS, STEPS = 10, 5
"""So many ways of parting the wheel are climbed from, in so many steps."""
KEPT = 3
"""So many of them go on."""
BY_CHANCE = 2.5
"""A base whose scale of the noise is above one by less than so many of its standard deviations may explain all."""


def is_another(name: str, base: Fitted) -> bool:
    """Tell whether an effect is one more of what a base has already."""
    return EFFECTS[name].second and "wheel_x" in base.hypothesis.columns


def parted_starts(
    rng: np.random.Generator, hypothesis: Hypothesis, base: Fitted, shortest: Cuts, options: DiagnoseOptions
) -> Array:
    """Return starts (n, K) for two wheels in place of one, best first; none where the one explains all.

    The one that was fitted has taken on what both do, and where wheels hold a body its path tells little of either.

    Args:
        rng: how the wheel is parted.
        hypothesis: the base with another wheel.
        base: fitted, with one wheel.
        shortest: windows that a simulation can follow from a wrong place.
        options: settings.
    """
    columns = hypothesis.columns
    if base.noise_scale < 1.0 + BY_CHANCE / math.sqrt(2.0 * base.peak.objective.observations):
        return np.empty((0, len(columns)))
    draws = hypothesis.laid_on(base.hypothesis, base.peak.coordinates[0], hypothesis.sample_prior(rng, STARTS))
    scene = scene_of(shortest.track, base.row)
    draws = hypothesis.believable(with_splits(rng, draws, columns, scene.size))
    peak = climb(Objective(hypothesis, shortest, options.sensor_floor), draws, iterations=STEPS, rough=True)
    return tops(peak, KEPT)
