"""Links that fail on purpose: each fault does what it says, from when it says, and again with the same seed."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
from geometry_msgs.msg import Twist, WrenchStamped
from pydantic import ValidationError
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64, Float64MultiArray, String

from bullet_sim.faults import ClockJump, Faults, FaultyLinks, LinkFaults

COUNT, DT = 400, 0.01


def carried(
    faults: LinkFaults | None, topic: str = "/x", seed: int = 1, clock: tuple = ()
) -> list[tuple[float, float]]:
    """Return when what number arrives, of numbers that are sent one every 10 ms."""
    links = FaultyLinks(
        Faults(links={} if faults is None else {topic: faults}, clock=clock), np.random.default_rng(seed)
    )
    found = []
    for k in range(COUNT + 200):
        if k < COUNT:
            links.send(k * DT, "/x", Float64(data=float(k)))
        found += [(k * DT, message.data) for _, message in links.due(k * DT)]
    return found


def test_without_a_fault_everything_arrives_at_once_in_its_order() -> None:
    assert carried(None) == [(k * DT, float(k)) for k in range(COUNT)]
    assert carried(LinkFaults(lost=1.0), topic="/y") == carried(None)


def test_what_is_lost_does_not_come_and_what_is_doubled_comes_twice() -> None:
    assert carried(LinkFaults(lost=1.0)) == []
    assert 0.4 * COUNT < len(carried(LinkFaults(lost=0.5))) < 0.6 * COUNT
    twice = carried(LinkFaults(doubled=1.0))
    assert set(Counter(value for _, value in twice).values()) == {2}
    assert len(twice) == 2 * COUNT


def test_what_is_late_keeps_its_order_and_jitter_does_not() -> None:
    late = carried(LinkFaults(late=0.3))
    assert [value for _, value in late] == [float(k) for k in range(COUNT)]
    assert all(time == pytest.approx(value * DT + 0.3, abs=DT + 1e-9) for time, value in late)
    mixed = [value for _, value in carried(LinkFaults(jitter=0.1))]
    assert sorted(mixed) == [float(k) for k in range(COUNT)] and mixed != sorted(mixed)


def test_what_is_held_back_comes_behind_the_next() -> None:
    values = [value for _, value in carried(LinkFaults(reordered=0.3))]
    assert set(np.diff(values)) <= {-1.0, 1.0, 2.0, 3.0}
    assert (np.diff(values) == -1.0).sum() > 0.15 * COUNT
    assert len(values) >= COUNT - 1, "the last may be waited for in vain"


def test_a_fault_begins_and_ends_when_it_says() -> None:
    values = [value for _, value in carried(LinkFaults(lost=1.0, since=1.0, until=2.0))]
    assert values == [float(k) for k in range(COUNT) if not 100 <= k < 200]


def test_one_number_of_a_message_is_none_and_the_sender_keeps_his_own() -> None:
    links = FaultyLinks(Faults(links={"*": LinkFaults(nan=1.0)}), np.random.default_rng(0))
    twist, array, text = Twist(), Float64MultiArray(data=[1.0] * 7), String(data="nothing to spoil")
    for message in (twist, array, text, WrenchStamped()):
        links.send(0.0, "/x", message)
    got = [message for _, message in links.due(0.0)]
    numbers = [*(getattr(v, a) for v in (got[0].linear, got[0].angular) for a in "xyz")]
    assert sum(map(math.isnan, numbers)) == 1
    assert sum(map(math.isnan, got[1].data)) == 1
    assert got[2] == text
    assert list(array.data) == [1.0] * 7 and twist == Twist()


def test_a_clock_jumps_when_it_says_and_shows_no_less_than_nothing() -> None:
    jumps = (ClockJump(at=1.0, by=5.0), ClockJump(at=2.0, by=-100.0))
    links = FaultyLinks(Faults(clock=jumps), np.random.default_rng(0))
    shown = []
    for second in range(4):
        message = Clock()
        message.clock.sec = second
        links.send(float(second), "/clock", message)
        shown += [got.clock.sec for _, got in links.due(float(second))]
    assert shown == [0, 6, 0, 0]


def test_the_same_seed_fails_in_the_same_way() -> None:
    faults = LinkFaults(lost=0.2, doubled=0.2, late=0.05, jitter=0.1, reordered=0.2)
    assert carried(faults, seed=7) == carried(faults, seed=7) != carried(faults, seed=8)


@pytest.mark.parametrize("bad", [{"lost": 1.5}, {"late": -1.0}, {"since": 2.0, "until": 1.0}, {"lots": 0.5}])
def test_a_fault_that_cannot_be_is_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValidationError):
        LinkFaults(**bad)
