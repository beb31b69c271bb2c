"""The way back is the way that was come, from where they are, each bit of it once."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_planner.cart.trail import HEADWAY, KEPT, LEAST, STEP, Headway, Trail


def way(count: int) -> np.ndarray:
    """Return poses (n, 4) of an arc with a swinging cart, a centimetre or so apart."""
    along = np.linspace(0.0, 4.0, count)
    return np.column_stack((np.sin(along), 1.0 - np.cos(along), along + 3.0, 0.3 * np.sin(3.0 * along)))


def come(poses: np.ndarray) -> Trail:
    trail = Trail()
    for pose in poses:
        trail.at(np.array([*pose[:2], np.angle(np.exp(1j * pose[2])), pose[3]]))
    return trail


def test_back_leads_along_the_poses_that_were_come_by_as_far_as_asked() -> None:
    poses = way(400)
    back = come(poses).back(1.5)
    off = back[0] - poses[-1]
    assert np.abs(np.array([*off[:2], np.angle(np.exp(1j * off[2])), off[3]])).max() < 1e-9, "from where they are"
    length = np.hypot(*np.diff(back[:, :2], axis=0).T).sum()
    assert 1.5 <= length < 1.5 + 2.0 * STEP
    for pose in back:
        off = poses - pose
        off[:, 2] = np.angle(np.exp(1j * off[:, 2]))
        assert np.abs(off).max(axis=1).min() < 1e-9
    assert np.abs(np.diff(back[:, 2])).max() < 0.2, "no turn in between"


def test_what_was_gone_back_is_gone_and_next_to_nothing_is_no_way() -> None:
    trail = come(way(400))
    first, second = trail.back(1.5), trail.back(1.5)
    assert np.array_equal(second[0], first[-1])
    assert trail.back(10.0) is not None and trail.back(10.0) is None
    assert Trail().back(1.0) is None
    assert come(way(400)[:20]).back(1.0) is None, f"less than {LEAST} m"


@pytest.mark.parametrize("moved", [[0.5 * STEP, 0.0, 0.0, 0.0], [0.0, 0.0, 0.5 * STEP, -0.5 * STEP]])
def test_who_stands_comes_from_nowhere_new(moved: list[float]) -> None:
    trail = come(way(400))
    there = trail.back(0.0)
    for _ in range(50):
        trail.at(there[0] + moved)
    assert len(trail.back(1e9)) < 400 and Trail().back(1.0) is None


def test_a_long_day_is_forgotten_in_the_morning() -> None:
    trail = Trail()
    for x in np.arange(0.0, 3.0 * KEPT * STEP, 1.01 * STEP):
        trail.at(np.array([x, 0.0, 0.0, 0.0]))
    assert len(trail.back(1e9)) == KEPT


def test_headway_is_made_by_going_or_by_turning_not_by_shuffling() -> None:
    rng, headway = np.random.default_rng(0), Headway()
    shuffles = np.array([5.0, 1.0, 3.1, 0.0]) + rng.uniform(-0.3, 0.3, (500, 4))
    assert not any(headway.at(each) for each in shuffles)
    goes = [headway.at(np.array([5.0 + x, 1.0, 3.1, 0.0])) for x in np.arange(0.0, 4.0, 0.1)]
    assert 3 <= sum(goes) <= np.ceil(4.0 / HEADWAY[0])
    turns = [headway.at(np.array([9.0, 1.0, np.angle(np.exp(1j * (3.1 + a))), 0.0])) for a in np.arange(0.0, 6.0, 0.1)]
    assert 4 <= sum(turns) <= np.ceil(6.0 / HEADWAY[1]) + 1
