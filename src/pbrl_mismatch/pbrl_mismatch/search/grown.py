"""Hypotheses climbed over windows that grow, fewer of them each time."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import Executor
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import Peak, climb
from pbrl_mismatch.search.fitted import Fitted, Stages, alone, tops
from pbrl_mismatch.search.grip import GripEvidence
from pbrl_mismatch.search.hypothesis import Hypothesis
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.path.climb import PathPeak

Array = NDArray[np.float64]

AS_GOOD = 40.0
"""Variants of an effect that are worse than its best by more [nat] are given up."""
CLOSE = 10.0
"""Effects this near to the likeliest [nat] all go on to longer windows."""


def grown(
    pool: Executor,
    running: Sequence[tuple[Hypothesis, Array]],
    stages: Stages,
    leading: Collection[str],
    kept: Mapping[str, int],
    grip: GripEvidence | None,
    options: DiagnoseOptions,
) -> list[Fitted]:
    """Climb hypotheses over windows of each length, the likeliest of them over the next; return those at the end.

    Args:
        pool: that climbs several at once.
        running: hypotheses with starts (n, K).
        stages: windows.
        leading: variants that go on to the end: what the path says of long windows, short ones cannot take back.
        kept: from how many points a variant goes on, where not as the options have it.
        grip: what the grippers' poses say; None where none was seen.
        options: settings.
    """
    before: list[Peak | None] = [None] * len(running)
    for stage, cuts in enumerate(stages.fitted):
        rough = stage + 2 < len(stages.fitted)
        peaks = list(pool.map(partial(_climbed, cuts, options.iterations[stage], options, rough), running))
        if stage + 1 == len(stages.fitted):
            break
        simulated = [likeliest(each, peak, grip) for (each, _), peak in zip(running, peaks, strict=True)]
        chosen = survivors([each for each, _ in running], simulated, options.survivors[stage], CLOSE)
        chosen = sorted({*chosen, *(k for k, (each, _) in enumerate(running) if each.variant in leading)})
        before = [peaks[k] for k in chosen]
        running = [
            (each, tops(peaks[k], kept.get(each.variant, options.keep[stage + 1])))
            for k, each in ((k, running[k][0]) for k in chosen)
        ]
    return [
        Fitted(hypothesis, alone(peak), None, None, None if shorter is None else alone(shorter))
        for (hypothesis, _), peak, shorter in zip(running, peaks, before, strict=True)
    ]


def _climbed(cuts: Cuts, iterations: int, options: DiagnoseOptions, rough: bool, job: tuple[Hypothesis, Array]) -> Peak:
    return climb(Objective(job[0], cuts, options.sensor_floor), job[1], iterations=iterations, rough=rough)


def likeliest(hypothesis: Hypothesis, peak: Peak | PathPeak, grip: GripEvidence | None) -> float:
    """Return the evidence of the best point of a hypothesis, with what the grippers' poses say of it [nat]."""
    evidence = np.nan_to_num(peak.evidence, nan=-np.inf)
    if grip is not None and np.isfinite(evidence).any():
        points = [int(k) for k in np.flatnonzero(np.isfinite(evidence))]
        evidence[points] += [grip.beside(hypothesis, peak.coordinates[k], peak.covariance(k)) for k in points]
    return float(evidence.max())


def survivors(hypotheses: Sequence[Hypothesis], evidence: Sequence[float], most: int, close: float) -> list[int]:
    """Return which hypotheses go on: the likeliest of each of so many effects, and others that are as good.

    Args:
        hypotheses: those that are tried.
        evidence: of each of them [nat].
        most: so many effects go on.
        close: others go on that are this near to the likeliest [nat].
    """
    best: dict[tuple[str, ...], float] = {}
    # Two effects are the same two in either order.
    names = [tuple(sorted(each.effects)) for each in hypotheses]
    for effects, value in zip(names, evidence, strict=True):
        best[effects] = max(best.get(effects, -np.inf), value)
    ranked = sorted(best, key=lambda effects: -best[effects])
    # Where all are close, more go on.
    ranked = [name for place, name in enumerate(ranked) if place < most or best[name] > best[ranked[0]] - close]
    return [k for k, effects in enumerate(names) if effects in ranked and evidence[k] >= best[effects] - AS_GOOD]
