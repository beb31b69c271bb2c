"""What explains a mismatch: single effects on the baselines, then others on top, over windows that can be predicted."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climbed_on import (
    POLISHED_OF_SETS,
    is_part,
    keeps_up,
    led,
    over_longest,
    parts_led,
    polished,
    sets_led,
)
from pbrl_mismatch.search.fitted import Fitted, Stages, judged, likeliest_first
from pbrl_mismatch.search.grip import GRASP_COMPLIANCE, GripEvidence, beside_motion, gives_way, moved_on
from pbrl_mismatch.search.hops import REACHED, hopped
from pbrl_mismatch.search.library import UNTOLD, search_library, trace
from pbrl_mismatch.search.path.pins import may_be_pinned
from pbrl_mismatch.search.predictive import predictive_test
from pbrl_mismatch.search.weigh import Weighed, first_judged, veto, weigh, worth_of_another

Array = NDArray[np.float64]

GROUNDS_OF_SETS, OF_THE_BEST = 3, 0.3
"""So many of the likeliest hypotheses are tried with one effect more where the likeliest leaves something out: of two
that act, the likeliest is often a third that stands in for both. Each explains at least this share of what it does."""
FEWER = {"shortlist": 6, "candidates": 2, "keep": (1, 1)}
"""What is looked at where an effect is laid on another: the ground is nearly right."""
WORTH_A_KIND = 3.0
"""A kind of baseline with more parameters is worth a search of its own where it is better by this [nat]."""


@dataclass(frozen=True)
class Explained:
    """What was tried.

    Attributes:
        weighed: hypotheses, likeliest first; the baseline is among them.
        bases: kinds of baseline over the same windows, best first.
        stages: the windows that were asked.
        log_odds: of any single effect against none, at even prior odds.
    """

    weighed: tuple[Weighed, ...]
    bases: list[Fitted]
    stages: Stages
    log_odds: float


def explain(
    seed: np.random.SeedSequence,
    track: Track,
    bases: list[Fitted],
    stages: Stages,
    grip: GripEvidence | None,
    options: DiagnoseOptions,
) -> Explained:
    """Try single effects, then others on top of the likeliest for as long as something is still left out.

    Long windows say most of a force, but where contacts come and go nothing predicts them: where no effect reaches the
    noise floor over the longest, nor is told by its path, the next shorter ones are asked. Several together, found
    there, may reach it over the longest after all, and are then weighed there.

    Args:
        seed: of every draw.
        track: what was recorded.
        bases: kinds of baseline, fitted, best first.
        stages: windows.
        grip: what the grippers' poses say; None where none was seen.
        options: settings.
    """
    seeds = seed.spawn(options.most_together)
    longest = cut_windows(track, max(options.windows))
    bases = [trace(longest, options, each, each.peak.coordinates) for each in bases]
    bases = likeliest_first(bases)
    tried = _tried(seeds[0], track, _grounds(bases), stages, grip, options)
    if not tried:  # The library has nothing left that this recording could show.
        return Explained(weigh(bases, tried, options), bases, stages, -math.inf)
    bases, given_up = led(bases, tried, stages, options), None
    tried = moved_on(tried, bases, grip)
    singles = weigh(bases, tried, options)
    if _falls_short(tried) and len(stages.fitted) > 1:
        tried = polished(singles, tried, stages, options, hops=False)
    if _falls_short(tried) and not _runs_away(tried) and len(stages.fitted) > 1:
        given_up = Tried(stages, bases, tried)
        stages, bases = stages.without_longest(), [each.over_shorter() for each in bases]
        bases = likeliest_first(bases)
        tried = [beside_motion(each.over_shorter(), grip) for each in tried]
        bases = led(bases, tried, stages, options)
    tried = moved_on(polished(weigh(bases, tried, options), tried, stages, options), bases, grip)
    # What has hopped is held against what has hopped as well.
    (best,) = hopped(bases[:1], stages.fitted[-1], options, max(each.evidence for each in tried))
    bases = likeliest_first([beside_motion(best, grip), *bases[1:]])
    tried = moved_on(tried, bases, grip)
    weighed = weigh(bases, tried, options)
    odds = min(_log_odds(singles), _log_odds(weighed))
    for depth in range(1, options.most_together):
        if len(weighed[0].effects) < depth:
            break
        least, lacks = -math.inf, _lacks(weighed[0].fitted, grip, options)
        if not lacks:
            if len(stages.fitted) < len(options.windows):
                break  # What is weighed are shorter windows than the path's.
            # All that the test sees is explained: one effect more is looked into where along the path it is worth it.
            least = worth_of_another(weighed)
        deepest = _grounds_of_sets(weighed, depth, track, lacks)
        fewer = options.model_copy(update=FEWER)
        more = _tried(seeds[depth], track, deepest, stages, grip, fewer, least)
        if not more:
            break
        likely = tuple(each for each in weigh(bases, [*tried, *more], options) if len(each.effects) in (0, depth + 1))
        tried = moved_on([*tried, *polished(likely, more, stages, options, POLISHED_OF_SETS)], bases, grip)
        weighed = weigh(bases, tried, options)
    if given_up is not None and (back := with_sets(given_up, weighed, grip, options)) is not None:
        stages, bases, tried = back.stages, back.bases, back.tried
        weighed = weigh(bases, tried, options)
    led_on = moved_on(parts_led(weighed, tried, stages, options), bases, grip)
    tried = moved_on(sets_led(weighed, tried, led_on, stages, options), bases, grip)
    return Explained(weigh(bases, tried, options), bases, stages, odds)


@dataclass(frozen=True)
class Tried:
    """What was tried over windows up to some length, and the kinds of baseline."""

    stages: Stages
    bases: list[Fitted]
    tried: list[Fitted]


def with_sets(
    longest: Tried, weighed: tuple[Weighed, ...], grip: GripEvidence | None, options: DiagnoseOptions
) -> Tried | None:
    """Return the longest windows with sets that shorter ones have found, if one of these predicts them.

    Args:
        longest: single effects over windows that none of them predicts.
        weighed: over shorter windows.
        grip: what the grippers' poses say; None where none was seen.
        options: settings.
    """
    sets = over_longest(weighed, longest.tried, longest.stages, options)
    if not sets or _falls_short(sets):
        return None
    parts = [any(is_part(each, whole) for whole in sets) for each in longest.tried]
    others = [each for each, part in zip(longest.tried, parts, strict=True) if not part]
    compared = [each for each, part in zip(longest.tried, parts, strict=True) if part] + sets
    # What has hopped is held against what has hopped as well.
    ends = hopped(compared, longest.stages.fitted[-1], options, max(each.evidence for each in sets))
    return replace(longest, tried=[beside_motion(each, grip) for each in [*others, *ends]])


def _grounds_of_sets(weighed: tuple[Weighed, ...], depth: int, track: Track, lacks: bool) -> list[Fitted]:
    """Return the hypotheses of so many effects that one more is tried on: a pin too, where a place stood still."""
    none = max(each.fitted.of_motion for each in weighed if not each.effects)
    likeliest = [each.fitted for each in weighed if len(each.effects) == depth]
    least = none + OF_THE_BEST * (max(each.of_motion for each in likeliest) - none)
    # A hold that gives way is laid on a motion as it is.
    others = [
        each for each in likeliest[1:] if each.of_motion > least and GRASP_COMPLIANCE not in each.hypothesis.effects
    ]
    chosen = [likeliest[0], *(others[: GROUNDS_OF_SETS - 1] if lacks else [])]
    pins = [each for each in likeliest if any(EFFECTS[name].pins for name in each.hypothesis.effects)]
    return chosen + ([each for each in pins[:1] if each not in chosen] if may_be_pinned(track) else [])


def _lacks(best: Fitted, grip: GripEvidence | None, options: DiagnoseOptions) -> bool:
    """Tell whether something is left out of what explains most: in the motion, or in the gripper's poses beside it."""
    if grip is not None and grip.p_value < options.level:
        peak = best.peak
        if grip.beyond(best.hypothesis, peak.coordinates[0], peak.covariance(0), options.effects) > 0.0:
            return True
    # Where a simulation is far off, what a wrench explains and the rest of the test are both large.
    return best.noise_scale > REACHED or predictive_test(best.peak, 0).p_value < options.level


def _falls_short(tried: list[Fitted]) -> bool:
    """Tell whether nothing that was tried predicts the windows it was fitted to."""
    return min(each.noise_scale for each in tried) > REACHED


def _runs_away(tried: list[Fitted]) -> bool:
    """Tell whether simulations run away from what is likeliest along its path, which shorter ones would as well."""
    best = max(tried, key=lambda each: each.of_motion)
    return best.traced is not None and best.traced.evidence > best.simulated + UNTOLD


def held_against(explained: Explained, baseline: Fitted, options: DiagnoseOptions) -> tuple[Weighed, ...]:
    """Return the hypotheses, what is to be named first, the likeliest held against what was held out of their fits."""
    judge = partial(judged, stages=explained.stages, options=options)
    return first_judged(veto(explained.weighed, baseline, judge), baseline, judge)


def _log_odds(weighed: tuple[Weighed, ...]) -> float:
    """Return the log odds of any single effect against none, at even prior odds."""
    none = next(each.log_weight for each in weighed if not each.effects)
    some = [each.log_weight for each in weighed if len(each.effects) == 1]
    return float(np.logaddexp.reduce(some)) - none if some else -math.inf


def _tried(
    seed: np.random.SeedSequence,
    track: Track,
    grounds: list[Fitted],
    stages: Stages,
    grip: GripEvidence | None,
    options: DiagnoseOptions,
    least: float = -math.inf,
) -> list[Fitted]:
    """Try every effect on every ground; what the grippers' poses say comes in beside the motion.

    Nothing is returned where no effect's path is likelier than its ground's by `least` [nat].
    """
    found = [beside_motion(each, grip) for each in search_library(seed, track, grounds, stages, options, least, grip)]
    if not found and least > -math.inf:
        return []
    if grip is not None and GRASP_COMPLIANCE in options.effects:
        found += [gives_way(each, grip) for each in grounds if GRASP_COMPLIANCE not in each.hypothesis.effects]
    return found


def _grounds(bases: list[Fitted]) -> list[Fitted]:
    """Return the baselines that effects are tried on: the simplest, the best where that is another, and richer ones.

    The best kind alone will not do: what an effect did, a wheel with two axes may have learned to stand in for; or it
    hid that a wheel has two, so that a locked caster did as well.
    """
    simplest = min(bases, key=lambda each: len(each.hypothesis.parameters))
    if bases[0].evidence <= simplest.evidence + WORTH_A_KIND:
        return [simplest]
    parameters = len(bases[0].hypothesis.parameters)
    richer = [each for each in bases[1:] if len(each.hypothesis.parameters) > parameters and keeps_up(each, bases[0])]
    return [simplest, bases[0], *richer]
