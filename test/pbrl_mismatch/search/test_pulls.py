"""Where something may pull: draws on the residual wrench's line of action."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import residual_wrench, track_of
from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.search.path import pulls
from pbrl_mismatch.search.path.pulls import SHARE, TAUT, with_pulls

POINT, FORCE = np.array([0.3, 0.2]), np.array([4.0, 3.0])
"""Where something pulls, in the body's frame, and its force [N] in the body's axes."""
COUNT = 200


def rotated(angle: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * vectors[..., 0] - s * vectors[..., 1], s * vectors[..., 0] + c * vectors[..., 1]], -1)


@pytest.fixture(scope="module")
def pulled(concealed_recording: Callable[..., Recording]) -> Any:
    """Return a track and a residual that is an exact pull at a point of the body."""
    track = track_of(concealed_recording("clean", 1), "table")
    row = neutral_row()
    row[COLUMN["mass"]] = 20.0
    found = residual_wrench(track, row, size=1.0)
    found.world[:, :2] = rotated(found.state[:, 2], np.broadcast_to(FORCE, found.world[:, :2].shape))
    arm = POINT - track.body[1:3]
    found.world[:, 2] = arm[0] * FORCE[1] - arm[1] * FORCE[0]
    return track, found


def test_points_that_are_drawn_lie_on_the_line_of_action(pulled: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pulls, "SPREAD", 0.0)
    monkeypatch.setattr(pulls, "TWICE", 0.0)
    track, residual = pulled
    draws = np.full((COUNT, 5), -9.0)
    placed = with_pulls(np.random.default_rng(0), draws, (0, 1), (2, 3), None, track, residual)
    moved = int(SHARE * COUNT)
    off = placed[:moved, 2:4] - POINT
    lower, upper = track.outline.min(axis=0), track.outline.max(axis=0)
    free = np.all((placed[:moved, 2:4] > lower) & (placed[:moved, 2:4] < upper), axis=1)
    assert free.mean() > 0.4
    np.testing.assert_allclose((off[:, 0] * FORCE[1] - off[:, 1] * FORCE[0])[free], 0.0, atol=1e-9)
    assert np.ptp(off[free], axis=0).max() > 0.3
    np.testing.assert_array_equal(placed[moved:], draws[moved:])
    np.testing.assert_array_equal(placed[:, 4], draws[:, 4])


def test_a_catch_s_point_is_the_one_that_a_body_turned_about(pulled: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pulls, "TWICE", 1.0)
    track, residual = pulled
    state, anchor = residual.state.copy(), np.array([1.0, -2.0])
    state[:, 2] = np.linspace(0.0, 3.0, len(state))
    state[:, :2] = anchor - rotated(state[:, 2], np.broadcast_to(POINT - track.body[1:3], state[:, :2].shape))
    draws = np.full((COUNT, 4), -9.0)
    turned = replace(residual, state=state)
    placed = with_pulls(np.random.default_rng(0), draws, (0, 1), (2, 3), None, track, turned)[: int(SHARE * COUNT)]
    found = np.abs(placed - [*anchor, *POINT]).max(axis=1) < 1e-9
    assert found.mean() > 0.9, "but for two moments of one heading"


def test_the_point_that_is_at_one_place_in_two_states_comes_back() -> None:
    rng = np.random.default_rng(1)
    one, other, point = rng.normal(size=(50, 6)), rng.normal(size=(50, 6)), rng.normal(size=(50, 2))
    other[:, :2] = one[:, :2] + rotated(one[:, 2], point) - rotated(other[:, 2], point)
    other[:5, 2] = one[:5, 2]
    found, told = pulls.at_both(one, other)
    assert told[5:].mean() > 0.9 and not told[:5].any() and np.isfinite(found).all()
    np.testing.assert_allclose(found[told], point[told], atol=1e-9)


def test_a_cord_comes_from_along_its_force_and_is_taut(pulled: Any) -> None:
    track, residual = pulled
    draws = np.zeros((COUNT, 5))
    draws[:, 4] = np.log(0.7)
    placed = with_pulls(np.random.default_rng(0), draws, (0, 1), (2, 3), 4, track, residual)[: int(SHARE * COUNT)]
    there = residual.state[:, None, :2] + rotated(residual.state[:, None, 2], placed[None, :, 2:4] - track.body[1:3])
    away = placed[None, :, :2] - there
    length = np.hypot(*np.moveaxis(away, -1, 0))
    along = np.einsum("tni,ti->tn", away, residual.world[:, :2]) / length / np.hypot(*FORCE)
    # At the moment that was drawn, which is one of all, the cord is along the force and stretched a little.
    fits = (along > 1.0 - 1e-6) & (length > 0.7 - 1e-9) & (length < 0.7 + TAUT + 1e-9)
    assert fits.any(axis=0).all()


def test_a_point_that_is_not_told_is_the_frame_s_origin(pulled: Any) -> None:
    track, residual = pulled
    placed = with_pulls(np.random.default_rng(0), np.zeros((COUNT, 2)), (0, 1), None, None, track, residual)
    origin = residual.state[:, :2] + rotated(residual.state[:, 2], -track.body[1:3])
    away = placed[: int(SHARE * COUNT), None] - origin
    assert np.hypot(*np.moveaxis(away, -1, 0)).min(axis=1).max() < 1e-9


def test_the_same_seed_draws_the_same(pulled: Any) -> None:
    track, residual = pulled
    draws = np.zeros((COUNT, 4))
    one, same, other = (
        with_pulls(np.random.default_rng(seed), draws, (0, 1), (2, 3), None, track, residual) for seed in (1, 1, 2)
    )
    assert one.tobytes() == same.tobytes() != other.tobytes()


def test_where_nothing_is_lacking_the_prior_stays(pulled: Any) -> None:
    track, residual = pulled
    kept = residual.world.copy()
    residual.world[:] = 0.0
    draws = np.ones((COUNT, 4))
    placed = with_pulls(np.random.default_rng(0), draws, (0, 1), (2, 3), None, track, residual)
    residual.world[:] = kept
    np.testing.assert_array_equal(placed, draws)
