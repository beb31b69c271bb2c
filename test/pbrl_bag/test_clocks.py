"""Clocks of two machines are told apart by when their messages were heard, and nothing else is taken for one."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_bag.clocks import CAMERA, LEAST, clock_notes, clock_offsets


def lags(offset: float, seed: int, count: int = 500) -> list[float]:
    """Return lags of messages that take 2 ms, and now and then up to half a second more."""
    rng = np.random.default_rng(seed)
    late = np.where(rng.random(count) < 0.02, rng.uniform(0.0, 0.5, count), 0.0)
    return (offset + 0.002 + rng.exponential(0.002, count) + late).tolist()


@pytest.mark.parametrize("offset", [-40.0, -0.3, 0.2, 1e3, 1.7e9])
def test_an_offset_is_found_to_the_millisecond(offset: float) -> None:
    found = clock_offsets({"/wrench": lags(0.0, 1), "/pose": lags(offset, 2)})
    assert found == {"/pose": pytest.approx(offset, abs=1e-3)}
    (note,) = clock_notes({"/wrench": lags(0.0, 1), "/pose": lags(offset, 2)})
    assert ("behind" if offset > 0 else "ahead of") in note
    assert f"clock_offset: {found['/pose']:g}" in note


def test_what_a_camera_takes_is_no_clock() -> None:
    late = lags(7.0 + CAMERA, 2)
    assert clock_offsets({"/wrench": lags(0.0, 1), "/pose": late}, {"/pose"})["/pose"] == pytest.approx(7.0, abs=1e-3)
    (wrench,) = clock_offsets({"/pose": late, "/wrench": lags(0.0, 1)}, {"/pose"}).items()
    assert wrench == ("/wrench", pytest.approx(-7.0, abs=1e-3))
    both = {"/wrench": lags(0.0, 1), "/pose": late, "/hand": late}
    assert len(set(clock_offsets(both, {"/pose", "/hand"}).values())) == 1
    assert clock_offsets({"/pose": late, "/hand": lags(7.0 + CAMERA, 3)}, {"/pose", "/hand"}) == {}


def test_putting_it_right_leaves_nothing_to_say() -> None:
    pose = lags(0.7, 2)
    offset = clock_offsets({"/wrench": lags(0.0, 1), "/pose": pose})["/pose"]
    assert clock_offsets({"/wrench": lags(0.0, 1), "/pose": [each - offset for each in pose]}) == {}


@pytest.mark.parametrize(
    "pose",
    [
        lags(0.5 * LEAST, 2),
        np.linspace(0.0, 10.0, 300).tolist(),
        [5.0] * 3,
        [float("nan")] * 50,
        [],
    ],
    ids=["a slow camera", "a clock that runs at another rate", "too few", "no numbers", "nothing"],
)
def test_nothing_else_is_taken_for_a_clock(pose: list[float]) -> None:
    assert clock_offsets({"/wrench": lags(0.0, 1), "/pose": pose}) == {}
