"""The page carries its data, needs nothing from outside, and draws without complaint in a browser."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest
from pydantic import ValidationError

from pbrl_bringup.debian import ensure_program
from pbrl_bringup.report_data import Hinge, Parameter, Report
from pbrl_bringup.report_page import number, render_page, rounded, write_page

FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update", "--enable-logging=stderr", "--v=0"),
)


def blob_of(page: str) -> str:
    found = re.search(r'<script type="application/json" id="report">(.*?)</script>', page, re.DOTALL)
    assert found
    return found.group(1)


def test_the_page_contains_its_data(report: Report) -> None:
    assert Report.model_validate_json(blob_of(render_page(report))) == report


def test_the_page_needs_nothing_from_outside(report: Report) -> None:
    page = render_page(report)
    assert "http" not in page.lower()
    assert re.findall(r'(?:src|href)="(?!data:)', page) == []
    assert "@import" not in page
    assert "url(" not in page


def test_a_name_cannot_end_the_script(report: Report) -> None:
    evil = report.model_copy(update={"title": "</script><script>alert(1)</script>"})
    page = render_page(evil)
    assert "<script>alert" not in page
    assert json.loads(blob_of(page))["title"] == evil.title


def test_the_verdict_is_on_top_and_truth_is_marked_as_such(report: Report) -> None:
    page = render_page(report)
    assert page.index(report.verdict) < page.index("<svg")
    assert "it was asked after the fit, for comparison only" in page


def test_no_truth_no_word_of_it(report: Report) -> None:
    told = report.objects[0].model_copy(update={"truth": None})
    page = render_page(report.model_copy(update={"objects": [told]}))
    assert "locked" not in re.sub(r"<script>.*</script>", "", page, flags=re.DOTALL).split('id="report"')[0]


def test_nan_becomes_null() -> None:
    made = Parameter(name="mu_x", meaning="", mean=float("nan"), sd=float("inf"), unit="1", prior="")
    assert (made.mean, made.sd) == (None, None)


def test_the_schema_refuses_what_it_does_not_know(report: Report) -> None:
    with pytest.raises(ValidationError):
        Report.model_validate({**report.model_dump(), "colour": "red"})


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "–"), (0.0, "0.0"), (31.24, "31"), (0.01234, "0.012"), (-0.5, "−0.50"), (1e-7, "1.00e−07")],
)
def test_numbers_are_written_short(value: float | None, text: str) -> None:
    assert number(value) == text


def test_a_mean_has_the_digits_of_its_spread() -> None:
    assert rounded(0.54219, 0.0093) == "0.5422"
    assert rounded(31.24, 1.9) == "31.2"


def hinged(report: Report) -> Report:
    """The report of a door whose heading was not recorded."""
    part = report.objects[0]
    flat = [(x, y, 0.0) for x, y, _ in part.episodes[0].recorded]
    episode = part.episodes[0].model_copy(update={"recorded": flat, "wrench": [(1.0, 2.0, 0.0)] * len(flat)})
    hinge = Hinge(
        draws=[(0.5, 0.4, 0.3), (0.51, 0.4, 0.31)], mean=(0.505, 0.4, 0.305), ellipse=[(0.5, 0.4), (0.51, 0.4)]
    )
    door = part.model_copy(update={"wheel": None, "truth": None, "hinge": hinge, "episodes": [episode]})
    return report.model_copy(update={"objects": [door]})


def test_of_a_door_the_hinge_is_drawn_and_no_turn_that_nobody_saw(report: Report, tmp_path: Path) -> None:
    dom = drawn_page(hinged(report), tmp_path)
    assert "hinge, radius 30.5 cm" in dom
    assert "turns here" in dom
    assert ">turned<" not in dom
    assert "it has turned by" not in dom.split("<script")[0]
    assert dom.count('class="after trail"') == 2, "the circle about the hinge, in both pictures"


def test_the_page_draws_in_a_browser_without_complaint(report: Report, tmp_path: Path) -> None:
    dom = drawn_page(report, tmp_path)
    drawn = re.findall(r'<path class="([a-z ]+)" d="(M[^"]+)"', dom)
    assert {"recorded body", "before", "after", "draw", "cursor", "ellipse", "truthmark"} <= {kind for kind, _ in drawn}
    assert not [data for _, data in drawn if "NaN" in data or "Infinity" in data]
    assert 'class="dot"' in dom
    assert "prediction before learning off by" in dom


def drawn_page(report: Report, tmp_path: Path) -> str:
    """Open a page in a browser, which must not complain; return what its scripts made of it."""
    page = tmp_path / "report.html"
    write_page(report, page)
    browser = ensure_program("chromium", "chromium", "the test of the report page")
    profile = f"--user-data-dir={tmp_path / 'profile'}"
    result = subprocess.run(
        [browser, *FLAGS, profile, "--dump-dom", page.as_uri()], capture_output=True, text=True, timeout=120, check=True
    )
    assert "CONSOLE" not in result.stderr
    return result.stdout
