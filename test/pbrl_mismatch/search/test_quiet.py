"""What only belief draws over an edge does not hold up a climb, simulated or along a path."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.hypothesis import BaselineOptions, Hypothesis, baselines
from pbrl_mismatch.search.objective import Linear, Objective
from pbrl_mismatch.search.path.climb import climb_along
from pbrl_mismatch.search.quiet import FIRM, WORTH, Holding, of_little

WINDOWS, POSES = 6, 20
EDGE, HOLDING = 0.2, 0.205
"""Friction below which a wheel lets go, and that a climb begins with; it is believed to be a seventh of it."""


@pytest.fixture(scope="module")
def wheel() -> Hypothesis:
    return baselines(BaselineOptions(20.0, 0.1, 0.1, 0.02), ["wheel"], np.zeros(2), np.array([0.6, 0.35]), None)[0]


class Held(Objective):
    """A body that a wheel holds above an edge of its friction; where it is, its place and the body's mass tell."""

    edge = EDGE

    def __init__(self, hypothesis: Hypothesis) -> None:
        told = SimpleNamespace(observations=WINDOWS * POSES, weight=np.ones((WINDOWS, POSES, 1)))
        super().__init__(hypothesis, told, 0.15)  # type: ignore[arg-type]
        object.__setattr__(self, "truth", (21.0, 0.2, 0.3))

    def at_rest(self, count: int) -> Any:
        return np.zeros((count, WINDOWS, 9))

    def told(self, rows: Any) -> Any:
        """Return (P, W, R) residuals of parameter rows."""
        time = np.linspace(0.0, 1.0, POSES) + np.arange(WINDOWS)[:, None]
        mass, x, y, mu = (rows[:, COLUMN[name], None, None] for name in ("mass", "wheel_x", "wheel_y", "mu_x"))
        at = self.truth  # type: ignore[attr-defined]
        off = 4.0 * (mass / at[0] - 1.0) * time + 40.0 * (x - at[1]) * np.sin(time) + 200.0 * (y - at[2]) * np.cos(time)
        return off + 2e3 * np.maximum(self.edge - mu, 0.0)

    def residual(self, coordinates: Any, nuisance: Any) -> Any:
        return self.told(self.hypothesis.rows(coordinates))

    def linearise(self, coordinates: Any, nuisance: Any, spread: Any = None) -> Linear:
        here, free = self.residual(coordinates, None), coordinates.shape[1]
        moved = [self.residual(coordinates + 1e-6 * np.eye(free)[k], None) for k in range(free)]
        slope = -(np.stack(moved, -1) - here[..., None]) / 1e-6
        return Linear(here, slope, np.zeros((*here.shape, 9)))


class Free(Held):
    """The same without an edge."""

    edge = 0.0


def start(wheel: Hypothesis) -> Any:
    begin = wheel.mean.copy()
    begin[wheel.columns.index("mu_x")] = np.log(HOLDING)
    return begin[None]


def test_belief_alone_would_draw_it_over_the_edge(wheel: Hypothesis) -> None:
    objective = Held(wheel)
    k = wheel.columns.index("mu_x")
    assert start(wheel)[0, k] > wheel.mean[k] + 0.5 * wheel.spread[k]
    over = start(wheel)
    over[0, k] = wheel.mean[k]
    here, there = (float(np.sum(objective.residual(each, None) ** 2)) for each in (start(wheel), over))
    assert there > here + 1e5


@pytest.mark.parametrize("steps", [4, 6])
def test_a_climb_beside_an_edge_is_as_good_as_one_without(wheel: Hypothesis, steps: int) -> None:
    held, free = (climb(kind(wheel), start(wheel), iterations=steps) for kind in (Held, Free))
    assert held.misfit.sum() == pytest.approx(free.misfit.sum(), abs=1.0)
    for name in ("wheel_x", "wheel_y", "mass"):
        k = wheel.columns.index(name)
        assert held.coordinates[0, k] == pytest.approx(free.coordinates[0, k], abs=0.05 * wheel.spread[k])
    assert wheel.rows(held.coordinates)[0, COLUMN["mu_x"]] > EDGE - 1e-3


@pytest.mark.parametrize("steps", [5, 8])
def test_along_a_path_as_well(wheel: Hypothesis, steps: int) -> None:
    found = []
    for kind in (Held, Free):
        told, counts = kind(wheel).told, np.full(WINDOWS, float(POSES))
        along: Any = SimpleNamespace(residual=told, counts=counts, log_det=0.0, operator=np.zeros((3, WINDOWS, 1, 1)))
        found.append(climb_along(along, wheel, start(wheel), steps))
    held, free = found
    assert held.misfit.sum() == pytest.approx(free.misfit.sum(), abs=1.0)
    assert held.evidence[0] > free.evidence[0] - 5.0


def test_what_is_held_is_what_the_data_say_little_of_where_a_step_failed() -> None:
    precision = np.array([4.0, 1.0, 0.25])
    matrix = np.stack([np.diag([39.0, 11.0, 2.6]), np.diag([41.0, 9.0, 2.4])])
    quiet, rows = of_little(matrix, precision), np.arange(2)
    assert quiet.tolist() == [[True, False, False], [False, True, True]]
    holding = Holding(2, precision)
    assert not holding.added(rows, quiet).any()
    assert holding.failed(rows[1:], quiet[1:]).tolist() == [], "first without what is quiet"
    assert np.array_equal(holding.added(rows, quiet), [np.zeros((3, 3)), FIRM * np.diag([0.0, 1.0, 0.25])])
    assert holding.failed(rows[1:], quiet[1:]).tolist() == [1], "and then a shorter step"
    holding.stepped(rows[1:], np.array([2.0 * WORTH]))
    assert holding.added(rows, quiet).any(), "for as long as it is worth it"
    holding.stepped(rows[1:], np.array([0.5 * WORTH]))
    assert not holding.added(rows, quiet).any()
    assert holding.failed(rows[1:], quiet[1:]).tolist() == [1], "what is quiet has its own way to go"
    holding.stepped(rows[1:], np.array([0.5 * WORTH]))
    assert holding.failed(rows[1:], quiet[1:]).tolist() == [], "once it has gone a step it may be held again"


def test_where_all_is_quiet_nothing_is_held() -> None:
    holding, quiet = Holding(1, np.ones(2)), np.ones((1, 2), dtype=np.bool_)
    assert holding.failed(np.array([0]), quiet).tolist() == [0]
    assert not holding.added(np.array([0]), quiet).any()
