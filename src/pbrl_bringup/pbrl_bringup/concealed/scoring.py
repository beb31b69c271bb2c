"""How well a diagnosis found what was concealed: `report.json` against the sealed truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pbrl_bringup.concealed.truth import Truth

Interval = tuple[float, float]

ALWAYS = 0.9
"""Effects that act for more of the time than this have no time to be found."""
GRID = 0.01
"""Of the comparison of intervals [s]."""


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
        overlap: intersection over union in time, NaN where there is none to be found.
        before: held-out position error of the baseline [m].
        after: of the repair [m].
        seconds: of the diagnosis, CPU.
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

    @property
    def first(self) -> bool:
        """Tell whether what was concealed is what the report names, and nothing else before it."""
        return bool(self.effects) and set(self.named[: len(self.effects)]) == set(self.effects)

    @property
    def in_two(self) -> bool:
        """Tell whether what was concealed is among the first two, and a mismatch was seen."""
        return self.mismatch and set(self.effects) <= set(self.ranked[: max(2, len(self.effects))])


def score(case: str, truth: Truth, report: Mapping[str, Any], seal: str, seconds: float) -> Score:
    """Compare a report with the truth.

    Args:
        case: its name.
        truth: what was concealed.
        report: `report.json` of `diagnose`.
        seal: the truth's, told before.
        seconds: CPU time of the diagnosis.
    """
    found = report["objects"][truth.body]
    named = tuple(each["effect"] for each in found["effects"])
    ranked = tuple(dict.fromkeys([*named, *(each["effect"] for each in found["alternatives"])]))
    errors = found["heldout"]["rmse_position_m"]
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
    )


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def _overlap(truth: Truth, found: Sequence[Mapping[str, Any]]) -> float:
    """Return the mean intersection over union in time of effects that act for part of the time and were named."""
    values = [
        intersection_over_union(truth.when[each["effect"]], [(float(a), float(b)) for a, b in each["when"]])
        for each in found
        if each["effect"] in truth.effects and each["when"] and truth.share[each["effect"]] < ALWAYS
    ]
    return float(np.mean(values)) if values else float("nan")


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
