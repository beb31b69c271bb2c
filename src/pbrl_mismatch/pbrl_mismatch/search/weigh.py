"""Hypotheses weighed: odds from prior, evidence and number of variants; a veto by what was held out."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.effects.effect import Effect
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.fitted import Fitted
from pbrl_mismatch.search.predictive import predictive_test

VETO, VETO_SHARE = 8.0, 0.05
"""A hypothesis that predicts held-out windows worse than the baseline by this much [nat], and this share of what its
evidence gained, is not named."""
ASTRAY = 5.0
"""Nor is one whose forecasts of them are so many times as far off as the baseline's. Those of a right law are up to 3.4
times as far off, where feet stick or a crate is met; a wrong one that the windows alone allow went astray tenfold."""
DISCREPANCY, OF_HISTORY = 0.015, 0.04
"""Share of what a law explains that its being wrong may leave for others to explain; the same of contacts and of what
moves besides the body: how a crate or a caster is turned follows from all that was before."""
OF_EXACT, LEAVES = 0.01, 1e-5
"""The same of laws that are exact, for what the smoothed path and the sensor's own error leave. Such a law leaves more
than that where the test against wrenches, which knows of both, gives what it leaves a smaller chance."""
CLEAR = 3.0
"""One effect more has to be likelier by more than this [nat] after its prior, twenty times: where the law that it joins
is right nothing is, in more than one recording in twenty (Markov's inequality)."""
NAMED = 0.5
"""Effects are named where it is at least so probable that they are there, whatever is beside them."""
REFINED = 0.01
"""Share of what a law explains that a law of which it is a limit has to explain beyond it."""
JUDGED = 5
"""So many are held against held-out windows at most, each as long as it is the likeliest."""


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

    The prior gives nothing-left-out `none_odds` times what all single effects share. An effect's variants share its
    part, also those that were given up on the way: an effect of many laws is no likelier for having had a bad one fewer
    left. So do the kinds of baseline that are left under it.

    Several effects together have to explain clearly more of the motion, beyond the best of their parts, than what a
    law that is a little wrong leaves for any other to take: a share of what that part explains, and as much as the
    likeliest set of so many leaves unexplained. An exact law that leaves a wrench for certain is not a little wrong:
    something is beside it.

    Args:
        bases: kinds of baseline, fitted.
        tried: hypotheses with effects.
        options: prior odds.
    """
    groups: dict[tuple[str, ...], list[Fitted]] = {(): list(bases)}
    for fitted in tried:
        groups.setdefault(tuple(sorted(fitted.hypothesis.effects)), []).append(fitted)
    singles = max(sum(len(key) == 1 for key in groups), 1)
    none = max(base.evidence for base in bases)
    best = {key: max(members, key=_evidence) for key, members in groups.items()}
    sizes = {len(key) for key in groups if len(key) > 1}
    left = {size: _unexplained(each for key, each in best.items() if len(key) == size) for size in sizes}
    left_by = cache(lambda part: _left_by(best[part], _of_motion(best[()])))
    entries = []
    for key, members in groups.items():
        prior = math.log(options.none_odds) if not key else -len(key) * math.log(singles)
        weight = prior + _averaged(members, np.array([_evidence(member) for member in members]))
        if len(key) > 1:
            wrong = max((left_by(other) for other in groups if other and set(other) < set(key)), default=0.0)
            weight -= wrong + left[len(key)] + CLEAR * (len(key) - 1)
        limits = [_evidence(best[other]) for other in _limits(key) if other in groups]
        weight -= REFINED * max(max(limits, default=none) - none, 0.0)
        entries.append(Weighed(key, best[key], weight, 0.0, False))
    return _ordered(entries)


def _evidence(fitted: Fitted) -> float:
    """Return the evidence of a hypothesis, minus infinity where it has none [nat]."""
    return fitted.evidence if math.isfinite(fitted.evidence) else -math.inf


def _of_motion(fitted: Fitted) -> float:
    """Return its part that is not beside the motion, minus infinity where it has none [nat]."""
    return fitted.of_motion if math.isfinite(fitted.of_motion) else -math.inf


def _left_by(part: Fitted, none: float) -> float:
    """Return what a part leaves for others, as its laws are a little wrong, where nothing explains `none` [nat]."""
    laws = [EFFECTS[name] for name in part.hypothesis.effects]
    left = max(map(_discrepancy, laws), default=0.0) * max(_of_motion(part) - none, 0.0)
    exact = left > 0.0 and all(law.exact for law in laws)
    return 0.0 if exact and predictive_test(part.peak, 0).least < LEAVES else left


def _discrepancy(effect: Effect) -> float:
    """Return the share of what an effect explains that its law may leave for others."""
    if effect.exact:
        return OF_EXACT
    return OF_HISTORY if effect.of_history else DISCREPANCY


def _unexplained(sets: Iterable[Fitted]) -> float:
    """Return what the likeliest of some sets leaves unexplained [nat].

    It counts against all of them alike: that one explains more than another is in their evidence already.
    """
    likeliest = max(sets, key=_evidence)
    return likeliest.unexplained if math.isfinite(likeliest.evidence) else 0.0


def _limits(effects: tuple[str, ...]) -> list[tuple[str, ...]]:
    """Return the effects with one of them replaced by its limit: sliding alone, for breakaway."""
    return [
        tuple(sorted({*effects} - {name} | {limit}))
        for name in effects
        if (limit := EFFECTS[name].limit) is not None and limit not in effects
    ]


def _averaged(members: Sequence[Fitted], evidence: NDArray[np.float64]) -> float:
    """Return the log of the mean evidence over kinds of baseline and variants of all effects [nat]."""
    best: dict[tuple[str, ...], float] = {}
    for member, value in zip(members, evidence, strict=True):
        kind, *parts = member.hypothesis.variant.split(" + ")
        # Two effects are the same two in either order.
        laws = (kind, *sorted(parts))
        best[laws] = max(best.get(laws, -math.inf), float(value))
    variants = math.prod(len(EFFECTS[name].variants) for name in members[0].hypothesis.effects)
    return float(np.logaddexp.reduce(list(best.values()))) - math.log(variants * len({laws[0] for laws in best}))


def worth_of_another(weighed: Sequence[Weighed]) -> float:
    """Return how much likelier one effect more must make the likeliest hypothesis to be likelier than it [nat]."""
    singles = max(sum(len(each.effects) == 1 for each in weighed), 1)
    none = max(each.fitted.of_motion for each in weighed if not each.effects)
    return math.log(singles) + _left_by(weighed[0].fitted, none) + CLEAR


def veto(weighed: Sequence[Weighed], baseline: Fitted, judge: Callable[[Fitted], Fitted]) -> tuple[Weighed, ...]:
    """Return hypotheses with the likeliest held against what was held out of their fit.

    One that predicts it worse than the baseline loses what it predicts worse. What windows that are fitted to their
    starts allow may still forecast nothing: where a patch begins that the rest does not show. Several effects together
    that predict so badly, or worse than one of them does, are no rivals of that one.

    Args:
        weighed: hypotheses, likeliest first.
        baseline: judged.
        judge: gives a fitted hypothesis its score.
    """
    found = list(weighed)
    for _ in range(JUDGED):
        rank = max(range(len(found)), key=lambda k: found[k].log_weight)
        if not found[rank].effects or found[rank].fitted.score is not None or baseline.score is None:
            break
        best = found[rank] = _held_against(found[rank], baseline, judge)
        parts = [k for k, each in enumerate(found) if each.effects and set(each.effects) < set(best.effects)]
        if not parts:
            continue
        part = max(parts, key=lambda k: found[k].log_weight)
        if found[part].fitted.score is None:
            found[part] = _held_against(found[part], baseline, judge)
        if best.vetoed or _predicts_worse(best.fitted, found[part].fitted):
            found[rank] = replace(best, vetoed=True, log_weight=-math.inf)
    return _ordered(found)


def _held_against(weighed: Weighed, baseline: Fitted, judge: Callable[[Fitted], Fitted]) -> Weighed:
    """Return a hypothesis that is judged, less what it predicts worse than the baseline."""
    fitted = judge(weighed.fitted)
    if fitted.score is None or baseline.score is None:
        return replace(weighed, fitted=fitted)
    short = baseline.score.log_score - fitted.score.log_score
    vetoed = short > VETO + VETO_SHARE * max(fitted.evidence - baseline.evidence, 0.0)
    vetoed |= fitted.score.rmse_position > ASTRAY * baseline.score.rmse_position
    return replace(weighed, fitted=fitted, vetoed=vetoed, log_weight=weighed.log_weight - max(short, 0.0))


def _predicts_worse(whole: Fitted, part: Fitted) -> bool:
    """Tell whether several effects predict what was held out worse than one of them: its windows, and as a forecast."""
    if whole.score is None or part.score is None:
        return False
    farther = whole.score.rmse_position > part.score.rmse_position
    return farther and whole.score.log_score < part.score.log_score


def held_by(weighed: Sequence[Weighed], effects: Iterable[str]) -> float:
    """Return the probability that all of some effects are there, whatever is beside them."""
    return min(sum(each.probability for each in weighed if set(effects) <= set(each.effects)), 1.0)


def sure_first(weighed: Sequence[Weighed]) -> tuple[Weighed, ...]:
    """Return hypotheses with what is to be named first: the likeliest, or a part of it where only that is certain.

    Of an effect alone and the same beside another neither may be probable enough, and that the effect is there certain.

    Args:
        weighed: hypotheses, likeliest first.
    """
    parts = [each for each in weighed if each.effects and set(each.effects) <= set(weighed[0].effects)]
    sure = next((each for each in parts if held_by(weighed, each.effects) >= NAMED and not each.vetoed), weighed[0])
    return (sure, *(each for each in weighed if each is not sure))


def first_judged(
    weighed: Sequence[Weighed], baseline: Fitted, judge: Callable[[Fitted], Fitted]
) -> tuple[Weighed, ...]:
    """Return hypotheses as `sure_first` does, where what comes first was held against what was held out.

    Args:
        weighed: hypotheses, likeliest first, after `veto`.
        baseline: judged.
        judge: gives a fitted hypothesis its score.
    """
    found = sure_first(weighed)
    for _ in found:
        if not found[0].effects or found[0].fitted.score is not None or baseline.score is None:
            break
        found = sure_first(_ordered([_held_against(found[0], baseline, judge), *found[1:]]))
    return found


def _ordered(entries: Sequence[Weighed]) -> tuple[Weighed, ...]:
    """Return entries likeliest first, with their probabilities among all."""
    weight = np.array([each.log_weight for each in entries])
    share = np.exp(weight - np.logaddexp.reduce(weight))
    order = np.argsort(-weight, kind="stable")
    return tuple(replace(entries[k], probability=float(share[k])) for k in order)
