"""A square crate that is pushed along: it holds, slides and turns as its limit surface says, in any frame."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrl_mismatch.kernels.account_kernel import SETTLING
from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.kernels.contact_kernel import contacts, move_unseen
from pbrl_mismatch.kernels.crate_kernel import LEVER, STIFFNESS, pressed, share_of_friction
from pbrl_mismatch.kernels.state import STATE, UNSEEN

FORCE, HALF, DT = 20.0, 0.15, 0.01
WEDGE = np.array([[0.0, 0.0], [-0.4, 0.1], [-0.4, -0.1]])
"""A footprint whose foremost corner is its origin, and points along x."""


def row(**values: float) -> np.ndarray:
    found = neutral_row()
    told = {"mass": 20.0, "unseen_force": FORCE, "unseen_radius": HALF, "unseen_angle": 0.0, "unseen_x": HALF}
    for name, value in {**told, **values}.items():
        found[COLUMN[name]] = value
    return found


def state_of(p: np.ndarray, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> np.ndarray:
    state = np.zeros(STATE)
    state[:3] = x, y, heading
    state[UNSEEN : UNSEEN + 2] = p[COLUMN["unseen_x"]], p[COLUMN["unseen_y"]]
    return state


def felt(p: np.ndarray, state: np.ndarray) -> np.ndarray:
    """Return the account (9,) of what a body feels."""
    acc = np.zeros(9)
    c, s = math.cos(state[2]), math.sin(state[2])
    contacts(p, state, c, s, 20.0, np.zeros(2), np.zeros(3), WEDGE, DT, acc)
    return acc


def pushed(p: np.ndarray, y: float, way: float, step: float = 1e-4) -> np.ndarray:
    """Push a wedge's corner along x into a crate at height y; return the state (STATE,) at the end."""
    state = state_of(p, y=y)
    for _ in range(round(way / step)):
        state[0] += step
        move_unseen(p, WEDGE, state, 1.0, 0.0, np.zeros(2))
    return state


def test_pressed_less_than_its_friction_it_stands_and_springs_back() -> None:
    p, depth = row(), 0.5 * FORCE / STIFFNESS
    state = state_of(p, x=depth)
    before = state.copy()
    move_unseen(p, WEDGE, state, 1.0, 0.0, np.zeros(2))
    np.testing.assert_array_equal(state, before)
    acc = felt(p, state)
    np.testing.assert_allclose(acc[:3], [-0.5 * FORCE, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(acc[3], STIFFNESS * (DT + SETTLING))


@pytest.mark.parametrize("off", [0.0, 0.03, -0.06, 0.12])
def test_pushed_beside_its_middle_it_turns_as_the_limit_surface_says(off: float) -> None:
    p, way = row(), 2e-3
    lever, deep = (LEVER * HALF) ** 2, FORCE / STIFFNESS
    reached = FORCE / math.sqrt(1.0 + off * off / lever)
    one, two = pushed(p, off, deep), pushed(p, off, deep + way)
    turned = two[UNSEEN + 2] - one[UNSEEN + 2]
    # The corner presses at (0, off) with n along x: moment -off; what moves at the contact is what the corner moves.
    assert turned == pytest.approx(-way * (off / lever) / (1.0 + off * off / lever), rel=0.06, abs=1e-9)
    acc = felt(p, two)
    assert math.hypot(acc[0], acc[1]) == pytest.approx(reached, rel=0.01)
    fx, fy, fm, *_ = pressed(p, WEDGE, two, 1.0, 0.0, np.zeros(2))
    assert share_of_friction(p, fx, fy, fm) == pytest.approx(1.0, abs=0.01)


def test_action_is_reaction_about_any_point() -> None:
    p = row(unseen_angle=0.4, unseen_x=0.16, unseen_y=0.05)
    state = state_of(p, x=0.03, y=0.02, heading=0.1)
    fx, fy, fm, *_ = pressed(p, WEDGE, state, math.cos(0.1), math.sin(0.1), np.zeros(2))
    share = max(share_of_friction(p, fx, fy, fm), 1.0)
    acc = felt(p, state)
    np.testing.assert_allclose(acc[:2], [-fx / share, -fy / share], rtol=1e-12)
    arm = state[UNSEEN : UNSEEN + 2] - state[:2]
    assert acc[2] == pytest.approx(-(fm + arm[0] * fy - arm[1] * fx) / share, rel=1e-12)


def test_stiffness_is_the_slope_of_what_presses() -> None:
    p = row(unseen_angle=0.3, unseen_x=0.155, unseen_y=0.02)
    state, step = state_of(p, x=0.02, heading=0.1), 1e-7
    c, s = math.cos(0.1), math.sin(0.1)
    fx, fy, _, xx, xy, yy, xm, ym, mm = pressed(p, WEDGE, state, c, s, np.zeros(2))
    assert xx + yy > 0.0
    slope = np.zeros((3, 3))
    for k in range(3):
        there, back = state.copy(), state.copy()
        there[UNSEEN + k] += step
        back[UNSEEN + k] -= step
        ends = [np.array(pressed(p, WEDGE, each, c, s, np.zeros(2))[:3]) for each in (there, back)]
        slope[:, k] = (ends[0] - ends[1]) / (2.0 * step)
    # For displacements without turns; what presses keeps its place in the world, so that its lever changes too.
    np.testing.assert_allclose(slope[:2, :2], -np.array([[xx, xy], [xy, yy]]), rtol=1e-4, atol=1e-3 * STIFFNESS)
    assert mm > 0.0
    np.testing.assert_allclose(slope[2, :2], [-xm - fy, -ym + fx], rtol=1e-4, atol=1e-3 * STIFFNESS * HALF)


@pytest.mark.parametrize("turn", [0.7, -2.0])
def test_the_frame_does_not_matter(turn: float) -> None:
    p = row(unseen_angle=0.2)
    here = pushed(p, 0.05, 0.03)
    c, s = math.cos(turn), math.sin(turn)
    rotate = np.array([[c, -s], [s, c]])
    x, y = rotate @ [HALF, 0.0] + [1.0, -2.0]
    q = row(unseen_angle=0.2 + turn, unseen_x=x, unseen_y=y)
    state = state_of(q, heading=turn)
    for k in range(300):
        state[:2] = rotate @ [(k + 1) * 1e-4, 0.05] + [1.0, -2.0]
        move_unseen(q, WEDGE, state, c, s, np.zeros(2))
    np.testing.assert_allclose(state[UNSEEN : UNSEEN + 2], rotate @ here[UNSEEN : UNSEEN + 2] + [1.0, -2.0], atol=1e-9)
    assert state[UNSEEN + 2] == pytest.approx(here[UNSEEN + 2], abs=1e-9)


def test_far_away_nothing_is_felt() -> None:
    p = row(unseen_x=3.0)
    np.testing.assert_array_equal(felt(p, state_of(p)), 0.0)
