"""Outlines and names of bodies: which are none, and what is said of them."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_bag.outline import LARGEST, MOST_CORNERS, fault_of_name, fault_of_outline

SQUARE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
ELL = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]


@pytest.mark.parametrize("outline", [SQUARE, ELL, SQUARE[:3]])
def test_an_outline_is_one_wherever_it_starts(outline: list[list[float]]) -> None:
    for start in range(len(outline)):
        assert fault_of_outline(np.roll(outline, start, axis=0)) == ""


@pytest.mark.parametrize(
    ("outline", "word"),
    [
        (SQUARE[:2], "3 corners"),
        (SQUARE[::-1], "counter-clockwise"),
        ([[0, 0], [1, 1], [1, 0], [0, 1]], "cross itself"),
        ([[0, 0], [3, 0], [3, 1], [1, -1], [0, 1]], "cross itself"),
        ([[0, 0], [1, 0], [2, 0]], "area of 0"),
        ([[0, 0], [1, np.nan], [0, 1]], "finite"),
        ([[0, 0], [2 * LARGEST, 0], [0, 1]], "within"),
        ([[0, 0], [1e300, 0], [0, 1e300]], "within"),
    ],
    ids=["two corners", "clockwise", "bow tie", "one edge over another", "line", "NaN", "far", "huge"],
)
def test_what_is_none_is_said(outline: list[list[float]], word: str) -> None:
    assert word in fault_of_outline(outline)


def test_of_many_corners_each_edge_is_held_against_each_other() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, MOST_CORNERS, endpoint=False)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    assert fault_of_outline(circle) == ""
    assert "at most" in fault_of_outline(np.vstack([circle, [1.0, -1e-3]]))
    circle[[700, 701]] = circle[[701, 700]]
    assert fault_of_outline(circle) == ("expected an outline that does not cross itself, got edges 700 and 702 that do")


@pytest.mark.parametrize("name", ["table", "table_a", "T2"])
def test_names_that_fit_into_topics(name: str) -> None:
    assert fault_of_name(name) == ""


@pytest.mark.parametrize("name", ["", "../../etc/table", "a b", "2table", "tisch/é", "a\nb", "_x"])
def test_names_that_do_not(name: str) -> None:
    assert "letters" in fault_of_name(name)
