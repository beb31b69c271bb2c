"""Hypotheses weighed: odds from prior, evidence and number of variants; a veto by what was held out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.library import Fitted

VETO = 3.0
"""A hypothesis that predicts held-out windows worse than the baseline by this much [nat] is not named."""


@dataclass(frozen=True)
class Weighed:
    """An effect, or several together, with its best variant.

    Attributes:
        effects: their names; empty: nothing was left out.
        fitted: best variant on the best baseline.
        log_weight: log of prior odds times evidence, variants averaged [nat].
        probability: among all that were tried.
        vetoed: whether held-out windows speak against it.
    """

    effects: tuple[str, ...]
    fitted: Fitted
    log_weight: float
    probability: float
    vetoed: bool


def weigh(bases: Sequence[Fitted], tried: Sequence[Fitted], options: DiagnoseOptions) -> tuple[Weighed, ...]:
    """Return the effects that were tried and the baseline, likeliest first.

    The prior gives nothing-left-out `none_odds` times what all single effects share. An effect's variants, and the
    kinds of baseline under it, share its part.

    Args:
        bases: kinds of baseline, fitted.
        tried: hypotheses with effects.
        options: prior odds.
    """
    groups: dict[tuple[str, ...], list[Fitted]] = {(): list(bases)}
    for fitted in tried:
        groups.setdefault(tuple(sorted(fitted.hypothesis.effects)), []).append(fitted)
    singles = max(sum(len(key) == 1 for key in groups), 1)
    before = bases[0].score.log_score if bases[0].score else None
    names, best, weights, vetoes = [], [], [], []
    for key, members in groups.items():
        evidence = np.array([member.evidence for member in members])
        finite = np.where(np.isfinite(evidence), evidence, -np.inf)
        top = int(np.argmax(finite))
        prior = math.log(options.none_odds) if not key else -len(key) * math.log(singles)
        names.append(key)
        best.append(members[top])
        weights.append(prior + float(np.logaddexp.reduce(finite)) - math.log(len(members)))
        score = members[top].score
        vetoes.append(bool(key) and before is not None and score is not None and score.log_score < before - VETO)
    weight = np.array(weights) - np.where(vetoes, VETO, 0.0)
    share = np.exp(weight - np.logaddexp.reduce(weight))
    order = np.argsort(-weight, kind="stable")
    return tuple(Weighed(names[k], best[k], float(weight[k]), float(share[k]), vetoes[k]) for k in order)
