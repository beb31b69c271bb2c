"""The acceptance rows of `bench concealed`, by set, shares with exact intervals and rivals beside ours."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.stats import beta, binom, kstest

from pbrl_bringup.benches.rows import Row, at_least, at_most, without_goal
from pbrl_bringup.concealed.scoring import ALWAYS, Score
from pbrl_mismatch.observability.strengths import STRENGTHS

STRONG = 3.0
"""Times the strength that a told oracle detects in 95 %."""
BORDERS = {"floor_patch": 0.05, "hidden_obstacle": 0.05, "second_wheel": 0.05, "hidden_hinge": 0.05, "tether": 0.10}
"""How far off a place may be [m]."""
MOMENTS = {"payload_change": "load change", "unseen_body": "first contact with an unseen body"}
GOALS = {"single": (0.90, 0.97), "rough": (0.85, 0.95)}
"""Shares of first and among the first two, by set."""
BOOTSTRAPS = 2000
LOCALISED = {"time": 0.90, "region": 0.90, "regime": 0.90}


def rows_of(scores: Sequence[Score]) -> list[Row]:
    """Return the rows of every set that was run."""
    by_set = {name: [each for each in scores if each.set == name] for name in dict.fromkeys(s.set for s in scores)}
    rows: list[Row] = []
    if by_set.get("clean"):
        rows += _alarms(by_set["clean"])
    for name, goals in GOALS.items():
        if by_set.get(name):
            rows += _named(name, by_set[name], goals)
    if by_set.get("single"):
        rows += _strong(by_set["single"])
    if by_set.get("furnished"):
        told = [each.first for each in by_set["furnished"]]
        rows.append(_share("furnished: effect named first", told, 0.80))
    if by_set.get("pairs"):
        told = [each.first for each in by_set["pairs"]]
        strong = [each.first for each in by_set["pairs"] if each.times_detectable >= STRONG]
        clear = {f"each_{STRONG:g}_times_what_can_be_seen": f"{sum(strong)} of {len(strong)}"}
        rows.append(_share("pairs: both effects named, and nothing before them", told, 0.70, **clear))
    if by_set.get("withheld"):
        rows.append(_withheld(by_set["withheld"]))
    hidden = by_set.get("single", [])
    if hidden:
        rows += [*_repaired(hidden), *_placed(hidden), *_timed(hidden), *_biased(hidden), *_localised(hidden)]
    spent = [each.seconds for each in scores if not math.isnan(each.seconds)]
    failed = sum(bool(each.failed) for each in scores)
    theirs = {name: median(_rival(scores, name, _of("seconds"))) for name in _rivals(scores)}
    what = "CPU time of a diagnosis, without its start and its page"
    return [*rows, _middle(at_most, what, spent, "s", 60.0, failed=failed, **theirs)]


def interval(hits: int, count: int, level: float = 0.95) -> str:
    """Return the exact (Clopper-Pearson) interval of a share."""
    if count == 0:
        return "0 to 1"
    tail = (1.0 - level) / 2.0
    low = 0.0 if hits == 0 else float(beta.ppf(tail, hits, count - hits + 1))
    high = 1.0 if hits == count else float(beta.ppf(1.0 - tail, hits + 1, count - hits))
    return f"{low:.3f} to {high:.3f}"


def median_interval(values: Sequence[float], level: float = 0.95) -> str:
    """Return the interval of a median between order statistics, exact whatever the distribution; infinite if few."""
    known = sorted(value for value in values if not math.isnan(value))
    skipped = int(binom.ppf((1.0 - level) / 2.0, len(known), 0.5)) if known else 0
    if skipped == 0:
        return "-inf to inf"
    return f"{known[skipped - 1]:.4g} to {known[-skipped]:.4g}"


def mean_interval(values: Sequence[float], level: float = 0.95) -> str:
    """Return the interval of a mean by bootstrap, the same each time; a single value says nothing."""
    known = np.array([value for value in values if not math.isnan(value)])
    if len(known) < 2:
        return "-inf to inf"
    means = np.random.default_rng(0).choice(known, (BOOTSTRAPS, len(known))).mean(axis=1)
    low, high = np.quantile(means, [(1.0 - level) / 2.0, (1.0 + level) / 2.0])
    return f"{low:.3f} to {high:.3f}"


def _middle(
    judged: Callable[..., Row], what: str, values: Sequence[float], unit: str, goal: float, **against: float | str
) -> Row:
    """Return a row of a median, with the count behind it and its interval."""
    count = sum(not math.isnan(value) for value in values)
    told = {"interval": median_interval(values), **against}
    return judged(f"{what}, median of {count}", median(values), unit, goal, **told)


def _alarms(clean: Sequence[Score]) -> list[Row]:
    known = [each.p_value for each in clean if not math.isnan(each.p_value)]
    alarms, count = sum(each.mismatch for each in clean), len(clean)
    even = float(kstest(known, "uniform").pvalue) if len(known) > 1 else math.nan
    what = f"false alarms on {count} clean recordings at the 5 % level, share"
    return [
        at_most(what, alarms / count, "1", 0.05, interval=interval(alarms, count), alarms=alarms),
        at_least(f"p-values of {len(known)} clean recordings against even ones, p of Kolmogorov", even, "1", 0.05),
    ]


def _named(name: str, scores: Sequence[Score], goals: tuple[float, float]) -> list[Row]:
    seen = _mean([each.mismatch for each in scores])
    return [
        _share(f"{name}: effect named first", [each.first for each in scores], goals[0], noticed=seen),
        _share(
            f"{name}: effect among the first two",
            [each.in_two for each in scores],
            goals[1],
            among_three=_mean([each.in_three for each in scores]),
        ),
    ]


def _strong(scores: Sequence[Score]) -> list[Row]:
    strong = [each for each in scores if each.times_detectable >= STRONG]
    weak = sum(each.times_detectable < 1.0 for each in scores)
    asked = sum(not math.isnan(each.times_detectable) for each in scores)
    what = f"at {STRONG:g} times the detectable strength"
    told: dict[str, float | str] = {"weaker_than_an_oracle_detects": weak, "oracle_asked": asked}
    return [
        _share(f"single: effect named first {what}", [each.first for each in strong], 0.97, **told),
        _share(f"single: effect among the first two {what}", [each.in_two for each in strong], 0.99),
    ]


def _withheld(scores: Sequence[Score]) -> Row:
    seen = [each for each in scores if each.mismatch]
    return _share(
        "withheld: unknown, or a name that predicts as well as the oracle",
        [each.abstained for each in scores],
        0.85,
        unknown=_mean([each.unknown for each in scores]),
        noticed=len(seen),
    )


def _repaired(scores: Sequence[Score]) -> list[Row]:
    right = [each for each in scores if each.first and each.after > 0.0]
    ratios = [each.before / each.after for each in right]
    oracles = [each.before / each.oracle for each in right if each.oracle > 0.0]
    gains = [each.gain for each in scores if each.mismatch]
    others = {name: median(_rival(right, name, _ratio)) for name in _rivals(scores)}
    others |= {"oracle": median(oracles)}
    others |= {"noise_floor": median([each.before / each.floor for each in right if each.floor > 0.0])}
    others |= {"start_and_steady_wrench_fitted": median([each.retold for each in right])}
    what = "position error of held-out forecasts before over after, where named right"
    return [
        _middle(at_least, what, ratios, "1", 5.0, **others),
        _middle(at_least, "held-out gain as a share of a told oracle's, where noticed", gains, "1", 0.80),
    ]


def _ratio(score: Score, rival: str) -> float:
    after = score.rivals[rival].after
    return score.before / after if after > 0.0 else math.nan


def _placed(scores: Sequence[Score]) -> list[Row]:
    rows = []
    for effect, limit in BORDERS.items():
        found = [each.places[effect] for each in scores if effect in each.places]
        within = sum(value <= limit for value in found)
        told = {"within_it": f"{within} of {len(found)}", "share_within_it": interval(within, len(found))}
        rows.append(_middle(at_most, f"place of {effect} where it is named, off", found, "m", limit, **told))
    return rows


def _timed(scores: Sequence[Score]) -> list[Row]:
    rows = []
    for effect, what in MOMENTS.items():
        found = [each.moments[effect] for each in scores if effect in each.moments]
        rows.append(_middle(at_most, f"time of {what}, off", found, "s", 0.1))
    return rows


def _biased(scores: Sequence[Score]) -> list[Row]:
    """Return how far off parameters are of what is named right, over their true values; a recording counts once.

    What makes an effect strong has a zero that means something. That of places and angles is where an axis happens to
    begin: how far they are off over that is told beside it, as are standard deviations, which need no zero.
    """
    strengths = {column for columns in STRENGTHS.values() for column in columns}
    known = [{name.rpartition(".")[2]: off for name, off in each.bias.items()} for each in scores]
    strong = [median([abs(off[0]) for name, off in each.items() if name in strengths]) for each in known]
    every = [median([abs(off[0]) for off in each.values()]) for each in known]
    sds = [abs(off[1]) for each in known for off in each.values() if not math.isnan(off[1])]
    count = sum(not math.isnan(value) for value in strong)
    beside: dict[str, float | str] = {
        "interval": median_interval(strong),
        "all_parameters": median(every),
        "standard_deviations": median(sds),
        "share_within_two": _mean([value < 2.0 for value in sds]),
    }
    what = f"strength of what is named right, off over the true one, median of {count}"
    return [without_goal(what, median(strong), "1", **beside)]


def _localised(scores: Sequence[Score]) -> list[Row]:
    """Return F1 of ours beside every rival, and how far ours is above the best of them."""
    partly = [each for each in scores if each.share < ALWAYS]
    rows: list[Row] = []
    for kind, goal in LOCALISED.items():
        cases = [each for each in partly if not math.isnan(getattr(each.located, kind))]
        rows += _beside(f"localisation F1 ({kind}) of effects that act for part of the time", cases, kind, goal)
    everything = [each for each in scores if not math.isnan(each.located.time)]
    overlap = _average([each.located.overlap for each in partly])
    return [
        *rows,
        _beside("localisation F1 (time) of all effects", everything, "time", 0.90, overlap_of_partial=overlap)[0],
    ]


def _beside(what: str, cases: Sequence[Score], kind: str, goal: float, **more: float) -> list[Row]:
    """Return the mean of an F1 beside the rivals', and by how much it is above the best of theirs."""
    ours = [getattr(each.located, kind) for each in cases]
    theirs = {name: _rival(cases, name, _of(kind)) for name in _rivals(cases)}
    means = {name: _average(values) for name, values in theirs.items()}
    row = at_least(
        f"{what}, mean of {len(cases)}", _average(ours), "1", goal, interval=mean_interval(ours), **means, **more
    )
    best = max(means, key=means.__getitem__, default="")
    of = _of(kind)
    above = [getattr(each.located, kind) - of(each, best) for each in cases if best in each.rivals]
    told = {"interval": mean_interval(above), "best": best}
    over = f"{what}: over the best of the four beside it, mean of {len(above)}"
    return [row, at_least(over, _average(above), "1", 0.0, **told)]


def _of(kind: str) -> Callable[[Score, str], float]:
    return lambda score, rival: float(getattr(score.rivals[rival], kind))


def _rivals(scores: Sequence[Score]) -> list[str]:
    return list(dict.fromkeys(name for each in scores for name in each.rivals))


def _rival(scores: Sequence[Score], name: str, value: Callable[[Score, str], float]) -> list[float]:
    return [value(each, name) for each in scores if name in each.rivals]


def median(values: Sequence[float]) -> float:
    """Return the median of what is a number, NaN where nothing is."""
    known = [value for value in values if not math.isnan(value)]
    return float(np.median(known)) if known else math.nan


def _average(values: Sequence[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return float(np.mean(known)) if known else math.nan


def _mean(values: Sequence[bool]) -> float:
    return float(np.mean(values)) if values else math.nan


def _share(what: str, told: Sequence[bool], goal: float, **against: Any) -> Row:
    value, within = _mean(told), interval(sum(told), len(told))
    return at_least(f"{what}, share of {len(told)} recordings", value, "1", goal, interval=within, **against)
