"""What explains a mismatch: single effects on the baselines, then others on top, over windows that can be predicted."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.fitted import Fitted, Stages, alone, apart_rows, judged
from pbrl_mismatch.search.grip import GRASP_COMPLIANCE, GripEvidence, beside_motion, gives_way
from pbrl_mismatch.search.hypothesis import BELIEVED, Hypothesis
from pbrl_mismatch.search.library import search_library, trace
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.path.ground import traced
from pbrl_mismatch.search.path.pins import may_be_pinned
from pbrl_mismatch.search.predictive import predictive_test
from pbrl_mismatch.search.weigh import Weighed, veto, weigh, worth_of_another

Array = NDArray[np.float64]

GROUNDS_OF_SETS, OF_THE_BEST = 3, 0.3
"""So many of the likeliest hypotheses are tried with one effect more where the likeliest leaves something out: of two
that act, the likeliest is often a third that stands in for both. Each explains at least this share of what it does."""
FEWER = {"shortlist": 6, "candidates": 2, "keep": (1, 1)}
"""What is looked at where an effect is laid on another: the ground is nearly right."""
REACHED = 1.12
"""A hypothesis that needs less than this scale of the noise predicts windows of its length."""
POLISHED, POLISHED_OF_SETS, LONGER = 5, 3, 2
"""So many of the likeliest effects, and of the likeliest sets, are climbed on, for so many times the usual steps."""
TRIED_OUT, GO_ON = 4, 4
"""Steps that every start of a climb on has, and how many starts go on from there."""
EXPLAINS = 10.0
"""What is likelier than the baseline by more explains something [nat]."""
LEADS = 3
"""So many of the likeliest effects lead a baseline to where they have the body's own parameters, and so many of the
sets that explain most lead their parts."""
LED = 100.0
"""Kinds of baseline that are worse than the best by more [nat] are not led: no other top would do. Nor are effects
tried on richer kinds than the best that are."""
FREEDOM = 1.0
"""An effect that says nothing is less likely than the baseline by about so much at least, for its freedom [nat]."""
WORTH_A_SET = 3.0
"""Where the likeliest explains all that the test against any wrench sees, one effect more is looked into where along
the path it is worth by this more than its prior costs [nat]."""
FAINT = 2.0
"""What a law has that its limit has not begins so many deviations of its prior below the mean."""
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

    Long windows say most of a force, but where feet stick and let go nothing predicts them: where no effect reaches the
    noise floor over the longest, the next shorter ones are asked.

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
    bases = sorted(bases, key=lambda each: -each.evidence)
    tried = _tried(seeds[0], track, _grounds(bases), stages, grip, options)
    bases = led(bases, tried, stages, options)
    singles = weigh(bases, tried, options)
    if _falls_short(tried) and len(stages.fitted) > 1:
        tried = _polished(singles, tried, stages, options)
    if _falls_short(tried) and len(stages.fitted) > 1:
        stages, bases = stages.without_longest(), [each.over_shorter() for each in bases]
        bases = sorted(bases, key=lambda each: -each.evidence)
        tried = [beside_motion(each.over_shorter(), grip) for each in tried]
        bases = led(bases, tried, stages, options)
    tried = [beside_motion(each, grip) for each in _polished(weigh(bases, tried, options), tried, stages, options)]
    weighed = weigh(bases, tried, options)
    odds = min(_log_odds(singles), _log_odds(weighed))
    for depth in range(1, options.most_together):
        if len(weighed[0].effects) < depth:
            break
        least, lacks = -math.inf, _lacks(weighed[0].fitted, grip, options)
        if not lacks:
            if len(stages.fitted) < len(options.windows):
                break  # What is weighed are shorter windows than the path's.
            least = worth_of_another(weighed) + WORTH_A_SET
        deepest = _grounds_of_sets(weighed, depth, track, lacks)
        fewer = options.model_copy(update=FEWER)
        more = _tried(seeds[depth], track, deepest, stages, grip, fewer, least)
        if not more:
            break
        likely = tuple(each for each in weigh(bases, [*tried, *more], options) if len(each.effects) != depth)
        tried += [beside_motion(each, grip) for each in _polished(likely, more, stages, options, POLISHED_OF_SETS)]
        weighed = weigh(bases, tried, options)
    tried = [beside_motion(each, grip) for each in _parts_led(weighed, tried, stages, options)]
    return Explained(weigh(bases, tried, options), bases, stages, odds)


def _parts_led(
    weighed: tuple[Weighed, ...], tried: list[Fitted], stages: Stages, options: DiagnoseOptions
) -> list[Fitted]:
    """Return what was tried, the parts of the sets that explain most climbed on from where those have them.

    An effect of which there is nothing may have done no more than lead another to a better top: alone that does as well
    there. A hold that gives way leads nothing: it is laid on a top as it is and learned beside the motion.
    """
    sets = [each.fitted for each in weighed if len(each.effects) > 1 and GRASP_COMPLIANCE not in each.effects]
    sets = sorted(sets, key=_lowest)[:LEADS]

    def led_on(part: Fitted) -> Fitted:
        effects, found = set(part.hypothesis.effects), part
        for whole in sets:
            if effects < set(whole.hypothesis.effects) and whole.evidence > part.evidence:
                found = _climbed_on(found, whole, stages, options)
        return found

    with ThreadPoolExecutor(options.workers) as pool:
        return list(pool.map(led_on, tried))


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
        if grip.beyond(best.hypothesis, peak.coordinates[0], peak.covariance(0)) > 0.0:
            return True
    # Where a simulation is far off, what a wrench explains and the rest of the test are both large.
    return best.noise_scale > REACHED or predictive_test(best.peak, 0).p_value < options.level


def _falls_short(tried: list[Fitted]) -> bool:
    """Tell whether nothing that was tried predicts the windows it was fitted to."""
    return min(each.noise_scale for each in tried) > REACHED


def led(bases: list[Fitted], tried: list[Fitted], stages: Stages, options: DiagnoseOptions) -> list[Fitted]:
    """Return the baselines climbed on from where likely effects have mass and wheel, best first.

    Where bodies stick there are many tops. An effect that does nothing but lead to a better one explains nothing.
    """
    likely = sorted((each for each in tried if GRASP_COMPLIANCE not in each.hypothesis.effects), key=_lowest)[:LEADS]
    best, climbed = max(base.evidence for base in bases), []
    for base in bases:
        found = base
        for each in likely if base.evidence > best - LED else []:
            # One that is no likelier for all its freedom has found no better top.
            found = _climbed_on(found, each, stages, options) if each.evidence > found.evidence - FREEDOM else found
        climbed.append(found)
    return sorted(climbed, key=_lowest)


def _lowest(fitted: Fitted) -> float:
    return -fitted.evidence


def _polished(
    weighed: tuple[Weighed, ...], tried: list[Fitted], stages: Stages, options: DiagnoseOptions, most: int = POLISHED
) -> list[Fitted]:
    """Return what was tried, the likeliest climbed on, also from what the best one has for the baseline's parameters.

    A law that is right may be held up where the wrong baseline put it: mass and wheel are then where another law, which
    explains much too, has found them.
    """
    best = next((each.fitted for each in weighed if each.effects and GRASP_COMPLIANCE not in each.effects), None)
    if best is None:
        return tried
    none = max((each.fitted.evidence for each in weighed if not each.effects), default=-math.inf)
    # Where nothing explains anything yet, a law that is right may still be on its way: all go on.
    names = [each.effects for each in weighed if each.effects][: most if best.evidence > none + EXPLAINS else None]
    chosen = {id(each.fitted) for each in weighed if each.effects in names}
    jobs = [each for each in tried if id(each) in chosen and GRASP_COMPLIANCE not in each.hypothesis.effects]
    with ThreadPoolExecutor(options.workers) as pool:
        better = dict(
            zip(map(id, jobs), pool.map(lambda each: _climbed_on(each, best, stages, options), jobs), strict=True)
        )
    return [better.get(id(each), each) for each in tried]


def _climbed_on(fitted: Fitted, best: Fitted, stages: Stages, options: DiagnoseOptions) -> Fitted:
    """Return a hypothesis climbed on from where it is, and from where another has the body's own parameters."""
    objective = Objective(fitted.hypothesis, stages.fitted[-1], options.sensor_floor)
    first = climb(objective, *_starts(fitted, best), iterations=TRIED_OUT, rough=True)
    order = np.argsort(-np.nan_to_num(first.evidence, nan=-np.inf), kind="stable")
    likely = first.take(order[apart_rows(first.coordinates[order], fitted.hypothesis.spread, GO_ON)])
    more = LONGER * options.iterations[-1] - TRIED_OUT
    peak = climb(objective, likely.coordinates, likely.nuisance, iterations=more)
    better = float(peak.evidence.max()) > float(fitted.peak.evidence[0])
    found = replace(fitted, peak=alone(peak)) if better else fitted
    if found.traced is None or best.traced is None or not best.traced.evidence > found.traced.evidence:
        return found
    reached = found.traced.coordinates, best.hypothesis, best.traced.coordinates
    # Each has a path of its own.
    for along in np.unique([_crossed(fitted.hypothesis, *reached, all_shared=each) for each in (False, True)], axis=0):
        other = traced(fitted.hypothesis, along[None], stages.fitted[-1], options.sensor_floor)
        if found.traced is None or other.evidence > found.traced.evidence:
            found = replace(found, traced=other)
    return found


def _starts(fitted: Fitted, best: Fitted) -> tuple[Array, Array]:
    """Return where a hypothesis is climbed on from: where it is, and what it is with what the best one found.

    Returns:
        Coordinates (n, K), and the windows' nuisances (n, W, NUISANCES) of the one that they are from, or at rest:
        where a contact is met or missed by how a window begins, coordinates alone do not lead back to where they were
        good.
    """
    hypothesis, own, reached = fitted.hypothesis, fitted.peak.coordinates[0], best.peak.coordinates[0]
    begins, begun = fitted.peak.nuisance[0], best.peak.nuisance[0]
    crossed = _crossed(hypothesis, own, best.hypothesis, reached)
    starts = [(own, begins), (crossed, begun)]
    if hypothesis.effects:
        # What the best one bent of mass and delay may be the very thing that another effect explains.
        bent = np.isin(hypothesis.columns, list(BELIEVED))
        starts += [(hypothesis.as_believed(own), begins), (np.where(bent, own, crossed), begun)]
    # Laws that are one another's limits share more than the body: ground friction is breakaway friction without.
    alike = _crossed(hypothesis, own, best.hypothesis, reached, all_shared=True)
    if np.any(alike != crossed):
        alone_in_it = np.isin(hypothesis.columns, best.hypothesis.columns, invert=True)
        faint = np.where(alone_in_it, hypothesis.mean - FAINT * hypothesis.spread, alike)
        starts += [(alike, begun), (faint, begun)]
    if fitted.traced is not None:
        starts += [(fitted.traced.coordinates, begins)]
    coordinates, nuisances = (np.array(each) for each in zip(*starts, strict=True))
    return np.concatenate([coordinates] * 2), np.concatenate([nuisances, np.zeros_like(nuisances)])


def _crossed(
    hypothesis: Hypothesis, own: Array, other: Hypothesis, coordinates: Array, *, all_shared: bool = False
) -> Array:
    """Return the coordinates (K,) of a hypothesis with what is the body's, or of effects of both, as another has it.

    With `all_shared` that is so of whatever both have, by its column, in whichever effect.
    """
    crossed = own.copy()
    not_shared = set() if all_shared else set(hypothesis.effects) - set(other.effects)
    effect = {column for name in not_shared for v in EFFECTS[name].variants for column in v}
    for k, column in enumerate(hypothesis.columns):
        if column in other.columns and column not in effect:
            crossed[k] = coordinates[other.columns.index(column)]
    return crossed


def held_against(explained: Explained, baseline: Fitted, options: DiagnoseOptions) -> tuple[Weighed, ...]:
    """Return the hypotheses with the likeliest held against what was held out of their fits, beside the baseline's."""
    return veto(explained.weighed, baseline, partial(judged, stages=explained.stages, options=options))


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
    least = len(bases[0].hypothesis.parameters), bases[0].evidence - LED
    richer = [each for each in bases[1:] if len(each.hypothesis.parameters) > least[0] and each.evidence > least[1]]
    return [simplest, bases[0], *richer]
