"""The told oracle: what a fit reaches that knows which effect was concealed and where it is. For scoring alone.

It is given the truth as a start and the effect's own prior and law; what it then lacks of the truth is the law's doing,
and what a diagnosis lacks of it is the search's. Its evidence against the baseline's says whether an effect that was
drawn could have been seen at all.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import chi2, ncx2

from pbrl_bag.types import Recording
from pbrl_bringup.concealed.truth import Truth
from pbrl_mismatch.data.grip import lay_grips
from pbrl_mismatch.diagnose import fit_baselines, track_of
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.fitted import Fitted, Stages, cut_stages, fit_from, judged, scene_of
from pbrl_mismatch.search.grip import GRASP_COMPLIANCE, beside_motion, gives_way, grip_evidence
from pbrl_mismatch.search.hypothesis import Hypothesis

Array = NDArray[np.float64]

STARTS = 6
JITTER = 0.15
"""Of the starts about the truth, in standard deviations of the prior."""


@dataclass(frozen=True)
class Oracle:
    """What is reached when told.

    Attributes:
        fitted: the true effects, fitted from their true values.
        baseline: the best baseline.
    """

    fitted: Fitted
    baseline: Fitted

    @property
    def gain(self) -> float:
        """Return by how much the truth is likelier than the baseline [nat]."""
        return self.fitted.evidence - self.baseline.evidence

    @property
    def times_detectable(self) -> float:
        """Return how strong the effects are over the least that this oracle detects in 95 % of recordings.

        Twice the gain of the best log posterior is a chi-square whose non-centrality grows with the square of the
        strength; what a test at 5 % finds in 95 % has a known one.
        """
        more = len(self.fitted.hypothesis.parameters) - len(self.baseline.hypothesis.parameters)
        freedom = max(more, 1)
        found = 2.0 * (_height(self.fitted) - _height(self.baseline)) - freedom
        return math.sqrt(max(found, 0.0) / non_centrality(freedom))


@cache
def non_centrality(freedom: int, level: float = 0.05, power: float = 0.95) -> float:
    """Return the non-centrality at which a chi-square test with so many degrees of freedom has a power."""
    bound = float(chi2.isf(level, freedom))
    return float(brentq(lambda value: ncx2.sf(bound, freedom, value) - power, 1e-3, 200.0))


def _height(fitted: Fitted) -> float:
    """Return the log posterior at its best point, with what the grippers' poses say [nat]."""
    objective, peak = fitted.peak.objective, fitted.peak
    motion = objective.likelihood(peak.misfit)[0] - 0.5 * objective.prior_misfit(peak.coordinates)[0]
    return float(motion) + fitted.beside


def oracle(recording: Recording, truth: Truth, options: DiagnoseOptions | None = None) -> Oracle:
    """Fit what was concealed, told.

    Args:
        recording: as a diagnosis gets it.
        truth: what was concealed; effects that act through the body's motion.
        options: of a diagnosis.
    """
    chosen = options or DiagnoseOptions()
    track = track_of(recording, truth.body)
    stages = cut_stages(track, chosen)
    bases = fit_baselines(np.random.default_rng(chosen.seed), track, stages, chosen)
    grips = lay_grips(recording, track)
    grip = None if grips is None else grip_evidence(grips, chosen.delay_spread)
    bases = [beside_motion(each, grip) for each in bases]
    true = "wheel" if "wheel_x" in truth.told else "free"
    fits: list[Fitted] = []
    for base in bases:
        if base.hypothesis.variant != true:
            continue
        grounds = [base.hypothesis]
        for name in truth.effects:
            if name == GRASP_COMPLIANCE:
                continue
            scaled = scene_of(track, base.row)
            grounds = [
                ground.with_effect(EFFECTS[name], scaled, variant)
                for ground in grounds
                for variant in range(len(EFFECTS[name].variants))
            ]
        fits += [_fitted(ground, truth.told, base, stages, chosen) for ground in grounds]
    if GRASP_COMPLIANCE in truth.effects and grip is not None:
        fits = [gives_way(each, grip) for each in fits]
    best = max((beside_motion(each, grip) for each in fits), key=lambda each: each.evidence)
    return Oracle(judged(best, stages, chosen), judged(bases[0], stages, chosen, even=True))


def seen(recording: Recording, truth: Truth) -> bool:
    """Tell whether what was concealed is at least as strong as what a told oracle detects in 95 % of recordings."""
    return oracle(recording, truth).times_detectable >= 1.0


def _fitted(
    hypothesis: Hypothesis, values: Mapping[str, float], base: Fitted, stages: Stages, options: DiagnoseOptions
) -> Fitted:
    """Climb from the truth, and from beside it; what is not told starts where the baseline is, or at its prior."""
    centre = hypothesis.mean.copy()
    for k, parameter in enumerate(hypothesis.parameters):
        told = values.get(parameter.column)
        if told is not None:
            centre[k] = math.log(max(told, 1e-6)) if parameter.positive else told
        elif parameter.column in base.hypothesis.columns:
            centre[k] = base.peak.coordinates[0, base.hypothesis.columns.index(parameter.column)]
    rng = np.random.default_rng(options.seed)
    starts = centre + JITTER * hypothesis.spread * rng.standard_normal((STARTS, len(centre)))
    starts[0] = centre
    return fit_from(hypothesis, stages, starts, options)
