"""Rows of benches have one form, and a number that was not measured does not hold."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from bullet_sim.catalogue import CasterSettings
from pbrl_bringup.benches.rows import Measured, at_least, at_most, last_line, report, within, without_goal
from pbrl_bringup.benches.sim import kinematics_errors, rolling_acceleration
from pbrl_bringup.commands.bench import BENCHES
from pbrl_bringup.commands.experiment import EXPERIMENTS


def measured(seed: int, quick: bool, out: Path) -> Measured:
    return Measured([at_most("error", 0.2, "m", 0.5, baseline=2.0), at_least("share", math.nan, "1", 0.9)])


def test_the_last_line_has_the_form_of_the_house(tmp_path: Path) -> None:
    summary = json.loads(last_line(report("example", 7, measured, True, tmp_path)))
    assert list(summary) == ["name", "seed", "seconds", "rows"]
    assert summary["rows"][0] == {
        "what": "error",
        "value": 0.2,
        "unit": "m",
        "goal": "<= 0.5",
        "holds": True,
        "against": {"baseline": 2.0},
    }
    written = json.loads((tmp_path / "report.json").read_text())
    assert {key: written[key] for key in summary} == summary


def test_nan_is_null_and_does_not_hold(tmp_path: Path) -> None:
    row = report("example", 7, measured, True, tmp_path)["rows"][1]
    assert (row["value"], row["holds"]) == (None, False)


@pytest.mark.parametrize(("value", "holds"), [(0.316, False), (0.314, True), (math.nan, False)])
def test_within_is_a_band(value: float, holds: bool) -> None:
    assert within("radius", value, "m", 0.300, 0.015).holds is holds


def test_what_has_nothing_to_reach_holds_where_it_was_measured() -> None:
    row = without_goal("bias", 0.3, "1", interval="0.1 to 0.4")
    assert (row.goal, row.holds, row.against) == ("none", True, {"interval": "0.1 to 0.4"})
    assert not without_goal("bias", math.nan, "1").holds


def test_every_bench_has_a_module() -> None:
    package = Path(measured.__code__.co_filename).parents[2] / "src/pbrl_bringup/pbrl_bringup"
    assert all((package / f"benches/{name.replace('-', '_')}.py").is_file() for name in BENCHES)
    assert all((package / f"experiments/{name.replace('-', '_')}.py").is_file() for name in EXPERIMENTS)


def test_the_simulated_arms_are_where_the_vectors_say() -> None:
    place, turn = kinematics_errors()
    assert place < 1e-3
    assert turn < 1e-3


def test_a_frictionless_table_obeys_newton() -> None:
    free = CasterSettings(rolling_resistance=0.0, wheel_mass=1e-9)
    assert rolling_acceleration(20.0, 40.0, free, 4) == pytest.approx(0.5)
