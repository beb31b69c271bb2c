"""The schedule of playing: every message once, in order, when it is due; nothing of it needs a clock."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pbrl_bag import BagError, Qos
from pbrl_bag.playback import Schedule, latched_before, load_bag, strongest

SECOND = 1_000_000_000
TIMES = [5 * SECOND + i * SECOND // 10 for i in range(50)]  # 4.9 s from 5 s on


def play(schedule: Schedule, step: float, until: float) -> list[tuple[float, int]]:
    """(elapsed, index) of every message, at a clock that ticks in steps."""
    played = []
    for elapsed in np.arange(0.0, until, step):
        played += [(float(elapsed), i) for i in schedule.due(float(elapsed))]
    return played


@settings(max_examples=50, deadline=None)
@given(
    gaps=st.lists(st.integers(0, SECOND), min_size=1, max_size=40),
    rate=st.floats(0.25, 8.0),
    step=st.floats(0.001, 0.7),
)
def test_every_message_is_played_once_in_order_and_not_before_it_is_due(
    gaps: list[int], rate: float, step: float
) -> None:
    times = [7 * SECOND + int(gap) for gap in np.cumsum(gaps)]
    schedule = Schedule(times, rate)
    played = play(schedule, step, (times[-1] - times[0]) / SECOND / rate + 2 * step)
    assert [i for _, i in played] == list(range(len(times)))
    for elapsed, i in played:
        due = (times[i] - times[0]) / SECOND / rate
        assert due - 1e-6 <= elapsed <= due + step + 1e-6
    assert schedule.finished


def test_waiting_as_long_as_it_says_makes_the_next_message_due() -> None:
    schedule, elapsed = Schedule(TIMES, rate=3.0), 0.0
    count = 0
    while not schedule.finished:
        elapsed += schedule.wait(elapsed) + 1e-9
        found = schedule.due(elapsed)
        assert len(found) > 0
        count += len(found)
    assert count == len(TIMES)


def test_the_start_offset_leaves_out_the_beginning() -> None:
    schedule = Schedule(TIMES, start_offset=2.05)
    assert schedule.first == 21
    assert schedule.clock(0.0) == TIMES[0] + round(2.05 * SECOND)
    assert play(schedule, 0.01, 4.0)[0] == (pytest.approx(0.05), 21)


def test_a_loop_plays_the_same_again() -> None:
    schedule = Schedule(TIMES, rate=2.0, start_offset=2.0, loop=True)
    indices = [i for _, i in play(schedule, 0.01, 6.0)]
    one_round = list(range(20, 50))
    assert indices[: 3 * len(one_round)] == 3 * one_round
    assert schedule.rounds >= 3
    assert not schedule.finished


def test_the_clock_runs_at_the_rate_and_stops_at_the_end() -> None:
    schedule = Schedule(TIMES, rate=2.0)
    assert schedule.clock(1.0) == TIMES[0] + 2 * SECOND
    assert schedule.clock(100.0) == TIMES[-1]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"rate": 0.0}, "rate"),
        ({"rate": -1.0}, "rate"),
        ({"rate": float("nan")}, "rate"),
        ({"rate": float("inf")}, "rate"),
        ({"start_offset": -0.1}, "start_offset"),
        ({"start_offset": 5.0}, "0 to 4.900 s"),
    ],
)
def test_options_out_of_range_are_refused(options: dict, words: str) -> None:
    with pytest.raises(BagError, match=words):
        Schedule(TIMES, **options)


def test_a_bag_loads_in_the_order_of_its_log_times(push_bag: Path) -> None:
    bag = load_bag(push_bag)
    times = [message.log_time for message in bag.messages]
    assert times == sorted(times)
    assert bag.topics["/scene"].qos.durability == "transient_local"
    assert bag.topics["/wrist_ft/left"].type == "geometry_msgs/msg/WrenchStamped"


def test_latched_messages_before_the_start_are_not_forgotten(push_bag: Path) -> None:
    bag = load_bag(push_bag)
    first = next(i for i, message in enumerate(bag.messages) if message.log_time > 2 * SECOND)
    told = {message.topic: message.log_time for message in latched_before(bag, first)}
    assert told == {"/scene": 0, "/grasps": SECOND}


def test_a_bag_without_messages_cannot_be_played(kit: SimpleNamespace, tmp_path: Path) -> None:
    with pytest.raises(BagError, match="expected messages to play"):
        load_bag(kit.write(tmp_path / "silent", []))


def test_the_strongest_offer_serves_every_subscriber() -> None:
    latched = Qos(history="unknown", depth=0, durability="transient_local")
    loose = Qos(depth=5, reliability="best_effort")
    merged = strongest([loose, latched])
    assert (merged.reliability, merged.durability) == ("reliable", "transient_local")
    assert strongest([latched]).depth == 10
    assert strongest([loose]) == loose
