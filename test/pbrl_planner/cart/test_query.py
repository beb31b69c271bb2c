"""A question to the planner: off the map or not, on cells of any size."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_planner.cart.navigator import Answer
from pbrl_planner.cart.query import OUTCOMES, Outcome, ask, in_cells_of, off_map
from pbrl_planner.costmap import LETHAL, CostField


def floor(resolution: float) -> CostField:
    """6 by 3 m with a pillar."""
    cells = np.zeros((round(3.0 / resolution), round(6.0 / resolution)), np.uint8)
    cells[: round(0.4 / resolution), round(2.0 / resolution) : round(2.2 / resolution)] = LETHAL
    return CostField(cells, resolution, (-1.0, -1.0), 2.0)


def test_every_answer_has_an_outcome() -> None:
    assert set(OUTCOMES) == set(Answer)


@pytest.mark.parametrize("resolution", [0.01, 0.025, 0.03, 0.05, 0.07, 0.1])
def test_other_cells_never_lose_an_obstacle(resolution: float) -> None:
    field = floor(resolution)
    got = in_cells_of(0.05, field)
    assert got.resolution == pytest.approx(0.05) and got.origin == field.origin and got.time == field.time
    rows, columns = np.nonzero(field.cells == LETHAL)
    for x, y in zip((columns + 0.5) * resolution - 1.0, (rows + 0.5) * resolution - 1.0, strict=True):
        assert got.cost(x, y) == LETHAL
    assert (got.cells == LETHAL).sum() * 0.05**2 < 0.25
    assert in_cells_of(resolution, field) is field


def test_borders_of_the_map_are_half_open() -> None:
    field = floor(0.05)
    assert off_map(field, np.array([-1.0, -1.0])) == "" and off_map(field, np.array([4.999, 1.999])) == ""
    for x, y in ((5.0, 0.0), (0.0, 2.0), (-1.001, 0.0), (0.0, -1.001)):
        assert f"got ({x:.2f}, {y:.2f})" in off_map(field, np.array([x, y]))


class Never:
    """A planner that is not to be asked."""

    resolution = 0.05

    def plan(self, *_: object) -> None:
        raise AssertionError("asked")


def test_numbers_that_are_none_are_said_to_be() -> None:
    start, goal = np.zeros(4), np.zeros(3)
    bad = ask(Never(), 0.0, floor(0.05), np.array([np.nan, 0, 0, 0]), goal)
    assert bad.outcome is Outcome.START_OFF_MAP and "finite" in bad.message
    bad = ask(Never(), 0.0, floor(0.05), start, np.array([0.0, np.inf, 0.0]))
    assert bad.outcome is Outcome.GOAL_OFF_MAP and "finite" in bad.message
