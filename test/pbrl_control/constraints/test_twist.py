"""Laws of the projection: idempotent, linear, frame-invariant, least kinetic energy, no slip at what holds."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pbrl_control.constraints.classes import Freedom, ModelClass
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.constraints.twist import achievable_twist
from pbrl_control.errors import ControlError
from pbrl_control.planar import compose, inverse, rotation, shift, turn
from pbrl_control.types import PlanarTwist

KINDS = ["free", "wheel", "locked", "pivot", "bar"]


def allowed(model: ObjectModel, twist: np.ndarray, pose: np.ndarray | None = None) -> np.ndarray:
    return achievable_twist(model, PlanarTwist(*map(float, twist)), pose).twist.array()


@pytest.mark.parametrize("kind", KINDS)
def test_it_is_a_linear_projection_that_keeps_the_constraints(draw, place, rng, kind: str) -> None:
    for _ in range(10):
        model = draw(kind)
        pose = place(model)
        a, b = rng.normal(size=(2, 3))
        once = allowed(model, a, pose)
        np.testing.assert_allclose(allowed(model, once, pose), once, atol=1e-12)
        mixed = allowed(model, 2.0 * a - 0.3 * b, pose)
        np.testing.assert_allclose(mixed, 2.0 * once - 0.3 * allowed(model, b, pose), atol=1e-12)
        np.testing.assert_allclose(Freedom.of(model, pose).rows @ once, 0.0, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_allowed_is_nearer_in_kinetic_energy(draw, place, rng, kind: str) -> None:
    model = draw(kind)
    pose = place(model)
    wanted = rng.normal(size=3)
    best = allowed(model, wanted, pose)

    def energy(twist: np.ndarray) -> float:
        return 0.5 * float((twist - wanted) @ model.inertia @ (twist - wanted))

    for _ in range(50):
        other = best + allowed(model, rng.normal(scale=0.2, size=3), pose)
        assert energy(best) <= energy(other) + 1e-12
    refused = achievable_twist(model, PlanarTwist(*map(float, wanted)), pose).refused_speed
    assert 0.5 * model.mass * refused**2 == pytest.approx(energy(best), abs=1e-9)


def reframed(model: ObjectModel, frame: np.ndarray) -> ObjectModel:
    """Return the same object described in a frame whose pose (3,) in the old one is given."""
    back, p = inverse(frame), model.parameters

    def point(x: float, y: float) -> np.ndarray:
        return compose(back, np.array([x, y, 0.0]))[:2]

    (wx, wy), (ax, ay) = point(p.wheel_x, p.wheel_y), point(p.anchor_x, p.anchor_y)
    changed = replace(p, wheel_x=wx, wheel_y=wy, wheel_theta=p.wheel_theta - frame[2], anchor_x=ax, anchor_y=ay)
    return ObjectModel.uniform(changed, np.array([point(*corner) for corner in model.footprint]))


@pytest.mark.parametrize("kind", KINDS)
def test_it_does_not_depend_on_the_object_s_frame(draw, place, rng, kind: str) -> None:
    for _ in range(10):
        model, frame = draw(kind), rng.uniform(-1.0, 1.0, size=3)
        pose, twist = place(model), rng.normal(size=3)

        def there(old: np.ndarray, frame: np.ndarray = frame) -> np.ndarray:
            return turn(shift(old, frame[:2]), -frame[2])

        other = allowed(reframed(model, frame), there(twist), compose(pose, frame))
        np.testing.assert_allclose(other, there(allowed(model, twist, pose)), atol=1e-9)


def test_it_does_not_depend_on_the_mass(table, rng) -> None:
    wheel = {"wheel_x": 0.2, "wheel_y": -0.5, "mu_x": 0.01, "mu_y": 0.6}
    twist = rng.normal(size=3)
    np.testing.assert_array_equal(allowed(table(20.0, **wheel), twist), allowed(table(40.0, **wheel), twist))


def test_a_wheel_rolls_along_its_axis_only(table, rng) -> None:
    model = table(wheel_x=0.2, wheel_y=-0.5, wheel_theta=0.4, mu_x=0.02, mu_y=0.6)
    at_wheel = shift(allowed(model, rng.normal(size=3)), model.wheel)
    assert rotation(0.4).T[1] @ at_wheel[:2] == pytest.approx(0.0, abs=1e-12)
    rolling = shift(np.array([math.cos(0.4), math.sin(0.4), 0.7]), -model.wheel)
    np.testing.assert_allclose(allowed(model, rolling), rolling, atol=1e-12)


def test_a_push_on_a_table_with_a_locked_corner_turns_it_about_the_corner(table) -> None:
    model = table(wheel_x=-0.315, wheel_y=-0.69, mu_x=0.175, mu_y=0.175)
    answer = achievable_twist(model, PlanarTwist(0.2, 0.0, 0.0, vz=0.01))
    reach = 0.315**2 + 0.69**2
    omega = -0.2 * 0.69 / (reach + model.inertia_per_mass)
    np.testing.assert_allclose(answer.twist.array(), [-0.69 * omega, 0.315 * omega, omega], atol=1e-12)
    assert answer.twist.vz == 0.01
    assert answer.model_class == ModelClass.FIXED_POINT
    assert "part of the wanted twist refused" in answer.status
    assert "about (-0.32, -0.69) m" in answer.status
    np.testing.assert_allclose(answer.twist.array() + answer.refused.array(), [0.2, 0.0, 0.0], atol=1e-15)


def test_what_the_wheel_would_have_fought_is_what_is_refused(table, rng) -> None:
    model = table(wheel_x=0.2, wheel_y=-0.5, wheel_theta=0.4, mu_x=0.02, mu_y=0.6)
    answer = achievable_twist(model, PlanarTwist(*rng.normal(size=3)))
    impulse = model.inertia @ answer.refused.array()
    across = rotation(0.4)[:, 1]
    size = across @ impulse[:2]
    np.testing.assert_allclose(impulse[:2], size * across, atol=1e-9)
    assert impulse[2] == pytest.approx(model.wheel[0] * impulse[1] - model.wheel[1] * impulse[0])


def test_a_static_object_is_not_moved_and_says_why(table) -> None:
    answer = achievable_twist(table(mass=400.0, mu_ground=0.4), PlanarTwist(0.1, 0.0, 0.1, vz=0.02))
    assert not answer.twist.moves()
    assert answer.refused == PlanarTwist(0.1, 0.0, 0.1, 0.02)
    assert "static object: all of the wanted twist refused" in answer.status
    assert "300 N" in answer.status


def test_an_unconstrained_object_does_as_it_is_told(table) -> None:
    answer = achievable_twist(table(), PlanarTwist(0.1, -0.05, 0.2))
    assert answer.twist == PlanarTwist(0.1, -0.05, 0.2)
    assert answer.status == ""


def test_a_twist_that_is_no_number_is_refused(table) -> None:
    with pytest.raises(ControlError, match="finite"):
        achievable_twist(table(), PlanarTwist(math.nan, 0.0, 0.0))
