"""Inflation: exact distances, the cost of each, and unknown cells."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from pbrl_planner.costmap import InflationSettings, inflate, squared_distances


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (31, 47), (3, 200)])
@pytest.mark.parametrize("share", [0.003, 0.05, 0.6, 1.0])
def test_distances_are_scipys(shape: tuple[int, int], share: float) -> None:
    rng = np.random.default_rng(3)
    for _ in range(5):
        lethal = rng.random(shape) < share
        lethal[rng.integers(shape[0]), rng.integers(shape[1])] = True
        assert np.array_equal(squared_distances(lethal), np.rint(distance_transform_edt(~lethal) ** 2))


def test_costs_are_those_of_the_convention() -> None:
    settings = InflationSettings(inscribed=0.3, radius=0.7, decay=4.0)
    lethal = np.zeros((60, 80), dtype=bool)
    lethal[[10, 40, 41], [20, 60, 5]] = True
    found = inflate(lethal, np.zeros_like(lethal), 0.05, settings)
    away = distance_transform_edt(~lethal) * 0.05
    for cost, d in zip(found.ravel().tolist(), away.ravel().tolist(), strict=True):
        if d == 0.0:
            assert cost == 254
        elif d <= 0.3 + 1e-9:
            assert cost == 253
        elif d <= 0.7 + 1e-9:
            assert cost == math.floor(252 * math.exp(-4.0 * (d - 0.3)))
        else:
            assert cost == 0


def test_unknown_stays_unknown_but_for_what_is_closed_in_any_case() -> None:
    lethal, unknown = np.zeros((30, 30), dtype=bool), np.ones((30, 30), dtype=bool)
    lethal[15, 15], unknown[15, 15] = True, False
    settings = InflationSettings(inscribed=0.2, radius=0.6)
    away = distance_transform_edt(~lethal) * 0.05
    found = inflate(lethal, unknown, 0.05, settings)
    assert (found[(away > 0.0) & (away <= 0.2 + 1e-9)] == 253).all()
    assert (found[away > 0.2 + 1e-9] == 255).all()


def test_nothing_lethal_costs_nothing() -> None:
    blank = np.zeros((5, 7), dtype=bool)
    assert not inflate(blank, blank, 0.05, InflationSettings()).any()


def test_radius_below_the_inscribed_is_refused() -> None:
    with pytest.raises(ValueError, match="expected inscribed at most radius"):
        InflationSettings(inscribed=0.5, radius=0.4)
