"""The page in a headless Chromium, with real clicks, keys, wheel turns and dragging: it shows what was recorded."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrl_bringup.browser import Browser
from pbrl_bringup.view.bag import BagSource
from pbrl_bringup.view.decorate import decorated
from pbrl_bringup.view.diagnosed import Diagnosed, Found, Lacking
from pbrl_bringup.view.extras import Extras
from pbrl_bringup.view.models import told_model
from pbrl_bringup.view.server import make_app
from pbrl_bringup.view.shown import Shown, shown_of

sys.path.insert(0, str(Path(__file__).parent))
from view_kit import EVIL, recorded, serving

PICTURE = "performance.getEntriesByName('first-picture').length"
SLIDER, SCENE, CURVE = "#player input", "#scene", "[data-plot=wrenches-0-0]"
NEXT = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))"


def everything() -> Shown:
    """A recording under a hostile name, with a model, regions and residuals."""
    draws = np.random.default_rng(0).normal([0.5, 0.3], 0.02, (200, 2))
    model = told_model("wheel", [("mass", 30.0, 1.0, "kg")], {"wheel_x": draws[:, 0], "wheel_y": draws[:, 1]})
    where = {"frame": "world", "shape": [[1, 1], [2, 1], [2, 2]], "uncertainty": [[1.4, 1.4], [1.6, 1.4], [1.5, 1.6]]}
    named = {"effect": EVIL, "probability": 0.9, "where": where, "when": [[104.0, 106.0]]}
    time = tuple((100.0 + np.arange(0.0, 12.0, 0.1)).tolist())
    lacking = Lacking(time=time, wrench=((0.0, 8.0, 1.0),) * len(time), sd=((1.0, 1.0, 1.0),) * len(time))
    found = Diagnosed({EVIL: Found.model_validate({"mismatch": True, "effects": [named]})}, {EVIL: lacking})
    return decorated(shown_of(recorded(EVIL), EVIL), Extras(), {EVIL: model}, found)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with Browser() as one:
        yield one


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with serving(make_app(BagSource(everything()))) as found:
        yield found


@pytest.fixture
def page(browser: Browser, address: str) -> Iterator[Browser]:
    """The page, just opened; afterwards it has nothing to complain of."""
    browser.complaints.clear()
    browser.open(address)
    browser.wait(PICTURE)
    yield browser
    assert browser.complaints == []


def clock(page: Browser) -> float:
    page.run(NEXT)
    return float(page.run("document.querySelector('.clock').textContent").split()[0])


def body(page: Browser, number: int) -> tuple[float, ...]:
    text = page.run(f"document.querySelectorAll('.body')[{number}].getAttribute('transform')")
    return tuple(map(float, re.findall(r"-?[\d.]+", text)))


def shown_span(page: Browser) -> float:
    """Seconds from the first to the last mark of the time axis."""
    marks = "[...document.querySelectorAll('[data-plot] text[text-anchor=middle]')].map((e) => Number(e.textContent))"
    times = page.run(marks)
    return float(max(times) - min(times))


def test_names_are_text_and_nothing_else(page: Browser) -> None:
    assert page.run("document.title") == EVIL and page.run("document.querySelector('h1').textContent") == EVIL
    assert page.run("document.images.length") == 0 and page.run("document.scripts.length") == 1
    assert page.run("document.querySelectorAll('#scene .name').length") == 3
    assert EVIL in page.run("[...document.querySelectorAll('#scene .name')].map((e) => e.textContent)")
    assert page.run("document.querySelector('.placetext').textContent").startswith(EVIL)


def test_it_says_what_it_is_of(page: Browser) -> None:
    assert page.run("document.querySelector('#state').textContent") == "12.0 s since 100 s, 3 objects, 1 gripper"


def test_keys_move_the_time(page: Browser) -> None:
    assert clock(page) == 0.0
    for key, shift, expected in (
        ("ArrowRight", False, 0.1),
        ("ArrowRight", True, 1.1),
        ("ArrowLeft", False, 1.0),
        ("End", False, 12.0),
        ("ArrowRight", False, 12.0),
        ("Home", False, 0.0),
    ):
        page.press(key, shift=shift)
        assert clock(page) == pytest.approx(expected, abs=0.051)


def test_the_slider_shows_the_bag_s_own_poses(page: Browser) -> None:
    page.click(SLIDER, 0.5)
    page.wait("document.querySelector('.clock').textContent > '5'")
    page.press("Home")
    for _ in range(6):
        page.press("ArrowRight", shift=True)
    assert clock(page) == 6.0
    stream = recorded().object_poses["table"]
    page.run("new Promise((done) => setTimeout(done, 0))")
    expected = np.interp(106.0, stream.time, stream.position[:, 0])
    x, y, degrees = body(page, [each["name"] for each in everything().still["objects"]].index(EVIL))
    assert x == pytest.approx(expected, abs=2e-4) and y == 0.0
    assert degrees == pytest.approx(np.degrees(0.5 * expected), abs=0.01)
    assert f"{x:.3f}" in page.run("document.querySelector('#now').textContent")


def test_it_plays_and_pauses_by_click_and_by_key(page: Browser) -> None:
    page.click("#player .play")
    assert page.run("document.querySelector('.play').getAttribute('aria-label')") == "pause"
    page.wait("parseFloat(document.querySelector('.clock').textContent) > 0.2")
    page.click("#player .play")
    stood = clock(page)
    assert page.run("document.querySelector('.play').getAttribute('aria-label')") == "play" and stood < 8.0
    page.run(NEXT)
    assert clock(page) == stood
    page.run("document.activeElement.blur()")
    page.run("document.querySelector('#speed').value = '30'")
    page.press(" ")
    page.wait("document.querySelector('.clock').textContent.startsWith('12.0')")
    page.wait("document.querySelector('.play').getAttribute('aria-label') === 'play'")


def test_the_room_is_moved_and_enlarged(page: Browser) -> None:
    def matrix() -> list[float]:
        page.run(NEXT)
        return [
            float(v)
            for v in re.findall(r"-?[\d.]+", page.run("document.querySelector('.metres').getAttribute('transform')"))
        ]

    begun = matrix()
    page.drag(SCENE, [(0.5, 0.5), (0.55, 0.5), (0.6, 0.6)])
    moved = matrix()
    width, height = page.place(SCENE)[2:]
    assert moved[4] - begun[4] == pytest.approx(0.1 * width, abs=2) and moved[5] - begun[5] == pytest.approx(
        0.1 * height, abs=2
    )
    page.wheel(SCENE, -200.0, 0.25, 0.25)
    page.wait(f"Math.abs(document.querySelector('.metres').transform.baseVal[0].matrix.a - {moved[0]}) > 1")
    closer = matrix()
    at = [0.25 * width, 0.25 * height]
    for k in (0, 1):
        assert (at[k] - closer[4 + k]) / closer[0] == pytest.approx((at[k] - moved[4 + k]) / moved[0], abs=0.02)
    page.click("#fit")
    assert matrix() == pytest.approx(begun)
    page.press("+")
    page.press("-")
    assert matrix() == pytest.approx(begun, rel=1e-3)
    page.press("+")
    page.press("f")
    assert matrix() == pytest.approx(begun)


def test_curves_are_clicked_and_show_less_time(page: Browser) -> None:
    page.click(CURVE, 0.5, 0.5)
    left, right, width = 52.0, 12.0, page.place(CURVE)[2]
    assert clock(page) == pytest.approx(12.0 * (0.5 * width - left) / (width - left - right), abs=0.15)
    assert shown_span(page) == pytest.approx(12.0, abs=2.1)
    page.wheel(CURVE, -1500.0, 0.5)
    page.wait("!document.querySelector('#whole').hidden")
    page.run(NEXT)
    assert shown_span(page) < 2.0
    page.press("End")
    assert clock(page) == 12.0, "the shown interval goes with the cursor"
    assert page.run("document.querySelector('[data-plot] .cursor').getAttribute('visibility')") == "visible"
    page.press("a")
    page.run(NEXT)
    assert shown_span(page) > 9.0 and page.run("document.querySelector('#whole').hidden")


def test_help_opens_and_closes(page: Browser) -> None:
    page.press("?")
    assert page.run("document.querySelector('#help').open")
    page.press("ArrowRight")
    assert clock(page) == 0.0, "keys are for the list while it is open"
    page.press("Escape")
    page.wait("!document.querySelector('#help').open")
    page.click("#help-open")
    page.click("#help form button")
    page.wait("!document.querySelector('#help').open")


def test_a_name_at_the_side_puts_the_object_in_the_middle(page: Browser) -> None:
    page.click("#now tr:nth-child(2) .chip")
    page.run(NEXT)
    x, y = (float(page.run(f"document.querySelectorAll('#scene .name')[1].getAttribute('{k}')")) for k in "xy")
    width, height = page.place(SCENE)[2:]
    assert (x, y) == pytest.approx((width / 2, height / 2), abs=1.0)


def test_what_is_missing_is_said_and_overlays_are_drawn(page: Browser) -> None:
    notes = page.run("document.querySelector('#notes').textContent")
    assert "pillar: no pose was recorded" in notes
    assert page.run("document.querySelectorAll('.posterior .dot').length") == 150
    for kind in ("place", "unsure", "residualtrail", "acting", "grasp"):
        assert page.run(f"document.querySelectorAll('.{kind}').length") >= 1, kind
    drawn = page.run("[...document.querySelectorAll('path')].map((e) => e.getAttribute('d') || '').join(' ')")
    assert "NaN" not in drawn and "undefined" not in drawn and "Infinity" not in drawn
    assert page.run("document.documentElement.scrollWidth <= innerWidth")


def test_it_is_printed_on_few_sheets(page: Browser, tmp_path: Path) -> None:
    page.printed(tmp_path / "page.pdf")
    data = (tmp_path / "page.pdf").read_bytes()
    assert data.startswith(b"%PDF") and len(re.findall(rb"/Type\s*/Page\b", data)) <= 2


def test_controls_are_not_printed(page: Browser) -> None:
    rules = "[...document.styleSheets].flatMap((s) => [...s.cssRules]).filter((r) => r.media?.mediaText === 'print')"
    printed = page.run(f"{rules}.map((r) => r.cssText).join('')")
    assert ".player" in printed and "display: none" in printed and "background" in printed


def test_a_recording_of_almost_nothing_is_shown(browser: Browser) -> None:
    bare = replace(recorded(), bodies={}, object_poses={}, gripper_poses={}, grasps=(), room=np.empty((0, 2)))
    browser.complaints.clear()
    with serving(make_app(BagSource(shown_of(bare, "bare")))) as address:
        browser.open(address)
        browser.wait(PICTURE)
        browser.press("End")
        assert clock(browser) == pytest.approx(12.0, abs=0.05)
        assert "no pose of the gripper" in browser.run("document.querySelector('#notes').textContent")
    assert browser.complaints == []
