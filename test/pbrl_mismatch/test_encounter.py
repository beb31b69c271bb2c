"""What a body met on its way: found soon after it was met, where it was, against the motion; nothing else is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch.diagnose import track_of
from pbrl_mismatch.encounter import find_encounter
from pbrl_mismatch.online.slices import between

SEED = 1


@pytest.fixture(scope="module")
def clean(concealed_recording: Callable[..., Recording]) -> Recording:
    return concealed_recording("clean", SEED)


@pytest.fixture(scope="module")
def blocked(concealed_recording: Callable[..., Recording]) -> Recording:
    return concealed_recording("hidden_obstacle", SEED)


def met_at(clean: Recording, blocked: Recording) -> tuple[float, np.ndarray]:
    """Return when the two tables part, for only one meets something, and which way it then went."""
    one, other = clean.object_poses["table"], blocked.object_poses["table"]
    apart = np.hypot(*(one.position[:, :2] - other.position[:, :2]).T) > 0.01
    k = int(np.argmax(apart))
    way = other.position[k, :2] - other.position[max(k - 20, 0), :2]
    return float(one.time[k]), way / np.hypot(*way)


def test_what_was_met_is_found_soon_and_acts_against_the_motion(clean: Recording, blocked: Recording) -> None:
    time, ahead = met_at(clean, blocked)
    found = find_encounter(between(blocked, 0.0, time + 0.5), "table")
    assert found is not None
    assert abs(found.time - time) < 0.4
    assert found.force > 1.8 * found.before
    assert found.direction @ ahead < -0.5
    assert "met something near" in found.told()
    # where it acts is on the outline, on the side that went ahead
    middle = found.pose[:2]
    assert (found.place - middle) @ ahead > 0.1


def test_on_a_table_that_meets_nothing_nothing_is_found(clean: Recording) -> None:
    assert find_encounter(clean, "table") is None


def test_the_same_recording_gives_the_same_answer(clean: Recording, blocked: Recording) -> None:
    time, _ = met_at(clean, blocked)
    one, other = (find_encounter(between(blocked, 0.0, time + 0.5), "table") for _ in range(2))
    assert one is not None
    assert other is not None
    assert one.place.tobytes() == other.place.tobytes()


def test_a_sensor_at_the_end_of_its_range_still_says_that_something_was_met(
    clean: Recording, blocked: Recording
) -> None:
    time, ahead = met_at(clean, blocked)
    push = between(blocked, 0.0, time + 0.5)
    most = max(float(np.abs(stream.torque).max()) for stream in push.wrenches.values())
    short = {
        name: replace(stream, torque=np.clip(stream.torque, -0.5 * most, 0.5 * most))
        for name, stream in push.wrenches.items()
    }
    cut = replace(push, wrenches=short)
    assert any(each.saturated for each in track_of(cut, "table").missing)
    found = find_encounter(cut, "table")
    assert found is not None
    assert abs(found.time - time) < 0.4
    assert found.direction @ ahead < -0.5
