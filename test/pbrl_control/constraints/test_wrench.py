"""The expected wrench against the world model's kernel: applied there, it makes the motion it was computed for."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pbrl_control.constraints.object_model import ObjectModel, SwivelCasters
from pbrl_control.constraints.twist import achievable_twist
from pbrl_control.constraints.wrench import expected_grip_wrench, total_wrench
from pbrl_control.errors import ControlError
from pbrl_control.planar import Array, compose, shift, turn
from pbrl_control.types import PlanarTwist
from pbrl_model.rollout import com_to_origin, rollout_states

DT = 1e-3
KINDS = ["free", "wheel", "locked", "pivot"]
TWO = np.array([[-0.375, 0.3], [-0.375, -0.3]])


def allowed(model: ObjectModel, twist: Array, pose: Array) -> Array:
    return achievable_twist(model, PlanarTwist(*map(float, twist)), pose).twist.array()


def com_state(model: ObjectModel, pose: Array, twist: Array) -> Array:
    com = compose(pose, np.array([*model.com, 0.0]))
    return np.array([*com[:2], pose[2], *turn(shift(twist, model.com), pose[2])])


def simulate(model: ObjectModel, pose: Array, twist: Array, wrenches: Array, dt: float = DT) -> Array:
    """Return (T + 1, 6) states of the centre of mass under wrenches (T, 3) there, in the object's axes."""
    row = model.parameters.to_vector()[None]
    start = com_state(model, pose, twist)[None]
    states = rollout_states(
        row, start, wrenches[None], model.inertia_per_mass, model.com, dt, parallel=False, body_wrench=True
    )
    return states[0, 0]


def body_twists(states: Array) -> Array:
    """Return (T, 3) twists of the centre of mass in the object's axes."""
    return np.array([turn(state[3:], -state[2]) for state in states])


@pytest.mark.parametrize("contacts", [TWO[:1], TWO], ids=["one grip", "two grips"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_steady_motion_stays_steady_in_the_kernel(draw, place, rng, kind: str, contacts: Array) -> None:
    """Over half a second at a millisecond: speeds within 0.1 mm/s and 0.1 mrad/s of those asked for."""
    for _ in range(8):
        model = draw(kind)
        pose = place(model)
        twist = allowed(model, rng.uniform(-1.0, 1.0, size=3) * [0.2, 0.2, 0.3], pose)
        wrenches = expected_grip_wrench(model, pose, twist, np.zeros(3), contacts)
        total = total_wrench(contacts, wrenches, model.com)
        states = simulate(model, pose, twist, np.tile(total, (500, 1)))
        error = np.abs(body_twists(states) - shift(twist, model.com))
        assert error.max() < 1e-4, f"{kind}: {error.max(axis=0)}"


@pytest.mark.parametrize("kind", KINDS)
def test_finite_differences_of_the_kernel_give_the_rate(draw, place, rng, kind: str) -> None:
    """One step of the kernel changes the twist by rate * dt, within 2 mm/s^2 and 2 mrad/s^2."""
    for _ in range(20):
        model = draw(kind)
        pose = place(model)
        twist = allowed(model, rng.uniform(-1.0, 1.0, size=3) * [0.2, 0.2, 0.3], pose)
        rate = allowed(model, rng.uniform(-0.2, 0.2, size=3), pose)
        wrenches = expected_grip_wrench(model, pose, twist, rate, TWO)
        total = total_wrench(TWO, wrenches, model.com)
        found = np.diff(body_twists(simulate(model, pose, twist, np.tile(total, (2, 1)), 1e-4)), axis=0)[-1] / 1e-4
        np.testing.assert_allclose(found, shift(rate, model.com), atol=2e-3)


def test_a_bar_s_anchor_goes_round_the_hinge(draw, place) -> None:
    for _ in range(8):
        model = draw("bar")
        pose = place(model)
        twist = allowed(model, np.array([0.1, 0.1, 0.2]), pose)
        wrench = expected_grip_wrench(model, pose, twist, np.zeros(3), TWO)
        total = total_wrench(TWO, wrench, model.com)
        states = simulate(model, pose, twist, np.tile(total, (300, 1)))
        error = np.abs(body_twists(states) - shift(twist, model.com))
        assert error.max() < 1e-4


def test_a_whole_motion_from_rest_to_rest(draw, place) -> None:
    """Open loop, from rest and back: the kernel ends within 1 mm and 1 mrad of where the trapezoid does."""
    for kind in KINDS:
        model = draw(kind)
        pose = place(model)
        peak = allowed(model, np.array([0.15, 0.1, 0.1]), pose)
        speed = np.interp(np.arange(3000) + 0.5, [0, 1000, 2000, 3000], [0.0, 1.0, 1.0, 0.0])
        change = np.repeat([1.0, 0.0, -1.0], 1000)
        total = []
        for share, rate in zip(speed, change, strict=True):
            wrench = expected_grip_wrench(model, pose, share * peak, rate * peak, TWO)
            total.append(total_wrench(TWO, wrench, model.com))
        states = simulate(model, pose, np.zeros(3), np.array(total))
        end = com_to_origin(states[-1, :3], model.com)
        wanted = pose.copy()
        for share in speed:
            half = wanted[2] + share * peak[2] * DT / 2
            wanted = wanted + DT * share * turn(peak, half)
        np.testing.assert_allclose(end, wanted, atol=1e-3)


def test_one_grip_pushing_straight_through_the_centre(table) -> None:
    model = table(mass=30.0, mu_ground=0.05)
    contact = np.array([[-0.375, 0.0]])
    wrench = expected_grip_wrench(model, None, np.array([0.1, 0.0, 0.0]), np.array([0.2, 0.0, 0.0]), contact)
    np.testing.assert_allclose(wrench, [[30.0 * 0.2 + 0.05 * 30.0 * 9.81, 0.0, 0.0]], atol=1e-9)


def test_two_grips_do_not_work_against_each_other(draw, place, rng) -> None:
    for kind in KINDS:
        model = draw(kind)
        pose = place(model)
        twist = allowed(model, np.array([0.1, 0.05, 0.2]), pose)
        rate = allowed(model, np.array([0.1, 0.0, 0.1]), pose)
        wrenches = expected_grip_wrench(model, pose, twist, rate, TWO)
        total = total_wrench(TWO, wrenches, model.com)
        for _ in range(20):
            other = wrenches + rng.normal(scale=1.0, size=(2, 3))
            other[1] += wrenches.sum(axis=0) - other.sum(axis=0)
            other[1, 2] += (total - total_wrench(TWO, other, model.com))[2]
            np.testing.assert_allclose(total_wrench(TWO, other, model.com), total, atol=1e-9)
            weights = np.array([1.0, 1.0, 1.0 / 0.032**2])
            assert (weights * wrenches**2).sum() <= (weights * other**2).sum() + 1e-9


def test_a_wheel_that_is_dragged_costs_its_friction(table) -> None:
    model = table(mass=30.0, mu_x=0.02, mu_y=0.5)
    wrench = expected_grip_wrench(model, None, np.array([0.0, 0.1, 0.0]), np.zeros(3), np.zeros((1, 2)))
    assert wrench[0, 1] == pytest.approx(0.5 * 30.0 * 9.81)


def test_a_table_turned_about_its_locked_caster_needs_but_little(table) -> None:
    caster = {"wheel_x": -0.315, "wheel_y": -0.69, "mu_x": 0.175, "mu_y": 0.175}
    model = table(mu_ground=0.03, **caster)
    contact = np.array([[-0.355, 0.40]])
    fought = expected_grip_wrench(model, None, np.array([0.15, 0.0, 0.0]), np.zeros(3), contact)
    with_it = expected_grip_wrench(model, None, np.array([0.1242, -0.0567, -0.18]), np.zeros(3), contact)
    assert np.hypot(*with_it[0, :2]) < 12.0
    assert np.abs(with_it[0, 2]) < 0.2, "plates carry hardly any torque"
    assert np.hypot(*fought[0, :2]) > 50.0


def with_casters(model: ObjectModel, friction: float = 0.07, share: float = 0.25) -> ObjectModel:
    corners = np.array([[0.315, 0.69], [0.315, -0.69], [-0.315, 0.69], [-0.315, -0.69]])
    return replace(model, casters=SwivelCasters(corners, friction, share))


def test_casters_that_stand_across_resist_where_they_are(table) -> None:
    model, mass = with_casters(table(mass=30.0, mu_ground=0.0)), 30.0
    contact, still = model.com[None], np.zeros(3)
    straight = expected_grip_wrench(model, None, np.array([0.1, 0.0, 0.0]), still, contact, across=True)
    np.testing.assert_allclose(straight, [[0.07 * mass * 9.81, 0.0, 0.0]], atol=1e-9)
    turned = expected_grip_wrench(model, None, np.array([0.0, 0.0, 0.1]), still, contact, across=True)
    lever = math.hypot(0.315, 0.69)
    np.testing.assert_allclose(turned, [[0.0, 0.0, 0.07 * mass * 9.81 * lever]], atol=1e-9)
    assert not expected_grip_wrench(model, None, still, still, contact, across=True).any(), "at rest they do not"
    np.testing.assert_array_equal(
        expected_grip_wrench(model, None, np.array([0.1, 0.0, 0.0]), still, contact), np.zeros((1, 3))
    )


def test_one_that_is_turned_about_does_not_resist(table) -> None:
    model = with_casters(table(mass=30.0, mu_ground=0.0))
    about = np.array([-0.315, -0.69])
    twist = shift(np.array([0.0, 0.0, 0.1]), -about)
    total = total_wrench(TWO, expected_grip_wrench(model, None, twist, np.zeros(3), TWO, across=True), about)
    levers = [np.hypot(0.63, 1.38), 0.63, 1.38]
    assert total[2] == pytest.approx(0.07 * 0.25 * 30.0 * 9.81 * sum(levers))


@pytest.mark.parametrize(
    ("places", "friction", "share"),
    [(np.zeros(2), 0.07, 0.25), (np.full((1, 2), math.nan), 0.07, 0.25), (TWO, 0.0, 0.25), (TWO, 0.07, math.inf)],
)
def test_casters_that_are_none_are_refused(places: Array, friction: float, share: float) -> None:
    with pytest.raises(ControlError, match="casters: expected"):
        SwivelCasters(places, friction, share)


def test_rest_needs_nothing(draw, place) -> None:
    for kind in KINDS:
        model = draw(kind)
        assert not expected_grip_wrench(model, place(model), np.zeros(3), np.zeros(3), TWO).any()


@pytest.mark.parametrize(
    ("twist", "contacts"),
    [
        (np.array([math.nan, 0.0, 0.0]), TWO),
        (np.zeros(2), TWO),
        (np.zeros(3), np.zeros((0, 2))),
        (np.zeros(3), np.zeros(2)),
        (np.zeros(3), np.array([[math.inf, 0.0]])),
    ],
)
def test_hostile_input_is_refused(table, twist: Array, contacts: Array) -> None:
    with pytest.raises(ControlError, match="expected finite"):
        expected_grip_wrench(table(), None, twist, np.zeros(3), contacts)
