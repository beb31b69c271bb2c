"""`diagnose` of a real door: report, page and what the terminal says."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from pbrl_bringup.benches.cabinet import data_file
from pbrl_bringup.cli.app import run_arguments
from pbrl_bringup.paths import config_file


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("door")
    mapping = str(config_file("mappings", "pr2_cabinet"))
    bag = str(data_file("pr2_cabinet/lab_cabinet.csv"))
    assert run_arguments(["diagnose", bag, "--map", mapping, "--baseline", "hinge", "--out", str(folder)]) == 0
    return folder


def test_the_catch_of_a_real_door_is_named_where_its_force_peaks(out: Path) -> None:
    report = json.loads((out / "report.json").read_text())
    door = report["objects"]["door"]
    named = {each["effect"]: each for each in door["effects"]}
    assert door["mismatch"] and not door["unknown"] and "detent" in named
    angle = named["detent"]["parameters"]["detent_angle"]
    assert angle["unit"] == "rad" and abs(angle["mean"] - door["hinge"]["largest_force_angle_rad"]) < math.radians(3.0)
    force = door["heldout"]["rmse_force_N"]
    assert force["repaired"] < 0.5 * force["baseline"]
    rest = door["heldout"]["rest_from_beginning_N"]
    assert rest["repaired"] < 0.5 * rest["baseline"]
    assert named["detent"]["where"]["frame"] == "joint"


def test_the_page_stands_alone_and_says_what_was_found(out: Path) -> None:
    page = (out / "report.html").read_text()
    assert "detent at 2.9" in page and page.count("<svg") == 4
    assert 'src="' not in page and "https://" not in page.replace("https://matplotlib.org", "")


@pytest.mark.parametrize("option", [("--most-together", "1"), ("--mass-spread", "0.2")])
def test_an_option_that_says_nothing_of_a_door_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], option: tuple[str, str]
) -> None:
    mapping = str(config_file("mappings", "pr2_cabinet"))
    bag = str(data_file("pr2_cabinet/lab_cabinet.csv"))
    assert run_arguments(["diagnose", bag, "--map", mapping, "--out", str(tmp_path / "found"), *option]) != 0
    assert f"expected no {option[0]} of a recording of nothing but a path" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "found").exists()
