"""When a robot came to rest, by what its simulator wrote down; what a recording lacks of what happened."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pbrl_bag.writer import BagWriter
from pbrl_bringup.kills.striking import NEVER, WATCHED_TOPIC, _met, _missing, _sent
from pbrl_bringup.kills.truth import ROW, moves, read_truth, time_to_rest

DT = 0.01


def rows_of(speeds: list[float], start: float = 5.0) -> np.ndarray:
    """Return a truth in which the wall clock goes at half the pace, from 1000 s on."""
    k = np.arange(len(speeds))
    still = np.zeros(len(speeds))
    return np.column_stack((1000.0 + 2 * DT * k, start + DT * k, speeds, still, still))


def test_the_time_until_rest_is_simulated_and_counts_from_the_moment_it_was_struck() -> None:
    rows = rows_of([0.1] * 50 + [0.0] * 50)
    assert moves(rows, 1000.5)
    assert time_to_rest(rows, 1000.0 + 2 * DT * 30, np.inf) == pytest.approx(0.20)


def test_a_speed_that_passes_through_zero_is_no_rest() -> None:
    rows = rows_of([0.1] * 20 + [0.0] + [0.1] * 20 + [0.0] * 40)
    assert time_to_rest(rows, 1000.0 + 2 * DT * 10, np.inf) == pytest.approx(0.31)


def test_who_never_rests_takes_for_ever_and_what_comes_after_the_end_does_not_count() -> None:
    rows = rows_of([0.1] * 50 + [0.0] * 50)
    assert time_to_rest(rows, 1000.0, 1000.0 + 2 * DT * 45) == np.inf
    assert np.isnan(time_to_rest(rows, 2000.0, np.inf)), "nothing is seen after it"


def test_turning_and_arms_count_as_motion() -> None:
    for column in (3, 4):
        rows = rows_of([0.0] * 30)
        rows[10:20, column] = 0.1
        assert moves(rows, 1000.0 + 2 * DT * 15)
        assert time_to_rest(rows, 1000.0 + 2 * DT * 15, np.inf) == pytest.approx(0.05)


def test_a_file_whose_last_row_was_cut_off_is_read_up_to_there(tmp_path: Path) -> None:
    path = tmp_path / "truth"
    row = ROW.pack(1.0, 2.0, 3.0, 4.0, 5.0)
    path.write_bytes(row + row[:17])
    np.testing.assert_array_equal(read_truth(path), [[1.0, 2.0, 3.0, 4.0, 5.0]])
    assert read_truth(tmp_path / "none").shape == (0, 5)


def test_what_is_missing_is_the_longest_stretch_but_for_what_was_frozen() -> None:
    truth = np.arange(0.0, 20.0, 0.01)
    heard = truth[(truth < 4.0) | ((truth > 6.0) & (truth < 12.0))]
    seen = truth[truth < 12.0]
    assert _missing(truth, heard, []) == pytest.approx(8.0, abs=0.05)
    assert _missing(seen, heard, []) == pytest.approx(2.0, abs=0.05), "the whole of a gap"
    assert _missing(seen, heard, [(4.0, 6.0)]) < 0.05
    assert _missing(seen, heard, [(4.0, 5.5)]) == pytest.approx(0.5, abs=0.02), "who is back has to hear again"
    assert _missing(seen, heard, [(4.5, 5.5)]) == pytest.approx(1.0, abs=0.04), "before it and after it"
    assert _missing(seen, heard, [(4.4, 4.8), (5.0, 5.2)]) == pytest.approx(1.4, abs=0.06)
    assert _missing(seen, seen, []) < 0.02
    assert _missing(truth, heard[:0], []) == NEVER
    assert _missing(truth[:0], heard, []) == 0.0


def test_what_a_simulator_that_is_not_heard_yet_had_no_time_to_send_is_not_lost() -> None:
    heard, truth = np.arange(0.0, 9.0, 0.01), np.arange(11.5, 11.6, 0.01)
    assert _missing(truth, heard, [(9.0, 10.5)]) == pytest.approx(0.1, abs=0.02)


def test_what_a_recorder_wrote_late_is_not_lost(tmp_path: Path) -> None:
    bag, sent = tmp_path / "bag", np.arange(10.0, 12.0, 0.01)
    writer = BagWriter(bag, live=False)
    for when in sent:
        written = int(max(when, 11.5) * 1e9)  # it was frozen, and then wrote all of it at once
        writer.write(WATCHED_TOPIC, "sensor_msgs/msg/JointState", b"\x00\x01\x00\x00", written, int(when * 1e9))
    writer.close()
    assert _missing(sent, _sent(bag), []) == pytest.approx(0.0, abs=1e-6)


def test_who_has_just_started_has_to_be_found_first() -> None:
    truth = np.arange(10.0, 20.0, 0.01)
    before, after = np.arange(0.0, 9.0, 0.01), np.arange(12.6, 20.0, 0.01)
    assert _met(truth, np.concatenate([before, after])) == pytest.approx(12.6)
    assert _met(truth, before) == np.inf
    assert _met(truth[:100], after) == np.inf, "what was heard later is of another one"
    assert _met(truth[:0], after) == np.inf
