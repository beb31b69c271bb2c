"""Basin hopping (Wales and Doye 1997): climbs from beside where one ended, for as long as that gains.

Where feet stick and let go, the posterior is rough: a climb stops in the next hollow, a hundred nats below what lies a
centimetre away, and which hollow that is depends on where it began. Hops lead out of it; from where they end up hardly
depends on the start.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.fitted import Fitted, alone
from pbrl_mismatch.search.objective import Objective

REACHED = 1.12
"""A hypothesis that needs less than this scale of the noise predicts windows of its length."""
HOPS, ROUNDS, STEPS = 8, 6, 6
"""Climbs from beside the best in a round, rounds at most, and steps of a climb."""
FAR, NEAR = 0.1, 0.01
"""Of the farthest and of the nearest hop, in standard deviations of the prior."""
WORTH = 1.0
"""A round that gains less is the last [nat]."""


def hopped(fitted: Fitted, cuts: Cuts, options: DiagnoseOptions) -> Fitted:
    """Return a hypothesis at the best that hops from its peak find; what predicts its windows is returned as it is.

    Args:
        fitted: where climbs have ended.
        cuts: windows of its peak.
        options: settings; the seed is of the hops, the same for every hypothesis.
    """
    if fitted.noise_scale <= REACHED:
        return fitted
    objective, rng = Objective(fitted.hypothesis, cuts, options.sensor_floor), np.random.default_rng(options.seed)
    best, spread = fitted.peak, fitted.hypothesis.spread
    reach = np.geomspace(FAR, NEAR, HOPS)[:, None] * spread
    for _ in range(ROUNDS):
        beside = best.coordinates + reach * rng.standard_normal((HOPS, len(spread)))
        # Half of them begin where nothing was moved: what a window began with may be all that holds it in the hollow.
        begun = np.where(np.arange(HOPS)[:, None, None] % 2, best.nuisance, 0.0)
        starts = np.concatenate([best.coordinates, beside]), np.concatenate([best.nuisance, begun])
        peak = climb(objective, *starts, iterations=STEPS, rough=True)
        gained = float(np.nan_to_num(peak.evidence, nan=-np.inf).max() - best.evidence[0])
        best = peak.take(np.array([peak.best])) if gained > 0.0 else best
        if gained < WORTH:
            break
    best = climb(objective, best.coordinates, best.nuisance, iterations=STEPS)
    return replace(fitted, peak=alone(best)) if best.evidence[0] > fitted.peak.evidence[0] else fitted
