"""A fixed square in the way: it presses at the corners of either, in any frame."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.kernels.contact_kernel import contacts
from pbrl_mismatch.kernels.crate_kernel import CRUSHING
from pbrl_mismatch.kernels.state import STATE

STIFFNESS, HALF, DEPTH = 10_000.0, 0.05, 1e-3
TABLE = np.array([[0.0, -0.4], [0.0, 0.4], [-0.6, 0.4], [-0.6, -0.4]])
"""A footprint whose foremost edge lies along y at its origin, and which moves along x."""


def row(**values: float) -> np.ndarray:
    found = neutral_row()
    told = {"mass": 20.0, "obstacle_stiffness": STIFFNESS, "obstacle_radius": HALF, "obstacle_angle": 0.0}
    for name, value in {**told, "obstacle_x": HALF - DEPTH, **values}.items():
        found[COLUMN[name]] = value
    return found


def felt(
    p: np.ndarray, x: float = 0.0, y: float = 0.0, heading: float = 0.0, outline: np.ndarray = TABLE
) -> np.ndarray:
    """Return the account (9,) of what a body feels."""
    acc, state = np.zeros(9), np.zeros(STATE)
    state[:3] = x, y, heading
    contacts(
        p,
        state,
        math.cos(heading),
        math.sin(heading),
        20.0,
        1.0,
        np.zeros(2),
        np.zeros(3),
        outline,
        0.01,
        CRUSHING,
        acc,
    )
    return acc


def test_an_edge_that_lies_flat_leans_on_both_corners() -> None:
    acc = felt(row())
    np.testing.assert_allclose(acc[:3], [-2.0 * STIFFNESS * DEPTH, 0.0, 0.0], atol=1e-9)
    assert acc[3] > 0.0 and acc[8] > 0.0


@pytest.mark.parametrize("turn", [0.03, -0.03])
def test_turned_a_little_it_leans_on_one_of_them(turn: float) -> None:
    # A disc's lever would hardly move; that of a square is half its side, on the side towards which the edge turned.
    acc = felt(row(), heading=turn)
    force = math.hypot(acc[0], acc[1])
    assert force > 0.0
    lever = acc[2] / force
    assert lever == pytest.approx(math.copysign(HALF, -turn), rel=0.03)


def test_a_corner_that_runs_into_a_side_is_pressed_back_along_it() -> None:
    wedge = np.array([[0.0, 0.0], [-0.4, 0.1], [-0.4, -0.1]])
    acc = felt(row(), y=0.02, outline=wedge)
    np.testing.assert_allclose(acc[:3], [-STIFFNESS * DEPTH, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("turn", [0.7, -2.0])
def test_the_frame_does_not_matter(turn: float) -> None:
    here = felt(row(obstacle_angle=0.2, obstacle_y=0.1), heading=0.05)
    c, s = math.cos(turn), math.sin(turn)
    x, y = np.array([[c, -s], [s, c]]) @ [HALF - DEPTH, 0.1] + [1.0, -2.0]
    there = felt(row(obstacle_angle=0.2 + turn, obstacle_x=x, obstacle_y=y), 1.0, -2.0, 0.05 + turn)
    assert here[0] != 0.0
    np.testing.assert_allclose(there[0] + 1j * there[1], (here[0] + 1j * here[1]) * complex(c, s), rtol=1e-9)
    assert there[2] == pytest.approx(here[2], rel=1e-9)
    assert there[8] == pytest.approx(here[8], rel=1e-9)


def test_far_away_nothing_is_felt() -> None:
    np.testing.assert_array_equal(felt(row(obstacle_x=3.0)), 0.0)
