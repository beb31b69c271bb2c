"""What `describe` says of a bag, against how the bag was made."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pbrl_bag import BagError, describe
from pbrl_bag.info import gaps_in


def test_counts_rates_and_duration_are_those_written(push_bag: Path) -> None:
    info = describe(push_bag)
    topics = {topic.name: topic for topic in info.topics}
    assert info.finished
    assert info.notes == ()
    assert info.profile == "ros2"
    assert (info.start, info.duration) == (0.0, pytest.approx(3.98))
    assert topics["/wrist_ft/left"].count == 200
    assert topics["/wrist_ft/left"].rate == pytest.approx(50.0)
    assert topics["/ar_tags/table/pose"].rate == pytest.approx(50.0 / 3.0)
    assert topics["/scene"].type == "pbrl_msgs/msg/Scene"
    assert np.isnan(topics["/scene"].rate)
    assert topics["/scene"].qos[0].durability == "transient_local"
    assert all(len(topic.gaps) == 0 for topic in info.topics)
    assert info.message_count == sum(topic.count for topic in info.topics)


def test_a_silence_is_found_where_it_is(kit: SimpleNamespace, tmp_path: Path) -> None:
    messages = [one for one in kit.pushing() if not ("table" in one[0] and 1.5e9 < one[3] < 2.5e9)]
    topics = {topic.name: topic for topic in describe(kit.write(tmp_path / "bag", messages)).topics}
    gap = topics["/ar_tags/table/pose"]
    assert gap.gaps.shape == (1, 2)
    assert gap.gaps[0, 0] <= 1.5
    assert gap.gaps[0, 1] >= 2.5
    assert gap.longest_gap == pytest.approx(gap.gaps[0, 1] - gap.gaps[0, 0])
    assert topics["/wrist_ft/left"].longest_gap == 0.0


def test_gaps_do_not_depend_on_where_time_begins() -> None:
    time = np.concatenate([np.arange(0.0, 1.0, 0.01), np.arange(3.0, 4.0, 0.01)])
    np.testing.assert_allclose(gaps_in(time + 100.0), gaps_in(time) + 100.0)
    np.testing.assert_allclose(gaps_in(time), [[0.99, 3.0]])
    assert len(gaps_in(np.array([0.0, 100.0]))) == 0


def test_a_bag_without_messages_can_be_described(kit: SimpleNamespace, tmp_path: Path) -> None:
    info = describe(kit.write(tmp_path / "silent", []))
    assert info.message_count == 0
    assert info.finished
    assert np.isnan(info.start)
    assert info.topics == ()


def test_what_is_no_bag_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="got nothing of that name"):
        describe(tmp_path / "nothing")
