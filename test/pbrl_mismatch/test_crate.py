"""A crate that is pushed along: it holds, slides, turns and coasts as its friction and its mass say, in any frame."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.kernels.contact_kernel import contacts
from pbrl_mismatch.kernels.crate_kernel import CRUSHING, ON_AN_EDGE, ON_CORNERS, ROUND, STIFFNESS, move_crate, pressed
from pbrl_mismatch.kernels.friction_kernel import FOOT
from pbrl_mismatch.kernels.state import STATE, UNSEEN
from pbrl_mismatch.kernels.step_kernel import fixed_axes, step_body

FORCE, HALF, DT, GRAVITY, MASS = 20.0, 0.15, 0.01, 9.81, 20.0
LIGHT = 4.0
"""A friction coefficient under which a crate weighs next to nothing."""
WEDGE = np.array([[0.0, 0.0], [-0.4, 0.1], [-0.4, -0.1]])
"""A footprint whose foremost corner is its origin, and points along x."""


def row(**values: float) -> np.ndarray:
    found = neutral_row()
    told = {"mass": MASS, "unseen_force": FORCE, "unseen_radius": HALF, "unseen_angle": 0.0, "unseen_x": HALF}
    for name, value in {**told, "unseen_friction": LIGHT, **values}.items():
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
    contacts(p, state, c, s, MASS, 1.0, np.zeros(2), np.zeros(3), WEDGE, DT, CRUSHING, acc)
    return acc


def pushed(p: np.ndarray, y: float, way: float, step: float = 1e-5) -> np.ndarray:
    """Push a wedge's corner slowly along x into a crate at height y; return the state (STATE,) at the end."""
    state = state_of(p, y=y)
    state[3] = step / DT
    for _ in range(round(way / step)):
        state[0] += step
        move_crate(p, WEDGE, state, 1.0, 0.0, np.zeros(2), DT, CRUSHING)
    return state


def run_into(p: np.ndarray, speed: float, steps: int, mass: float = MASS) -> np.ndarray:
    """Let a wedge go along x towards the middle of a crate; return the states (steps, STATE) after each step."""
    state, com = state_of(p, x=-0.05), np.zeros(2)
    state[3] = speed
    acc, axes, room, feet = np.zeros(9), np.zeros(7), np.zeros((1, FOOT)), np.zeros((0, 2))
    fixed_axes(p, DT, axes)
    path = []
    for k in range(steps):
        step_body(p, state, np.zeros(3), k * DT, mass, 1.0, com, np.zeros(3), WEDGE, feet, axes, acc, room, DT)
        path.append(state.copy())
    return np.array(path)


def test_pressed_less_than_its_friction_it_stands_and_springs_back() -> None:
    p, depth = row(), 0.5 * FORCE / STIFFNESS
    state = state_of(p, x=depth)
    before = state.copy()
    move_crate(p, WEDGE, state, 1.0, 0.0, np.zeros(2), DT, CRUSHING)
    np.testing.assert_array_equal(state, before)
    acc = felt(p, state)
    np.testing.assert_allclose(acc[:3], [-0.5 * FORCE, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(acc[3], STIFFNESS * (DT + CRUSHING))


@pytest.mark.parametrize("tip", [0.0, 0.7, 1.0])
@pytest.mark.parametrize("off", [0.0, 0.03, -0.06, 0.12])
def test_pushed_beside_its_middle_it_turns_as_the_limit_surface_says(off: float, tip: float) -> None:
    p, way = row(unseen_tip=tip), 2e-3
    lever, deep = (HALF * (ON_CORNERS + tip * (ON_AN_EDGE - ON_CORNERS))) ** 2, FORCE / STIFFNESS
    reached = FORCE / math.sqrt(1.0 + off * off / lever)
    one, two = pushed(p, off, deep), pushed(p, off, deep + way)
    turned = two[UNSEEN + 2] - one[UNSEEN + 2]
    # The corner presses at (0, off) with n along x: moment -off; what moves at the contact is what the corner moves.
    assert turned == pytest.approx(-way * (off / lever) / (1.0 + off * off / lever), rel=0.06, abs=1e-9)
    # Friction turns it about where its load is, ahead of its middle.
    ahead = tip * HALF * 0.5 * (1.0 + reached / FORCE)
    assert two[UNSEEN + 1] - one[UNSEEN + 1] == pytest.approx(-ahead * turned, rel=0.15, abs=2e-5)
    fx, fy, *_ = pressed(p, WEDGE, two, 1.0, 0.0, np.zeros(2))
    assert math.hypot(fx, fy) == pytest.approx(reached, rel=0.02)


def test_action_is_reaction() -> None:
    p = row(unseen_angle=0.4, unseen_x=0.16, unseen_y=0.05)
    state = state_of(p, x=0.012, y=0.02, heading=0.1)
    fx, fy, fm, *_ = pressed(p, WEDGE, state, math.cos(0.1), math.sin(0.1), np.zeros(2))
    assert 0.0 < math.hypot(fx, fy) < FORCE, "it is held"
    acc = felt(p, state)
    np.testing.assert_allclose(acc[:2], [-fx, -fy], rtol=1e-12)
    arm = state[UNSEEN : UNSEEN + 2] - state[:2]
    assert acc[2] == pytest.approx(-(fm + arm[0] * fy - arm[1] * fx), rel=1e-12)


@pytest.mark.parametrize("angle", [0.0, ROUND])
@pytest.mark.parametrize("heavy", [2.0, 10.0, 60.0])
def test_what_is_met_takes_its_share_of_the_momentum_and_does_not_spring_back(heavy: float, angle: float) -> None:
    rubs = 0.05
    p = row(unseen_force=rubs, unseen_friction=rubs / (GRAVITY * heavy), unseen_angle=angle)
    end = run_into(p, 0.4, 200)[-1]
    assert MASS * end[3] + heavy * end[UNSEEN + 3] == pytest.approx(MASS * 0.4, rel=0.03)
    assert -1e-3 < end[UNSEEN + 3] - end[3] < 0.2 * 0.4, "a fifth of the speed at most"
    np.testing.assert_allclose(end[[1, 2, UNSEEN + 1, UNSEEN + 2]], 0.0, atol=1e-9)


def test_it_slides_on_until_friction_has_stopped_it() -> None:
    friction, speed, dt = 0.2, 0.5, 1e-3
    p = row(unseen_friction=friction, unseen_x=3.0)
    state = state_of(p)
    state[UNSEEN + 3 : UNSEEN + 5] = 0.6 * speed, 0.8 * speed
    for _ in range(round(1.1 * speed / (friction * GRAVITY * dt))):
        move_crate(p, WEDGE, state, 1.0, 0.0, np.zeros(2), dt, CRUSHING)
    way = speed**2 / (2.0 * friction * GRAVITY)
    np.testing.assert_allclose(state[UNSEEN : UNSEEN + 2] - [3.0, 0.0], [0.6 * way, 0.8 * way], rtol=0.01)
    np.testing.assert_array_equal(state[UNSEEN + 3 :], 0.0)


def test_a_body_that_leaves_is_not_held() -> None:
    p = row()
    state = state_of(p, x=0.5 * FORCE / STIFFNESS)
    state[3] = -0.2
    np.testing.assert_array_equal(felt(p, state), 0.0)


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
    p = row(unseen_angle=0.2, unseen_tip=0.6)
    here = pushed(p, 0.05, 0.03)
    c, s = math.cos(turn), math.sin(turn)
    rotate = np.array([[c, -s], [s, c]])
    x, y = rotate @ [HALF, 0.0] + [1.0, -2.0]
    q = row(unseen_tip=0.6, unseen_angle=0.2 + turn, unseen_x=x, unseen_y=y)
    state = state_of(q, heading=turn)
    state[3:5] = rotate @ [1e-5 / DT, 0.0]
    for k in range(3000):
        state[:2] = rotate @ [(k + 1) * 1e-5, 0.05] + [1.0, -2.0]
        move_crate(q, WEDGE, state, c, s, np.zeros(2), DT, CRUSHING)
    np.testing.assert_allclose(state[UNSEEN : UNSEEN + 2], rotate @ here[UNSEEN : UNSEEN + 2] + [1.0, -2.0], atol=1e-9)
    assert state[UNSEEN + 2] == pytest.approx(here[UNSEEN + 2], abs=1e-9)


def test_far_away_nothing_is_felt() -> None:
    p = row(unseen_x=3.0)
    np.testing.assert_array_equal(felt(p, state_of(p)), 0.0)
