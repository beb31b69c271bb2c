"""Casters' first turns along a path: sought one by one, likelier for it, and all else as it was."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import EFFECTS, track_of
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.effects.caster_swivel import HEADINGS
from pbrl_mismatch.search.fitted import scene_of
from pbrl_mismatch.search.hypothesis import BaselineOptions, baselines
from pbrl_mismatch.search.path.along import Along, lay_along
from pbrl_mismatch.search.path.climb import likelihood
from pbrl_mismatch.search.path.turned import ANGLES, turned

FLOOR, MASS = 0.15, 20.0


@pytest.fixture(scope="module")
def free() -> Any:
    return baselines(BaselineOptions(MASS, 0.1, 0.1, 0.005), ["free"], np.zeros(2), np.array([0.6, 0.35]), None)[0]


@pytest.fixture(scope="module")
def along(concealed_recording: Callable[..., Recording]) -> Along:
    track = track_of(concealed_recording("caster_swivel", 1), "table")
    return lay_along(cut_windows(track, 2.0), track.seen, MASS, FLOOR, 4)


@pytest.fixture(scope="module")
def casters(along: Along, free: Any) -> Any:
    return free.with_effect(EFFECTS["caster_swivel"], scene_of(along.track, free.rows(free.mean[None])[0]), 0)


def density(along: Along, hypothesis: Any, points: np.ndarray) -> np.ndarray:
    misfit = np.sum(along.residual(hypothesis.rows(points)) ** 2, axis=2)
    return likelihood(along, misfit) - 0.5 * np.sum(((points - hypothesis.mean) / hypothesis.spread) ** 2, axis=1)


def drawn(casters: Any, count: int) -> np.ndarray:
    """Return starts with casters turned at random."""
    rng = np.random.default_rng(3)
    starts = np.repeat(casters.mean[None], count, axis=0)
    for column in HEADINGS:
        starts[:, casters.columns.index(column)] = rng.uniform(-np.pi, np.pi, count)
    return starts


def test_turns_are_likelier_than_those_they_began_with_and_nothing_else_moves(along: Along, casters: Any) -> None:
    starts = drawn(casters, 6)
    found = turned(along, casters, starts)
    others = [k for k, column in enumerate(casters.columns) if column not in HEADINGS]
    np.testing.assert_array_equal(found[:, others], starts[:, others])
    assert np.all(density(along, casters, found) >= density(along, casters, starts) - 1e-6)
    assert np.ptp(density(along, casters, found)) < 0.5 * np.ptp(density(along, casters, starts))


def test_no_single_caster_turned_on_is_likelier(along: Along, casters: Any) -> None:
    found = turned(along, casters, drawn(casters, 1))
    last = casters.columns.index(HEADINGS[-1])  # the last that was asked
    for k in range(1, ANGLES):
        other = found.copy()
        other[:, last] = np.remainder(other[:, last] + 2.0 * np.pi * k / ANGLES + np.pi, 2.0 * np.pi) - np.pi
        assert density(along, casters, other)[0] <= density(along, casters, found)[0]


def test_what_has_no_casters_stays_as_it_is(along: Along, free: Any) -> None:
    starts = free.mean + free.spread * np.random.default_rng(0).standard_normal((4, len(free.mean)))
    np.testing.assert_array_equal(turned(along, free, starts), free.believable(starts))
