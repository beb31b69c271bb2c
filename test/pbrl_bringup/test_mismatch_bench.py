"""The bench of the watch: recordings laid end to end stay what they were; what is late or never comes counts."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from pbrl_bag import cut_episodes
from pbrl_bringup.benches import mismatch_streams
from pbrl_bringup.benches.mismatch import rows_of
from pbrl_bringup.benches.mismatch_streams import Clean, Late, clean_stream, concealed_stream
from pbrl_bringup.commands.bench import BENCHES
from pbrl_bringup.concealed.stage import draw_stage
from pbrl_bringup.concealed.streams import clean_pushes, held_seconds, joined
from pbrl_bringup.errors import BringupError

NEVER = None


def test_recordings_laid_end_to_end_are_one_stream() -> None:
    rng = np.random.default_rng(0)
    part = clean_pushes(rng, draw_stage(rng), 1)
    stream = joined([part, part, part])
    assert held_seconds(stream) == pytest.approx(3.0 * held_seconds(part))
    assert len(cut_episodes(stream)) == 3 * len(cut_episodes(part))
    for name in ("object_poses", "gripper_poses", "wrenches"):
        for one in getattr(stream, name).values():
            assert np.all(np.diff(one.time) > 0.0)
    episodes = cut_episodes(stream)
    np.testing.assert_array_equal(episodes[0].poses.position, episodes[2].poses.position)


def test_late_and_missing_alarms_count() -> None:
    late = [
        Late("tether", 1, 0.5, 9.0, 8.0, 7.0),
        Late("detent", 1, 0.5, 12.0, 8.0, 8.0),
        Late("slope", 1, 0.5, NEVER, 8.0, 8.0),
        Late("nothing", 1, 0.0, NEVER, NEVER, NEVER),
    ]
    clean, median, share, loose = rows_of([Clean(1, 1800.0, 6600, 0, 3.0), Clean(2, 1800.0, 6600, 1, 20.0)], late)
    assert clean.value == 1.0 and not clean.holds and "60 min" in clean.what
    assert median.value == 4.0 and not median.holds
    assert share.value == pytest.approx(1.0 / 3.0) and share.against["missed"] == 1
    assert loose.value == pytest.approx(3.0) and loose.against["never_an_alarm"] == 1


def test_rows_are_of_what_was_watched() -> None:
    late = Late("tether", 1, 0.5, NEVER, 8.0, 7.0)
    assert late.delay == math.inf
    assert [row.holds for row in rows_of([], [late])] == [False, False, False]
    assert len(rows_of([Clean(1, 1800.0, 6600, 0, 3.0)], [])) == 1


def test_what_was_watched_is_not_watched_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clean, late = Clean(7, 90.0, 300, 0, 1.5), Late("tether", 7, 0.5, NEVER, 8.0, NEVER)
    assert clean_stream(7, 90.0, tmp_path, until=0.0) is None
    assert concealed_stream("tether", 7, tmp_path, until=0.0) is None
    monkeypatch.setattr(mismatch_streams, "watch_clean", lambda *_: clean)
    monkeypatch.setattr(mismatch_streams, "watch_effect", lambda *_: late)
    assert clean_stream(7, 90.0, tmp_path) == clean
    assert concealed_stream("tether", 7, tmp_path) == late
    monkeypatch.undo()
    assert clean_stream(7, 90.0, tmp_path, until=0.0) == clean
    assert concealed_stream("tether", 7, tmp_path, until=0.0) == late
    with pytest.raises(BringupError, match="expected a run of"):
        clean_stream(7, 1800.0, tmp_path)


def test_it_is_a_bench() -> None:
    assert "mismatch" in BENCHES
