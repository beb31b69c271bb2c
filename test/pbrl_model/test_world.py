"""The pymunk world: contact, restitution, joints between bodies, walls, and what it refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrl_model.errors import ModelError
from pbrl_model.parameters import BodyParameters
from pbrl_model.world import BodySpec, PhysicsWorld, simulate_body

SQUARE = np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])
CORNER = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.2], [0.2, 0.2], [0.2, 1.0], [0.0, 1.0]])
ROOM = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def body(name: str, x: float, vx: float, mass: float = 2.0, restitution: float = 0.0) -> BodySpec:
    return BodySpec(
        name, SQUARE, BodyParameters(mass), np.array([x, 0.0, 0.0]), np.array([vx, 0.0, 0.0]), restitution, 0.0
    )


@pytest.mark.parametrize("bounce", [0.0, 0.5, 1.0])
def test_collision_keeps_momentum_and_restitution_sets_the_relative_velocity(bounce: float) -> None:
    world = PhysicsWorld(dt=0.001)
    world.add_body(body("a", -0.3, 1.0, 2.0, 1.0))
    world.add_body(body("b", 0.3, -0.5, 3.0, bounce))
    for _ in range(600):
        world.step()
    a, b = world.com_state("a"), world.com_state("b")
    assert 2.0 * a[3] + 3.0 * b[3] == pytest.approx(2.0 * 1.0 - 3.0 * 0.5, abs=1e-9)
    assert b[3] - a[3] == pytest.approx(bounce * 1.5, abs=0.02)


def test_wall_stops_a_body_and_its_own_restitution_counts() -> None:
    world = PhysicsWorld(dt=0.001)
    world.add_walls(ROOM)
    world.add_body(body("a", 0.5, 1.0, restitution=0.5))
    for _ in range(800):
        world.step()
    assert world.com_state("a")[3] == pytest.approx(-0.5, abs=0.01)
    assert world.pose("a")[0] < 0.9


def test_bodies_joined_turn_about_their_common_centre() -> None:
    world = PhysicsWorld()
    world.add_body(replace(body("a", -0.5, 0.0), velocity=np.array([0.0, -0.4, 0.0])))
    world.add_body(replace(body("b", 0.5, 0.0), velocity=np.array([0.0, 0.4, 0.0])))
    world.join("a", "b", (0.0, 0.0), (0.0, 0.0), 1.0)
    for _ in range(500):
        world.step()
        a, b = world.pose("a"), world.pose("b")
        assert np.hypot(*(a - b)[:2]) == pytest.approx(1.0, abs=2e-3)
    np.testing.assert_allclose((a + b)[:2], 0.0, atol=1e-9)


def test_concave_body_can_be_entered_where_its_hull_could_not() -> None:
    world = PhysicsWorld()
    world.add_body(BodySpec("corner", CORNER, BodyParameters(10.0), np.zeros(3)))
    world.add_body(BodySpec("guest", SQUARE, BodyParameters(1.0), np.array([0.45, 0.45, 0.0])))
    for _ in range(50):
        world.step()
    np.testing.assert_allclose(world.pose("guest"), [0.45, 0.45, 0.0], atol=1e-9)
    np.testing.assert_allclose(world.pose("corner"), 0.0, atol=1e-9)


def test_wrench_lasts_one_step() -> None:
    world = PhysicsWorld()
    world.add_body(body("a", 0.0, 0.0))
    world.apply_wrench("a", (3.0, 0.0, 0.0))
    world.apply_wrench("a", (1.0, 0.0, 0.0))
    world.step()
    world.step()
    assert world.com_state("a")[3] == pytest.approx(4.0 / 2.0 * 0.01)
    assert world.kinetic_energy("a") == pytest.approx(0.5 * 2.0 * 0.02**2)


def test_same_input_gives_the_same_bytes() -> None:
    spec = replace(body("a", 0.0, 0.3), parameters=BodyParameters(2.0, 0.05, 0.05, 0.3, 0.01, 0.4))
    wrench = np.tile([1.0, 0.5, 0.1], (50, 1))
    assert simulate_body(spec, wrench).tobytes() == simulate_body(spec, wrench).tobytes()


BAD = {
    "mass": {"parameters": BodyParameters(-1.0)},
    "nan": {"parameters": BodyParameters(1.0, wheel_x=float("nan"))},
    "nan beside a hinge": {"parameters": BodyParameters(float("nan"), hinge_radius=0.1)},
    "mu_ground": {"parameters": BodyParameters(1.0, mu_ground=-0.01)},
    "radius": {"parameters": BodyParameters(1.0, hinge_radius=-0.1)},
    "infinite": {"parameters": BodyParameters(1.0, hinge_radius=float("inf"))},
    "pose": {"pose": np.array([0.0, np.nan, 0.0])},
    "velocity": {"velocity": np.zeros(2)},
    "footprint": {"footprint": np.array([[0, 0], [1, 1], [1, 0], [0, 1.0]])},
}


@pytest.mark.parametrize("fields", BAD.values(), ids=BAD.keys())
def test_unphysical_bodies_are_refused_in_one_line(fields: dict[str, object]) -> None:
    world = PhysicsWorld()
    with pytest.raises(ModelError) as caught:
        world.add_body(replace(body("a", 0.0, 0.0), **fields))  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


def test_names_are_unique_and_known() -> None:
    world = PhysicsWorld()
    world.add_body(body("a", 0.0, 0.0))
    assert world.names == ("a",)
    with pytest.raises(ModelError, match="'a' twice"):
        world.add_body(body("a", 1.0, 0.0))
    with pytest.raises(ModelError, match="expected one of a, got 'b'"):
        world.pose("b")
    with pytest.raises(ModelError, match="radius"):
        world.join("a", "a", (0, 0), (0, 0), -1.0)
    with pytest.raises(ModelError, match="dt"):
        PhysicsWorld(dt=0.0)
