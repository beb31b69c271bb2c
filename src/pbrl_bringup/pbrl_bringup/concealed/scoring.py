"""How well a diagnosis found what was concealed: `report.json` against the sealed truth."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_bringup.concealed.localisation import REGIONS, Localised, claimed_by_report, localise
from pbrl_bringup.concealed.places import moment_error, parameter_bias, place_error
from pbrl_bringup.concealed.truth import Truth
from pbrl_bringup.rivals.samples import Interval, Regimes, Samples

Array = NDArray[np.float64]

ALWAYS = 0.9
"""Effects that act for more of the time than this have no time to be found."""
GRID = 0.01
"""Of the comparison of intervals [s]."""
AS_GOOD = 1.1
"""A name predicts as well as the oracle where its error is at most so many times the oracle's."""


@dataclass(frozen=True)
class Oracle:
    """What a told oracle reaches.

    Attributes:
        error: held-out position error [m].
        gain: log evidence over the baseline's [nat].
        times: strength over what it detects in 95 % of recordings, of several effects the faintest's beside the others.
    """

    error: float = math.nan
    gain: float = math.nan
    times: float = math.nan


@dataclass(frozen=True)
class Comparison:
    """What a recording is compared on: its samples, their regimes, and the outline (k, 2) of the object [m]."""

    samples: Samples
    regimes: Regimes
    outline: Array


@dataclass(frozen=True)
class RivalScore:
    """One rival on one recording; the fields of `Localised`, held-out error [m] and CPU seconds."""

    time: float
    region: float
    regime: float
    overlap: float
    after: float
    seconds: float


@dataclass(frozen=True)
class Score:
    """One recording.

    Attributes:
        case: its name.
        effects: what was concealed.
        strength: 0 to 1.
        seal: SHA-256 of the truth, as told before the diagnosis.
        mismatch: whether the diagnosis saw any.
        p_value: of the baseline.
        named: effects of the report, likeliest first.
        ranked: those and the alternatives, each once.
        unknown: whether it said so.
        overlap: intersection over union in time of effects that act in part of it, NaN where there is none to be found.
        before: position error of the baseline's forecasts of what was held out [m].
        after: of the repair [m].
        retold: error of the baseline over the repair's where windows' starts and a steady wrench are fitted to them.
        seconds: of the diagnosis, CPU.
        set: of cases.
        withheld: effects that the library did without.
        share: of the time in which the object moved that the effects acted, the least of them.
        floor: noise of a pose in position [m].
        oracle: held-out position error of a told oracle [m], NaN where none was asked.
        oracle_gain: of the oracle over the baseline [nat].
        times_detectable: strength over what a told oracle detects in 95 % of recordings, NaN where none was asked; of
            several effects the faintest's beside the others.
        located: how well it was localised; NaN on clean recordings.
        places: how far off in place [m], by effect that is named right and has one.
        moments: how far off in the moment at which it began [s], likewise.
        bias: parameters' means over the truth, and in standard deviations, by `effect.parameter`.
        rivals: by name.
        failed: one line, where the diagnosis ended with an error; it then counts as having found nothing.
    """

    case: str
    effects: tuple[str, ...]
    strength: float
    seal: str
    mismatch: bool
    p_value: float
    named: tuple[str, ...]
    ranked: tuple[str, ...]
    unknown: bool
    overlap: float
    before: float
    after: float
    seconds: float
    set: str = ""
    withheld: tuple[str, ...] = ()
    share: float = 1.0
    floor: float = math.nan
    oracle: float = math.nan
    oracle_gain: float = math.nan
    times_detectable: float = math.nan
    located: Localised = field(default_factory=lambda: Localised(*(math.nan,) * 4))
    places: dict[str, float] = field(default_factory=dict)
    moments: dict[str, float] = field(default_factory=dict)
    bias: dict[str, tuple[float, float]] = field(default_factory=dict)
    rivals: dict[str, RivalScore] = field(default_factory=dict)
    retold: float = math.nan
    failed: str = ""

    @property
    def first(self) -> bool:
        """Tell whether what was concealed is what the report names, and nothing else before it."""
        return bool(self.effects) and set(self.named[: len(self.effects)]) == set(self.effects)

    @property
    def in_two(self) -> bool:
        """Tell whether what was concealed is among the first two, and a mismatch was seen."""
        return self.mismatch and set(self.effects) <= set(self.ranked[: max(2, len(self.effects))])

    @property
    def in_three(self) -> bool:
        """Tell whether what was concealed is among the first three, and a mismatch was seen."""
        return self.mismatch and set(self.effects) <= set(self.ranked[: max(3, len(self.effects))])

    @property
    def gain(self) -> float:
        """Return what the repair gains of the held-out error, as a share of what the oracle gains; NaN without one."""
        possible = self.before - self.oracle
        return (self.before - self.after) / possible if possible > 0.0 else math.nan

    @property
    def abstained(self) -> bool:
        """Tell whether, the true effect withheld, it said unknown, or named what predicts as well as the oracle."""
        as_good = bool(self.named) and self.after <= AS_GOOD * self.oracle
        return (self.unknown and not self.named) or as_good


def score(
    case: str,
    truth: Truth,
    report: Mapping[str, Any],
    seal: str,
    seconds: float,
    *,
    comparison: Comparison | None = None,
    oracle: Oracle | None = None,
    claims: Sequence[Mapping[str, Any]] = (),
    group: str = "",
    withheld: tuple[str, ...] = (),
) -> Score:
    """Compare a report with the truth.

    Args:
        case: its name.
        truth: what was concealed.
        report: `report.json` of `diagnose`.
        seal: the truth's, told before.
        seconds: CPU time of the diagnosis.
        comparison: what places and times are compared on; None: they are not.
        oracle: what a told oracle reaches; None: it was not asked.
        claims: of the rivals, as `rivals.run` writes them.
        group: the set that the case belongs to.
        withheld: effects that the library did without.
    """
    found = report["objects"][truth.body]
    named = tuple(each["effect"] for each in found["effects"])
    ranked = tuple(dict.fromkeys([*named, *(each["effect"] for each in found["alternatives"])]))
    errors = found["heldout"]["rmse_position_m"]
    retold = [_number(found["heldout"]["rmse_position_retold_m"][which]) for which in ("baseline", "repaired")]
    told = oracle or Oracle()
    right = {each["effect"]: each for each in found["effects"] if each["effect"] in truth.effects}
    return Score(
        case,
        truth.effects,
        truth.strength,
        seal,
        bool(found["mismatch"]),
        float(found["p_value"]),
        named,
        ranked,
        bool(found["unknown"]),
        _overlap(truth, found["effects"]),
        _number(errors["baseline"]),
        _number(errors["repaired"]),
        seconds,
        set=group,
        withheld=withheld,
        share=min(truth.share.values(), default=1.0),
        floor=_number(errors["noise_floor"]),
        oracle=told.error,
        oracle_gain=told.gain,
        times_detectable=told.times,
        located=_located(truth, found, comparison),
        places={} if comparison is None else _places(truth, right, comparison),
        moments=_numbers({name: moment_error(name, truth, each) for name, each in right.items()}),
        bias={f"{n}.{p}": off for n, each in right.items() for p, off in parameter_bias(truth, each).items()},
        rivals={} if comparison is None else {each["rival"]: rival_score(truth, comparison, each) for each in claims},
        retold=retold[0] / retold[1] if retold[1] > 0.0 else math.nan,
    )


def failed_score(case: str, truth: Truth, seal: str, why: str, group: str, withheld: tuple[str, ...]) -> Score:
    """Return the score of a diagnosis that ended with an error: nothing was found, and nothing was claimed."""
    missed = Localised(*(0.0 if truth.effects else math.nan,) * 4)
    return Score(
        case,
        truth.effects,
        truth.strength,
        seal,
        mismatch=False,
        p_value=math.nan,
        named=(),
        ranked=(),
        unknown=False,
        overlap=math.nan,
        before=math.nan,
        after=math.nan,
        seconds=math.nan,
        set=group,
        withheld=withheld,
        share=min(truth.share.values(), default=1.0),
        located=missed if REGIONS & set(truth.effects) else replace(missed, region=math.nan),
        failed=why,
    )


def rival_score(truth: Truth, comparison: Comparison, claim: Mapping[str, Any]) -> RivalScore:
    """Compare one rival's claim with the truth; what it cannot say it cannot get right."""
    claimed = comparison.samples.inside([(float(a), float(b)) for a, b in claim["when"]])
    at = localise(truth, comparison.samples, comparison.regimes, claimed, (), claim["regimes"])
    return RivalScore(at.time, at.region, at.regime, at.overlap, _number(claim["heldout"]), _number(claim["seconds"]))


def _located(truth: Truth, found: Mapping[str, Any], comparison: Comparison | None) -> Localised:
    if comparison is None:
        return Localised(*(math.nan,) * 4)
    claimed, outlines = claimed_by_report(found, comparison.samples)
    return localise(truth, comparison.samples, comparison.regimes, claimed, outlines)


def _places(truth: Truth, right: Mapping[str, Mapping[str, Any]], comparison: Comparison) -> dict[str, float]:
    return _numbers(
        {name: place_error(name, truth, each, comparison.samples, comparison.outline) for name, each in right.items()}
    )


def _numbers(values: Mapping[str, float]) -> dict[str, float]:
    """Return only what is a number."""
    return {name: value for name, value in values.items() if not math.isnan(value)}


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _overlap(truth: Truth, found: Sequence[Mapping[str, Any]]) -> float:
    """Return the mean intersection over union in time of effects that act for part of the time and were named."""
    values = [
        intersection_over_union(truth.when[each["effect"]], [(float(a), float(b)) for a, b in each["when"]])
        for each in found
        if each["effect"] in truth.effects and each["when"] and truth.share[each["effect"]] < ALWAYS
    ]
    return float(np.mean(values)) if values else math.nan


def intersection_over_union(one: Sequence[Interval], other: Sequence[Interval]) -> float:
    """Return the share of the time in either set of intervals that is in both; 0 where both are empty."""
    edges = [edge for interval in (*one, *other) for edge in interval]
    if not edges:
        return 0.0
    time = np.arange(min(edges), max(edges) + GRID, GRID)
    inside = [
        np.any([(time >= a) & (time <= b) for a, b in each] or [np.zeros_like(time, bool)], axis=0)
        for each in (one, other)
    ]
    either = np.logical_or(*inside).sum()
    return float(np.logical_and(*inside).sum() / either) if either else 0.0


def read_score(told: Mapping[str, Any]) -> Score:
    """Return a score from what `asdict` made of it and JSON left of that: NaN is null, tuples are lists."""
    values = {each.name: told[each.name] for each in fields(Score) if each.name in told}
    for name, value in values.items():
        values[name] = tuple(value) if isinstance(value, list) else math.nan if value is None else value
    values["located"] = Localised(**{name: _number(value) for name, value in values["located"].items()})
    values["rivals"] = {
        rival: RivalScore(**{name: _number(value) for name, value in each.items()})
        for rival, each in values["rivals"].items()
    }
    for name in ("places", "moments"):  # a place that was missed altogether is infinitely far off, and JSON has no such
        values[name] = {effect: math.inf if off is None else off for effect, off in values[name].items()}
    values["bias"] = {name: (_number(a), _number(b)) for name, (a, b) in values["bias"].items()}
    return Score(**values)
