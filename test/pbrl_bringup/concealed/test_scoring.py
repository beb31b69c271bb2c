"""Scores of a diagnosis: closed forms, and reports made by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from scipy.stats import binomtest

from pbrl_bringup.benches.concealed import confusion, interval, rows_of
from pbrl_bringup.concealed.scoring import Score, intersection_over_union, score
from pbrl_bringup.concealed.truth import Truth

TRUTH = Truth(("tether",), "table", {}, {"tether": [(2.0, 4.0)]}, {"tether": []}, 0.7, {"tether": 0.3})


def report(named: list[str], others: list[str], when: list[list[float]] | None = None, **more: Any) -> dict[str, Any]:
    entries = [{"effect": name, "probability": 0.5, "when": when} for name in named]
    told = {
        "mismatch": bool(named or others),
        "p_value": 0.001,
        "effects": entries,
        "alternatives": [{"effect": name, "probability": 0.1, "when": None} for name in others],
        "unknown": False,
        "heldout": {"rmse_position_m": {"baseline": 0.05, "repaired": 0.01, "noise_floor": None}},
    }
    return {"objects": {"table": told | more}}


def scored(named: list[str], others: list[str], **more: Any) -> Score:
    return score("one", TRUTH, report(named, others, **more), TRUTH.seal(), 3.0)


@pytest.mark.parametrize(
    ("named", "others", "first", "in_two"),
    [
        (["tether"], [], True, True),
        (["detent"], ["tether"], False, True),
        (["detent"], ["sloshing_load", "tether"], False, False),
        ([], ["tether"], False, True),
        ([], [], False, False),
    ],
)
def test_named_first_and_among_two(named: list[str], others: list[str], first: bool, in_two: bool) -> None:
    found = scored(named, others)
    assert (found.first, found.in_two) == (first, in_two)


def test_overlap_in_time() -> None:
    assert intersection_over_union([(0.0, 1.0)], [(0.5, 1.5)]) == pytest.approx(1 / 3, abs=0.02)
    assert intersection_over_union([(0.0, 1.0)], [(0.0, 1.0)]) == 1.0
    assert intersection_over_union([(0.0, 1.0)], [(2.0, 3.0)]) == 0.0
    assert intersection_over_union([], []) == 0.0
    assert scored(["tether"], [], when=[[3.0, 4.0]]).overlap == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize(("hits", "count"), [(0, 10), (3, 10), (10, 10)])
def test_intervals_are_exact(hits: int, count: int) -> None:
    found = binomtest(hits, count).proportion_ci(0.95, method="exact")
    assert interval(hits, count) == f"{found.low:.3f} to {found.high:.3f}"
    assert interval(0, 0) == "0 to 1"


def test_rows_and_figure(tmp_path: Path) -> None:
    clean = Truth((), "table", {}, {}, {}, 0.0, {})
    silent = score("clean", clean, report([], [], p_value=0.4), clean.seal(), 2.0)
    alarm = score("clean2", clean, report(["detent"], []), clean.seal(), 2.0)
    scores = [silent, alarm, scored(["tether"], []), scored(["detent"], ["tether"])]
    rows = {row.what.split(",")[0]: row for row in rows_of(scores)}
    assert rows["false alarms on 2 clean recordings at the 5 % level"].value == 0.5
    assert rows["effect named first"].value == 0.5
    assert rows["effect among the first two"].value == 1.0
    assert rows["held-out position error before over after"].value == pytest.approx(5.0)
    confusion(scores).savefig(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 10_000
