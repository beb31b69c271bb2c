"""Compiled parts of the grid of places and headings against OpenCV's erosion and against the search itself."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from pbrl_control.navigation.grid_kernel import erode, reaches, search
from pbrl_control.navigation.grid_route import _compass


def runs_of(mask: np.ndarray) -> np.ndarray:
    """Cut a mask (2 r + 1, 2 r + 1) up cell by cell: a run of one is a run."""
    row, column = np.nonzero(mask)
    reach = len(mask) // 2
    return np.column_stack((row - reach, column - reach, np.ones_like(row)))


def joined(runs: np.ndarray) -> np.ndarray:
    """Join runs that follow one another in a row."""
    whole: list[list[int]] = []
    for row, first, cells in runs:
        if whole and whole[-1][0] == row and whole[-1][1] + whole[-1][2] == first:
            whole[-1][2] += cells
        else:
            whole.append([row, first, cells])
    return np.array(whole, dtype=np.int64).reshape(-1, 3)


@pytest.mark.parametrize("reach", [0, 1, 4, 9])
@pytest.mark.parametrize("size", [(1, 1), (7, 40), (33, 25)])
def test_erosion_is_that_of_opencv(reach: int, size: tuple[int, int], rng: np.random.Generator) -> None:
    for share in (0.0, 0.02, 0.3):
        blocked = rng.random(size) < share
        mask = rng.random((2 * reach + 1,) * 2) < 0.5
        free = np.pad(~blocked, reach).astype(np.uint8)
        expected = cv2.erode(free, mask.astype(np.uint8)) if mask.any() else np.ones_like(free)
        expected = expected[reach : reach + size[0], reach : reach + size[1]] > 0
        for runs in (runs_of(mask), joined(runs_of(mask))):
            np.testing.assert_array_equal(erode(blocked, runs, reach), expected)


def test_there_is_a_way_exactly_where_the_search_finds_one(rng: np.random.Generator) -> None:
    headings, moves, angles = _compass()
    answers = []
    for share in np.repeat([0.9, 0.8, 0.7, 0.6, 0.5], 12):
        free, turns = rng.random((2, len(headings), 9, 12)) < [[[[share]]], [[[0.6 * share]]]]
        states = np.argwhere(free)
        seeds, ends = (rng.choice(states, 2, replace=False) for _ in range(2))
        none = np.zeros(2)
        found = search(free, turns, moves, angles, seeds, none, ends, none, 2.0, 1.0, 1.0)
        assert reaches(free, turns, moves, seeds, ends) == (len(found) > 0)
        assert reaches(free, turns, moves, ends, seeds) == (len(found) > 0), "every step can be undone"
        answers.append(len(found) > 0)
    assert 10 < sum(answers) < 50
