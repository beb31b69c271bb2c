"""Where a wheel begins anew, as the path does not say: parted in two, or off the pin that it stood in for.

Such starts are climbed from in short simulations.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.fitted import Fitted, scene_of, tops
from pbrl_mismatch.search.hypothesis import BELIEVED, OF_THE_BODY, Hypothesis
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.path.pins import may_be_pinned, with_pins
from pbrl_mismatch.search.path.splits import with_splits

Array = NDArray[np.float64]

PARTED, PINNED, STEPS = 30, 10, 5
"""From so many partings of a wheel is climbed, and from so many places of one beside a pin, in so many steps."""
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
    draws = hypothesis.laid_on(base.hypothesis, base.peak.coordinates[0], hypothesis.sample_prior(rng, PARTED))
    draws = with_splits(rng, draws, columns, scene_of(shortest.track, base.row).size)
    return _climbed(hypothesis, draws, shortest, options)


def holds_as_pin(name: str, base: Fitted, track: Track) -> bool:
    """Tell whether a base's wheel may stand in for an effect: friction holds a body at a pin as the pin does."""
    return EFFECTS[name].pins is not None and "wheel_x" in base.hypothesis.columns and may_be_pinned(track)


def pinned_starts(
    rng: np.random.Generator, hypothesis: Hypothesis, base: Fitted, shortest: Cuts, options: DiagnoseOptions
) -> Array:
    """Return starts (n, K) with a pin where the body turned, and the wheel anywhere, best first.

    The wheel that was fitted is where the pin is: no climb leads it half a metre back to where it rolls.

    Args:
        rng: of the draws.
        hypothesis: the base with a pin as its last effect.
        base: fitted, with a wheel.
        shortest: windows that a simulation can follow from a wrong place.
        options: settings.
    """
    columns, pins = hypothesis.columns, EFFECTS[hypothesis.effects[-1]].pins
    draws = hypothesis.sample_felt(rng, PINNED)
    fitted = hypothesis.laid_on(base.hypothesis, base.peak.coordinates[0], draws)
    draws = np.where(np.isin(columns, [*OF_THE_BODY, *BELIEVED]), draws, fitted)
    if pins is not None:
        draws = with_pins(rng, draws, (columns.index(pins[0]), columns.index(pins[1])), shortest.track, share=1.0)
    return _climbed(hypothesis, draws, shortest, options)


def _climbed(hypothesis: Hypothesis, draws: Array, shortest: Cuts, options: DiagnoseOptions) -> Array:
    """Return where draws (n, K) lead in short simulations, the likeliest first."""
    objective = Objective(hypothesis, shortest, options.sensor_floor)
    return tops(climb(objective, hypothesis.believable(draws), iterations=STEPS, rough=True), KEPT)
