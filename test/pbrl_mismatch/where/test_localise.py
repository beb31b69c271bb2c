"""Where model and recording part, of recordings: the seconds, the frame, the speed, the hold, in words too."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from wandering import table_row

from pbrl_bag.types import Recording
from pbrl_mismatch import MismatchError, track_of
from pbrl_mismatch.where.localise import Localisation, localise


@pytest.fixture(scope="module")
def track(concealed_recording: Callable[..., Recording]) -> Any:
    return track_of(concealed_recording("clean", 1), "table")


def lacking(track: Any, **values: float) -> Localisation:
    """Localise what is left out by a model that is given a law which is not there: its negative."""
    return localise(track, table_row(**values))


def test_a_push_is_found_in_its_seconds_and_keeps_to_the_floor(track: Any) -> None:
    begin, end = (float(np.quantile(track.clock, share)) for share in (0.3, 0.7))
    found = lacking(track, steady_x=-4.0, steady_y=2.0, force_start=begin, force_end=end)
    (one, when), *others = sorted(found.there, key=lambda each: -float(np.hypot(*each[0].mean[:2])))
    assert one.frame == "world" and one.frames["velocity"] < 0.01  # it turns too little to tell floor from body surely
    np.testing.assert_allclose(one.mean[:2], [4.0, -2.0], atol=0.6)
    assert when[0][0] == pytest.approx(begin, abs=0.6) and when[-1][1] == pytest.approx(end, abs=0.6)
    assert all(np.hypot(*other.mean[:2]) < 1.5 for other, _ in others)
    told = " ".join(found.to_report()["sentences"])
    assert "fixed to the floor" in told and "towards -2" in told


def test_a_drag_goes_by_the_motion_and_grows_with_speed(track: Any) -> None:
    drag, rubs = lacking(track, drag_linear=-40.0), lacking(track, steady_x=-4.0, steady_y=2.0)
    one = max(drag.there, key=lambda each: float(np.hypot(*each[0].mean[:2])))[0]
    assert one.frame == "velocity" and one.mean[0] < 0.0
    assert drag.power is not None and abs(drag.power.mean - 1.0) < max(3.0 * drag.power.sd, 0.5)
    assert rubs.power is None or abs(rubs.power.mean) < max(3.0 * rubs.power.sd, 0.3)


def test_a_report_is_plain_json_and_the_holds_are_its_frame(track: Any) -> None:
    found = lacking(track, steady_x=-4.0)
    report = json.loads(json.dumps(found.to_report(), allow_nan=False))
    assert set(report) == {"when", "changes", "stretches", "speed_power", "floor", "holds", "contacts", "sentences"}
    assert len(report["holds"]) == len(track.motions)
    for start, end in report["when"]:
        assert any(hold["begin"] - 1e-6 <= start < end <= hold["end"] + 1e-6 for hold in report["holds"])
    for each in report["stretches"]:
        assert sum(each["frames"].values()) == pytest.approx(1.0)
        assert all(value["unit"] in ("N", "N m") for value in each["wrench"].values())


def test_a_model_that_lacks_nothing_says_so(track: Any) -> None:
    found = lacking(track)
    assert all(np.hypot(*stretch.mean[:2]) < 0.5 for stretch, _ in found.there)


def test_a_recording_of_a_moment_is_refused(track: Any) -> None:
    short = replace(track, begin=track.begin[:1], last=track.begin[:1] + 20)
    with pytest.raises(MismatchError, match="expected at least"):
        localise(short, table_row())
