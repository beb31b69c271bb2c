"""Where what holds or stops a body begins: draws held against short simulations, since the path says little of them.

A friction that is a twentieth too strong stops a simulated body a centimetre early. Along a path on which feet creep it
would have to be overcome all the way, which is decimetres: the right law looks wrong by far, and wrong ones no worse.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import climb, settled
from pbrl_mismatch.search.fitted import Fitted, tops
from pbrl_mismatch.search.hypothesis import Hypothesis
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.path.ground import Ground
from pbrl_mismatch.search.path.starts import drawn

Array = NDArray[np.float64]

LOOKED_INTO, CLIMBED, STEPS = 12, 4, 4
"""So many draws, the likeliest after one step of the nuisances, are settled; so many of those are climbed from, in so
many steps."""
KEPT = 2
"""So many of them go on."""


def holds(name: str) -> bool:
    """Tell whether an effect holds a body by dry friction, or stops it by a contact."""
    return EFFECTS[name].sticks or EFFECTS[name].touches is not None


def held_starts(
    rng: np.random.Generator,
    hypothesis: Hypothesis,
    variant: int,
    base: Fitted,
    ground: Ground,
    shortest: Cuts,
    options: DiagnoseOptions,
) -> Array:
    """Return starts (n, K) of an effect that holds or stops a body, likeliest first.

    They begin with what was believed of the body: what holds it was taken for its weight.

    Args:
        rng: of the draws.
        hypothesis: the base with the effect as its last.
        variant: which of its sub-models.
        base: what it is laid on.
        ground: the same along its path.
        shortest: windows that a simulation can follow from a wrong place.
        options: settings.
    """
    draws, afresh = drawn(rng, hypothesis, EFFECTS[hypothesis.effects[-1]], variant, base, ground, options)
    draws = hypothesis.believable(draws[afresh])
    objective = Objective(hypothesis, shortest, options.sensor_floor)
    # How the start and a steady wrench move the poses hardly depends on what acts besides.
    believed = base.hypothesis.as_believed(base.peak.coordinates[0])[None]
    slopes = Objective(base.hypothesis, shortest, options.sensor_floor).linearise(believed, objective.at_rest(1)).spread
    nuisance, residual, misfit = settled(objective, draws, objective.at_rest(len(draws)), slopes, rounds=1)
    some = _likeliest(objective, draws, misfit, LOOKED_INTO)
    nuisance, _, misfit = settled(objective, draws[some], nuisance[some], slopes, residual[some])
    best = _likeliest(objective, draws[some], misfit, CLIMBED)
    peak = climb(objective, draws[some][best], nuisance[best], iterations=STEPS, rough=True)
    return tops(peak, KEPT)


def _likeliest(objective: Objective, draws: Array, misfit: Array, count: int) -> NDArray[np.int64]:
    """Return the rows of so many draws (n, K) with misfits (n, W), likeliest first."""
    density = objective.likelihood(misfit) - 0.5 * objective.prior_misfit(draws)
    return np.argsort(-density, kind="stable")[:count]
