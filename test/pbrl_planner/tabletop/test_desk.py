"""Desks refuse what is none, and name what is wrong with a layout."""

from __future__ import annotations

import math

import numpy as np
import pytest
from desk_cases import ERASER, PUNCH, SCALE, three

from pbrl_planner.errors import PlannerError
from pbrl_planner.tabletop import Desk, Item, Table


@pytest.mark.parametrize("sides", [(0.0, 0.0), (0.1, -0.1), (math.nan, 0.1), (0.1, math.inf), (0.05, 0.1)])
def test_items_without_sides_are_refused(sides: tuple[float, float]) -> None:
    with pytest.raises(PlannerError, match="item 'thing': expected"):
        Item("thing", *sides)


def test_tables_and_desks_that_are_none_are_refused() -> None:
    with pytest.raises(PlannerError, match="low below high"):
        Table(np.array([0.0, 0.0]), np.array([0.0, 1.0]))
    with pytest.raises(PlannerError, match="finite"):
        Table(np.array([0.0, math.nan]), np.array([1.0, 1.0]))
    with pytest.raises(PlannerError, match="different names, got eraser"):
        Desk(Table.of(1, 1), (ERASER, ERASER))
    with pytest.raises(PlannerError, match="got none"):
        Desk(Table.of(1, 1), ())
    with pytest.raises(PlannerError, match="obstacle 'hole_punch': expected a finite pose"):
        Desk(Table.of(1, 1), (ERASER,), ((PUNCH, np.array([0.0, math.nan, 0.0])),))
    with pytest.raises(PlannerError, match="reach"):
        Desk(Table.of(1, 1), (ERASER,), reach=(0.0, 0.0, 0.5, 0.4))


def test_the_middle_is_furthest_from_all_borders() -> None:
    np.testing.assert_allclose(Table(np.array([-1.0, 0.0]), np.array([2.0, 4.0])).centre, [0.5, 2.0])


def test_layouts_are_checked_and_their_faults_named() -> None:
    desk = three(obstacle=True)
    good = desk.layout([[-0.2, 0.1, 0.3], [0.2, 0.2, 0.0], [0.2, -0.1, 0.1]])
    assert desk.fault(good) == ""
    for bad in (good[:2], good * np.nan):
        with pytest.raises(PlannerError, match="expected 3 finite poses"):
            desk.layout(bad)
    for pose, words in (
        ([0.38, 0.1, 0.3], "eraser is not wholly on the table"),
        ([0.2, 0.18, 0.2], "eraser overlaps remote"),
        ([0.0, 0.02, 1.0], "eraser overlaps hole_punch"),
    ):
        other = good.copy()
        other[0] = pose
        assert desk.fault(other) == words


def test_reach_is_a_ring() -> None:
    desk = Desk(Table.of(1, 1), (SCALE,), reach=(0.0, -0.5, 0.2, 0.6))
    assert desk.in_reach(np.array([[0.0, 0.0], [0.1, 0.05]]))
    assert not desk.in_reach(np.array([[0.0, 0.0], [0.0, 0.2]]))
    assert not desk.in_reach(np.array([[0.0, -0.4]]))
    assert three().in_reach(np.array([[9.0, 9.0]])), "without a reach everything is"
    assert desk.index("scale") == 0
    with pytest.raises(PlannerError, match="expected one of the items scale, got 'plate'"):
        desk.index("plate")
