"""A body that turns about one place is told from one that moves away, whatever its frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import track_of
from pbrl_mismatch.search.path.pins import fixed_place, may_be_pinned, with_pins

PIN = np.array([0.25, -0.1])


@pytest.fixture(scope="module")
def clean(concealed_recording: Callable[..., Recording]) -> Any:
    return track_of(concealed_recording("clean", 1), "table")


def turned_about(track: Any, pin: np.ndarray, give: float = 0.0) -> Any:
    """Return a track whose body turns as it did, about a pin through one of its points that gives."""
    seen, arm = track.seen.copy(), np.array([0.2, -0.3])
    turn = seen[:, 2] - seen[0, 2]
    c, s = np.cos(turn), np.sin(turn)
    seen[:, 0] = pin[0] + c * arm[0] - s * arm[1]
    seen[:, 1] = pin[1] + s * arm[0] + c * arm[1] + give * np.sin(np.arange(len(turn)) / 200.0)
    return replace(track, seen=seen)


def test_the_place_that_a_body_turns_about_is_found(clean: Any) -> None:
    place, moved = fixed_place(turned_about(clean, PIN))
    assert place == pytest.approx(PIN, abs=1e-6)
    assert moved == pytest.approx(0.0, abs=1e-6)
    place, moved = fixed_place(turned_about(clean, PIN, give=0.02))
    assert place == pytest.approx(PIN, abs=0.05)
    assert 0.005 < moved < 0.02


def test_a_body_that_is_put_down_elsewhere_between_two_pushes_has_no_pin(clean: Any) -> None:
    track = turned_about(clean, PIN)
    assert may_be_pinned(track)
    seen = track.seen.copy()
    seen[len(seen) // 2 :, :2] += [0.3, 0.0]
    assert not may_be_pinned(replace(track, seen=seen))


def test_it_turns_with_the_world(clean: Any) -> None:
    track = turned_about(clean, PIN, give=0.01)
    c, s = np.cos(0.7), np.sin(0.7)
    seen = track.seen.copy()
    seen[:, 0], seen[:, 1] = c * track.seen[:, 0] - s * track.seen[:, 1], s * track.seen[:, 0] + c * track.seen[:, 1]
    seen[:, 2] += 0.7
    (one, moved), (other, again) = fixed_place(track), fixed_place(replace(track, seen=seen))
    assert other == pytest.approx([c * one[0] - s * one[1], s * one[0] + c * one[1]], abs=1e-6)
    assert again == pytest.approx(moved, abs=1e-6)


def test_a_body_that_moves_away_has_no_pin(clean: Any) -> None:
    assert may_be_pinned(turned_about(clean, PIN, give=0.02))
    assert not may_be_pinned(clean)
    draws = np.zeros((10, 3))
    np.testing.assert_array_equal(with_pins(np.random.default_rng(0), draws, (1, 2), clean), draws)


def test_most_draws_are_put_there(clean: Any) -> None:
    placed = with_pins(np.random.default_rng(0), np.full((100, 3), 9.0), (1, 2), turned_about(clean, PIN))
    np.testing.assert_array_equal(placed[:, 0], 9.0)
    near = np.hypot(*(placed[:, 1:] - PIN).T) < 0.15
    assert 60 <= near.sum() <= 80
