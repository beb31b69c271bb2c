"""Basin hopping (Wales and Doye 1997): climbs from beside where one ended, for as long as that gains.

Where feet stick and let go, the posterior is rough: a climb stops in the next hollow, a hundred nats below what lies a
centimetre away, and which hollow that is depends on where it began. Hops lead out of it; where they end hardly depends
on the start.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import Peak, climb
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
HOPE = 3.0
"""One that is behind the best by more than so many times what its last round gained hops no more: rounds gain less and
less."""


def hopped(tried: Sequence[Fitted], cuts: Cuts, options: DiagnoseOptions, ahead: float = -math.inf) -> list[Fitted]:
    """Return hypotheses where hops from their peaks end; what predicts its windows is returned as it is.

    Args:
        tried: where climbs have ended.
        cuts: windows of their peaks.
        options: settings; the seed is of the hops, the same for every hypothesis.
        ahead: evidence of what they are compared with besides one another [nat].
    """
    found = list(tried)
    going = [k for k, each in enumerate(tried) if each.noise_scale > REACHED]
    with ThreadPoolExecutor(options.workers) as pool:
        for turn in range(ROUNDS):
            hop = partial(_hop, cuts=cuts, options=options, turn=turn)
            peaks = dict(zip(going, pool.map(hop, [found[k] for k in going]), strict=True))
            gains = {k: float(peak.evidence[0] - found[k].peak.evidence[0]) for k, peak in peaks.items()}
            for k in (k for k, gain in gains.items() if gain > 0.0):
                found[k] = replace(found[k], peak=peaks[k])
            best = max([ahead, *(each.evidence for each in found)])
            going = [k for k, gain in gains.items() if gain >= WORTH and best - found[k].evidence <= HOPE * gain]
        moved = [k for k, each in enumerate(tried) if found[k] is not each]
        ends = pool.map(partial(_ended, cuts=cuts, options=options), [found[k] for k in moved])
        for k, peak in zip(moved, ends, strict=True):
            found[k] = replace(tried[k], peak=peak) if peak.evidence[0] > tried[k].peak.evidence[0] else tried[k]
    return found


def _hop(fitted: Fitted, cuts: Cuts, options: DiagnoseOptions, turn: int) -> Peak:
    """Return the best of a round of climbs from beside a peak and from the peak itself, which is never lost."""
    objective = Objective(fitted.hypothesis, cuts, options.sensor_floor)
    rng = np.random.default_rng([options.seed, turn])
    best, spread = fitted.peak, fitted.hypothesis.spread
    reach = np.geomspace(FAR, NEAR, HOPS)[:, None] * spread
    beside = best.coordinates + reach * rng.standard_normal((HOPS, len(spread)))
    # Half of them begin where nothing was moved: what a window began with may be all that holds it in the hollow.
    begun = np.where(np.arange(HOPS)[:, None, None] % 2, best.nuisance, 0.0)
    starts = np.concatenate([best.coordinates, beside]), np.concatenate([best.nuisance, begun])
    peak = climb(objective, *starts, iterations=STEPS, rough=True)
    found = alone(peak)
    return found if found.evidence[0] > best.evidence[0] else best


def _ended(fitted: Fitted, cuts: Cuts, options: DiagnoseOptions) -> Peak:
    """Return a peak climbed on with slopes taken anew: evidence that others are compared with."""
    objective = Objective(fitted.hypothesis, cuts, options.sensor_floor)
    return alone(climb(objective, fitted.peak.coordinates, fitted.peak.nuisance, iterations=STEPS))
