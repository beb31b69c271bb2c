"""The page of a diagnosis replays what the saved model simulates, and does what keys and buttons ask."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pbrl_bringup.debian import ensure_program
from pbrl_bringup.diagnosis import page as page_module
from pbrl_bringup.diagnosis.figures import frames
from pbrl_bringup.diagnosis.models import write_models
from pbrl_bringup.diagnosis.page import render_diagnosis
from pbrl_bringup.diagnosis.replay import replay_of
from pbrl_bringup.diagnosis.told import experiment, forecast_caution, sentences
from pbrl_mismatch import EFFECTS, DiagnoseOptions, diagnose
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.repaired import load_repaired, simulate_recorded

sys.path.insert(0, str(Path(__file__).parents[1] / "pbrl_mismatch"))
from concealed_cases import make_case

OPTIONS = DiagnoseOptions(
    without=tuple(name for name in EFFECTS if name != "tether"),
    baseline=("free",),
    windows=(1.0, 2.0),
    keep=(4, 2),
    iterations=(4, 8),
    survivors=(2,),
    draws=120,
    most_together=1,
    workers=1,
)
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update", "--enable-logging=stderr", "--v=0"),
)
DRIVER = """<script>
const log = [], find = (s) => document.querySelector(s), slider = find("input[type=range]");
const at = () => Number(slider.getAttribute("aria-valuetext").split(" ")[0]);
const key = (name, more) => document.dispatchEvent(new KeyboardEvent("keydown", { key: name, bubbles: true, ...more }));
const shape = (s) => find(s).getAttribute("d");
const note = (what, value) => log.push([what, value]);
key("Home"); note("home", at()); note("start", shape(".recording .body"));
key("ArrowRight"); note("step", at());
key("ArrowRight", { shiftKey: true }); note("leap", at());
key("ArrowLeft"); note("back", at());
slider.value = 500; slider.dispatchEvent(new Event("input")); note("half", at());
note("moved", shape(".recording .body")); note("true", shape(".simulation .after:not(.trail)"));
find(".enlarge").click(); note("larger", shape(".simulation .after:not(.trail)")); find(".enlarge").click();
note("said", find(".now").textContent);
note("doubted", document.querySelectorAll(".strip .unbelieved").length);
key("End"); note("end", at());
note("wide", document.documentElement.scrollWidth <= innerWidth);
key("Home"); key(" "); note("playing", find(".play").getAttribute("aria-label"));
setTimeout(() => { note("later", at()); find(".play").click(); note("paused", find(".play").getAttribute("aria-label"));
  const stood = at(); setTimeout(() => { note("stood", at() === stood);
    document.body.setAttribute("data-log", JSON.stringify(log)); }, 300); }, 1000);
</script>"""


@pytest.fixture(scope="module")
def diagnosed() -> Any:
    recording = make_case("tether", 5)
    return recording, diagnose(recording, OPTIONS)


@pytest.fixture(scope="module")
def page(diagnosed: Any) -> str:
    recording, found = diagnosed
    return render_diagnosis(
        found, recording, "./pbrl diagnose bag", options=OPTIONS, models={"table": "model_table.json"}
    )


def test_the_page_shows_what_the_saved_model_simulates(diagnosed: Any, tmp_path: Path) -> None:
    recording, found = diagnosed
    table = found.objects["table"]
    assert [each.effect for each in table.effects] == ["tether"]
    files = write_models(found, tmp_path, seed=0)
    model = load_repaired(tmp_path / files["table"])
    track = table.baseline.peak.objective.cuts.track
    cuts = cut_windows(track, OPTIONS.block)
    shown = replay_of(recording, table, OPTIONS)
    seen = cuts.weight[..., :2].min(axis=2) > 0.0
    assert np.array_equal(shown.after, simulate_recorded(model, cuts)[seen])
    assert (tmp_path / files["table"]).read_bytes() == _again(found, tmp_path / "again")


def _again(found: Any, folder: Path) -> bytes:
    return (folder / write_models(found, folder, seed=0)["table"]).read_bytes()


def test_every_stretch_begins_where_the_recording_was(diagnosed: Any) -> None:
    recording, found = diagnosed
    shown = replay_of(recording, found.objects["table"], OPTIONS)
    starts = np.flatnonzero(np.diff(shown.stretch, prepend=-1))
    assert len(starts) >= 6 and np.all(np.diff(shown.time) > 0.0)
    off = np.hypot(*(shown.before - shown.recorded)[starts, :2].T)
    assert np.median(off) < 2.0 * shown.noise
    assert shown.after is not None
    assert (
        np.hypot(*(shown.after - shown.recorded)[:, :2].T).mean()
        < np.hypot(*(shown.before - shown.recorded)[:, :2].T).mean()
    )


def test_the_page_is_one_small_file(page: str) -> None:
    assert len(page.encode()) < 2_000_000
    assert re.findall(r'(?:src|href)="(?!data:)', page.replace('xlink:href="#', "")) == []
    assert "@import" not in page and "fetch(" not in page
    assert page.count('type="range"') == 1 and "model_table.json" in page
    assert page.index("tether is left out") < page.index('class="replay"') < page.index("<b>What.</b>")


def test_the_replay_obeys(page: str, tmp_path: Path) -> None:
    log = dict(driven(page, tmp_path))
    assert log["home"] == 0.0 and log["step"] == 0.1 and log["leap"] == 1.1 and log["back"] == 1.0
    assert log["half"] == pytest.approx(0.5 * log["end"], abs=0.06) and log["end"] > 20.0
    assert log["start"] != log["moved"] and log["true"] != log["larger"]
    assert "before the repair" in log["said"] and "repaired" in log["said"]
    assert log["doubted"] == 0
    assert log["playing"] == "pause" and log["paused"] == "play"
    assert 0.3 < log["later"] < 3.0 and log["stood"]
    assert log["wide"], "nothing sticks out of the window"
    assert not any("NaN" in str(value) for value in log.values())


def test_what_is_not_believed_is_shown_and_said(page: str, tmp_path: Path) -> None:
    assert "not to be believed" not in page
    doubted = page.replace('"unbelieved":[]', '"unbelieved":[[0.0,60.0,"the tag was lost"]]')
    log = dict(driven(doubted, tmp_path))
    assert log["doubted"] == 1 and "Left out now: the tag was lost." in log["said"]


def test_a_reader_is_told_of_a_repair_that_forecasts_worse() -> None:
    def report(before: float | None, after: float | None) -> dict[str, Any]:
        return {"heldout": {"rmse_position_m": {"baseline": before, "repaired": after}}}

    assert forecast_caution({}) == forecast_caution(report(None, None)) == forecast_caution(report(0.02, 0.021)) == ""
    assert "2.5 times as far off" in forecast_caution(report(0.02, 0.05))


def test_an_outline_of_a_thousand_corners_is_drawn(
    diagnosed: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording, found = diagnosed
    angle = np.linspace(0.0, 2.0 * np.pi, 1000, endpoint=False)
    outline = 0.5 * np.column_stack([np.cos(angle), np.sin(angle)])
    monkeypatch.setattr(page_module, "replay_of", lambda *told: replace(replay_of(*told), outline=outline))
    driven(render_diagnosis(found, recording, "./pbrl diagnose bag", options=OPTIONS), tmp_path)


def test_where_nothing_was_held_out_no_forecast_is_shown(
    diagnosed: Any, page: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording, found = diagnosed
    monkeypatch.setattr(page_module, "replay_of", lambda *told: replace(replay_of(*told), held_out=()))
    bare = render_diagnosis(found, recording, "./pbrl diagnose bag", options=OPTIONS)
    shown = ("held out for the score", "fitted again without the shaded stretches", "Forecasts of stretches")
    assert all(each in page and each not in bare for each in shown)
    assert "no push lasts long enough" in bare and "no push lasts long enough" not in page
    assert bare.count("<svg") == page.count("<svg") - 1


def test_the_key_of_the_arrows_lies_on_the_page(page: str) -> None:
    key = page[: page.index("N left out")]
    height = float(re.findall(r'viewBox="0 0 [\d.]+ ([\d.]+)"', key)[-1])
    corners = re.findall(
        r"[ML] [-\d.]+ ([-\d.]+)", key[key.rindex("PolyCollection") :].partition("</path>")[0].partition("/>")[0]
    )
    assert len(corners) > 4 and all(0.0 < float(y) < height for y in corners)


def test_the_floor_has_the_object_where_its_own_frame_is() -> None:
    way = np.array([[1.0, 2.0, 0.0], [1.5, 2.5, 0.5 * np.pi]])
    found: Any = SimpleNamespace(
        residual=SimpleNamespace(path=np.hstack([way, np.zeros((2, 3))])),
        baseline=SimpleNamespace(
            peak=SimpleNamespace(
                objective=SimpleNamespace(
                    cuts=SimpleNamespace(track=SimpleNamespace(body=np.array([20.0, 0.5, 0.1, 2.0])))
                )
            )
        ),
    )
    assert frames(found) == pytest.approx(np.array([[0.5, 1.9, 0.0], [1.6, 2.0, 0.5 * np.pi]]))


def driven(page: str, tmp_path: Path) -> list[Any]:
    """Open the page in a browser, press its keys and buttons, and return what was noted."""
    file = tmp_path / "page.html"
    file.write_text(page.replace("</body>", DRIVER + "</body>"))
    browser = ensure_program("chromium", "chromium", "the test of the diagnosis page")
    command = [browser, *FLAGS, f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=5000"]
    result = subprocess.run(
        [*command, "--dump-dom", file.as_uri()], capture_output=True, text=True, timeout=120, check=True
    )
    assert "CONSOLE" not in result.stderr, result.stderr
    found = re.search(r'data-log="([^"]*)"', result.stdout)
    assert found, "the page's script did not come to its end"
    return list(json.loads(found.group(1).replace("&quot;", '"')))


def test_what_is_told_is_said_in_words() -> None:
    push = {"object": "table", "contact_point": [0.3, -0.2], "direction": [0.0, 1.0], "speed": 0.1, "duration": 4.0}
    assert experiment({**push, "expected_bits": 1.3}) == (
        "Hold the table at (0.30, -0.20) m of its own frame and push towards 90° with 0.1 m/s for 4 s; it is expected "
        "to tell 1.3 bits."
    )
    weak = {"effect": "detent", "smallest": 2.5, "unit": "N", "chance": 0.4, "motion": "Go through the place slowly."}
    assert sentences([weak, "a sentence"]) == [
        "detent: weaker than about 2.5 N it would not have shown. Go through the place slowly.",
        "a sentence",
    ]
    assert sentences([{**weak, "smallest": None, "chance": 0.0}])[0].startswith("detent: nowhere would it have shown")
    assert sentences({"sentences": ["It grows."], "notes": ["few"], "terms": []}) == ["It grows.", "Mind: few"]
    assert sentences({"terms": {"speed": 0.12345}}) == ["terms: speed 0.123"]
    assert sentences([str(k) for k in range(30)])[-1] == "and 6 more, see report.json"
