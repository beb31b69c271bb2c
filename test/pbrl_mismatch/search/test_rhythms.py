"""Rhythms that are drawn are those of the wrench that is lacking."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pbrl_bag.types import Recording
from pbrl_mismatch import residual_wrench, track_of
from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.search.path.rhythms import SHARE, with_rhythms

COUNT = 100


@pytest.fixture(scope="module")
def residual(concealed_recording: Callable[..., Recording]) -> Any:
    track = track_of(concealed_recording("clean", 1), "table")
    row = neutral_row()
    row[COLUMN["mass"]] = 20.0
    return residual_wrench(track, row, size=1.0)


@pytest.mark.parametrize(("frequency", "phase"), [(0.32, 0.5), (1.4, -2.0)])
def test_a_rhythm_is_drawn_with_its_frequency_and_phase(residual: Any, frequency: float, phase: float) -> None:
    wave = np.sin(2.0 * np.pi * frequency * residual.time + phase)
    residual.world[:] = wave[:, None] * np.array([4.0, -3.0, 0.5])
    draws = np.full((COUNT, 3), -9.0)
    placed = with_rhythms(np.random.default_rng(0), draws, 0, 1, residual, 0.5)
    moved = int(SHARE * COUNT)
    drawn = np.sin(2.0 * np.pi * np.exp(placed[:moved, :1]) * residual.time + placed[:moved, 1:2])
    # A sign is the strength's to choose.
    alike = np.abs(drawn @ wave) / np.linalg.norm(drawn, axis=1) / np.linalg.norm(wave)
    assert np.mean(alike > 0.8) > 0.5 and alike.max() > 0.99
    np.testing.assert_array_equal(placed[moved:], draws[moved:])
    np.testing.assert_array_equal(placed[:, 2], draws[:, 2])


def test_where_nothing_is_lacking_the_prior_stays(residual: Any) -> None:
    residual.world[:] = 0.0
    draws = np.zeros((COUNT, 2))
    np.testing.assert_array_equal(with_rhythms(np.random.default_rng(0), draws, 0, 1, residual, 0.5), draws)
