"""The acceptance rows of `bench concealed`, by set, shares with exact intervals and rivals beside ours."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.stats import beta, kstest

from pbrl_bringup.benches.rows import Row, at_least, at_most
from pbrl_bringup.concealed.scoring import ALWAYS, Score

STRONG = 3.0
"""Times the strength that a told oracle detects in 95 %."""
BORDERS = {"floor_patch": 0.05, "hidden_obstacle": 0.05, "second_wheel": 0.05, "hidden_hinge": 0.05, "tether": 0.10}
"""How far off a place may be [m]."""
MOMENTS = {"payload_change": "load change", "unseen_body": "first contact with an unseen body"}
GOALS = {"single": (0.90, 0.97), "rough": (0.85, 0.95)}
"""Shares of first and among the first two, by set."""
LOCALISED = {"time": 0.90, "region": 0.90, "regime": 0.90}


def rows_of(scores: Sequence[Score]) -> list[Row]:
    """Return the rows of every set that was run."""
    by_set = {name: [each for each in scores if each.set == name] for name in dict.fromkeys(s.set for s in scores)}
    rows: list[Row] = []
    if by_set.get("clean"):
        rows.append(_alarms(by_set["clean"]))
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
        rows.append(_share("pairs: both effects named, and nothing before them", told, 0.70))
    if by_set.get("withheld"):
        rows.append(_withheld(by_set["withheld"]))
    hidden = by_set.get("single", [])
    if hidden:
        rows += [*_repaired(hidden), *_placed(hidden), *_timed(hidden), *_localised(hidden)]
    spent = [each.seconds for each in scores if not math.isnan(each.seconds)]
    failed = sum(bool(each.failed) for each in scores)
    return [*rows, at_most("CPU time of a diagnosis, median", _median(spent), "s", 60.0, ended_with_an_error=failed)]


def interval(hits: int, count: int, level: float = 0.95) -> str:
    """Return the exact (Clopper-Pearson) interval of a share."""
    if count == 0:
        return "0 to 1"
    tail = (1.0 - level) / 2.0
    low = 0.0 if hits == 0 else float(beta.ppf(tail, hits, count - hits + 1))
    high = 1.0 if hits == count else float(beta.ppf(1.0 - tail, hits + 1, count - hits))
    return f"{low:.3f} to {high:.3f}"


def _alarms(clean: Sequence[Score]) -> Row:
    alarms = sum(each.mismatch for each in clean)
    known = [each.p_value for each in clean if not math.isnan(each.p_value)]
    return at_most(
        f"false alarms on {len(clean)} clean recordings at the 5 % level, share",
        alarms / len(clean),
        "1",
        0.05,
        interval=interval(alarms, len(clean)),
        p_of_uniform_p_values=float(kstest(known, "uniform").pvalue) if len(known) > 1 else math.nan,
    )


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
    gains = [each.gain for each in scores if each.mismatch and not math.isnan(each.gain)]
    return [
        at_least(
            "held-out position error before over after, median of the cases named right",
            _median(ratios),
            "1",
            5.0,
            cases=len(ratios),
            oracle=_median(oracles),
            noise_floor=_median([each.before / each.floor for each in right if each.floor > 0.0]),
            **{name: _median(_rival(right, name, _ratio)) for name in _rivals(scores)},
        ),
        at_least(
            "held-out gain as a share of a told oracle's, median of the cases noticed",
            _median(gains),
            "1",
            0.80,
            cases=len(gains),
        ),
    ]


def _ratio(score: Score, rival: str) -> float:
    after = score.rivals[rival].after
    return score.before / after if after > 0.0 else math.nan


def _placed(scores: Sequence[Score]) -> list[Row]:
    rows = []
    for effect, limit in BORDERS.items():
        found = [each.places[effect] for each in scores if effect in each.places]
        within = sum(value <= limit for value in found)
        what = f"place of {effect} where it is named, median off"
        rows.append(at_most(what, _median(found), "m", limit, cases=len(found), within_it=interval(within, len(found))))
    return rows


def _timed(scores: Sequence[Score]) -> list[Row]:
    rows = []
    for effect, what in MOMENTS.items():
        found = [each.moments[effect] for each in scores if effect in each.moments]
        rows.append(at_most(f"time of {what}, median off", _median(found), "s", 0.1, cases=len(found)))
    return rows


def _localised(scores: Sequence[Score]) -> list[Row]:
    """Return F1 of ours beside every rival, and how far ours is above the best of them."""
    partly = [each for each in scores if each.share < ALWAYS and not each.failed]
    rows: list[Row] = []
    for kind, goal in LOCALISED.items():
        cases = [each for each in partly if not math.isnan(getattr(each.located, kind))]
        ours = _average([getattr(each.located, kind) for each in cases])
        others = {name: _average(_rival(cases, name, _of(kind))) for name in _rivals(scores)}
        what = f"localisation F1 ({kind}) of effects that act for part of the time, mean"
        rows.append(at_least(what, ours, "1", goal, cases=len(cases), **others))
        best = max(others.values(), default=math.nan)
        rows.append(at_least(f"localisation F1 ({kind}) over the best of the four beside it", ours - best, "1", 0.0))
    everything = [each for each in scores if not math.isnan(each.located.time)]
    others = {name: _average(_rival(everything, name, _of("time"))) for name in _rivals(scores)}
    ours = _average([each.located.time for each in everything])
    rows.append(
        at_least("localisation F1 (time) of all effects, mean", ours, "1", 0.90, cases=len(everything), **others)
    )
    return rows


def _of(kind: str) -> Callable[[Score, str], float]:
    return lambda score, rival: float(getattr(score.rivals[rival], kind))


def _rivals(scores: Sequence[Score]) -> list[str]:
    return list(dict.fromkeys(name for each in scores for name in each.rivals))


def _rival(scores: Sequence[Score], name: str, value: Callable[[Score, str], float]) -> list[float]:
    return [value(each, name) for each in scores if name in each.rivals]


def _median(values: Sequence[float]) -> float:
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
