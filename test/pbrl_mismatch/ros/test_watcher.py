"""The watch by itself: when diagnoses begin, and which are told."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest
from watched import AtHand, Stream

from pbrl_bag import write_recording
from pbrl_bag.types import Recording
from pbrl_mismatch.online.monitor import Alarm, MismatchMonitor
from pbrl_mismatch.ros import watcher


def test_a_push_that_is_not_seen_to_end_is_diagnosed_after_a_while(
    at_hand: AtHand, concealed_recording: Callable[..., Recording], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(watcher, "QUIET", math.inf)
    monkeypatch.setattr(watcher, "LONGEST", math.inf)
    stream = Stream(write_recording(concealed_recording("floor_slope", 1, seconds=9.0), tmp_path / "bag"))
    stream.play(lambda: at_hand.asked)
    stream.watcher.diagnose_again("table", stream.newest())
    stream.watcher.step()
    assert len(at_hand.asked) == 1, "it is still held"
    monkeypatch.setattr(watcher, "LONGEST", 0.0)
    stream.watcher.step()
    stream.watcher.step()
    assert len(at_hand.asked) == 2, "once"


def test_alarms_that_follow_each_other_do_not_put_the_diagnosis_off(
    at_hand: AtHand, concealed_recording: Callable[..., Recording], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(watcher, "QUIET", math.inf)
    stream = Stream(write_recording(concealed_recording("floor_slope", 1, seconds=9.0), tmp_path / "bag"))

    def alarmed(_: MismatchMonitor, recording: Recording) -> tuple[Alarm, ...]:
        held = recording.grasps and recording.grasps[0].end > recording.grasps[0].start + 2.0
        return (Alarm("table", stream.newest(), 1e-4, 5.0, "free"),) if held else ()

    monkeypatch.setattr(MismatchMonitor, "hear", alarmed)
    stream.play(lambda: at_hand.asked)
    assert len(at_hand.asked) == 1


def test_what_was_begun_or_asked_for_on_another_clock_is_not_told(
    at_hand: AtHand,
    concealed_recording: Callable[..., Recording],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(watcher, "QUIET", math.inf)
    stream = Stream(write_recording(concealed_recording("floor_slope", 1, seconds=9.0), tmp_path / "bag"))
    at_hand.lets = False
    stream.play()
    assert len(at_hand.asked) == 1 and stream.told[-1]
    stream.watcher.diagnose_again("table", stream.newest())
    before = len(stream.told)
    stream.play(lambda: len(stream.told) > before and stream.told[-1])
    assert stream.told[before] == () and len(at_hand.asked) == 1
    at_hand.lets = True
    stream.watcher.step()
    assert stream.told[-1][0].diagnosed is None, "the verdict is of the other clock"
    stream.play(lambda: len(at_hand.asked) == 2)
    monkeypatch.setattr(watcher, "QUIET", -1.0)
    stream.watcher.step()
    assert len(at_hand.asked) == 2, "nobody asked on this clock"
