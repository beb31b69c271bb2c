"""Newton's third law, gaps between footprints, and the cutting of touches."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_model.contact.episodes import runs
from pbrl_model.contact.wrench import HeldBody, contact_wrench, felt_wrench, free_wrench, gaps
from pbrl_model.geometry import mass_properties
from pbrl_model.parameters import BodyParameters
from pbrl_model.sensing.motion import Motion
from pbrl_model.world import BodySpec, PhysicsWorld

Array = NDArray[np.float64]

SQUARE = np.array([[-0.4, -0.4], [0.4, -0.4], [0.4, 0.4], [-0.4, 0.4]])
LONG = SQUARE * np.array([2.0, 1.0])
DT, STEPS = 0.002, 600
MASS, OTHER = 9.0, 20.0


def _collide(push: Array, bias: Array) -> tuple[HeldBody, Motion, Array]:
    """Push a square into a long table that is free to move; return the held body, its motion, the other's states."""
    world = PhysicsWorld(DT)
    world.add_body(BodySpec("square", SQUARE, BodyParameters(mass=MASS), np.array([0.0, -0.9, 0.2])))
    world.add_body(BodySpec("long", LONG, BodyParameters(mass=OTHER), np.array([0.3, 0.1, 0.1])))
    mine, other = [world.com_state("square")], [world.com_state("long")]
    for _ in range(STEPS):
        world.apply_wrench("square", push)
        world.step()
        mine.append(world.com_state("square"))
        other.append(world.com_state("long"))
    state = np.array(mine)
    heading = 0.5 * (state[1:, 2] + state[:-1, 2])
    c, s = np.cos(heading), np.sin(heading)
    shown = push - np.stack([c * bias[0] - s * bias[1], s * bias[0] + c * bias[1], 0.0 * c + bias[2]], -1)
    motion = Motion(
        "square",
        ("left",),
        DT,
        np.linspace(0.0, DT * STEPS, STEPS + 1),
        shown,
        np.empty(0),
        np.empty((0, 3)),
        state,
        np.zeros((STEPS + 1, 6, 6)),
        np.full(3, 1e-3),
        True,
    )
    return HeldBody(BodyParameters(mass=MASS), mass_properties(SQUARE), bias), motion, np.array(other)


@pytest.fixture(scope="module")
def collision() -> tuple[HeldBody, Motion, Array]:
    return _collide(np.array([1.0, 25.0, 0.5]), np.array([0.4, -0.7, 0.1]))


def test_the_force_on_the_other_is_what_changes_its_momentum(collision: tuple[HeldBody, Motion, Array]) -> None:
    held, motion, other = collision
    gained = OTHER * np.diff(other[:, 3:5], axis=0) / DT
    assert np.abs(gained).max() > 20.0  # they did collide
    np.testing.assert_allclose(contact_wrench(held, motion, other[:, :2])[:, :2], gained, atol=1e-9)


def test_the_torque_on_the_other_is_what_changes_its_spin(collision: tuple[HeldBody, Motion, Array]) -> None:
    held, motion, other = collision
    inertia = OTHER * mass_properties(LONG).inertia_per_mass
    torque = contact_wrench(held, motion, other[:, :2])[:, 2]
    # The impact of one step moves the centres within that step, by which its lever is not known better.
    assert abs(np.sum(torque) * DT - inertia * other[-1, 5]) < 0.01 * inertia * np.abs(other[:, 5]).max()


def test_nothing_acts_while_nothing_is_touched() -> None:
    held, motion, other = _collide(np.array([0.5, -3.0, 0.3]), np.array([0.2, 0.3, -0.1]))
    assert np.all(other[:, 3:] == 0.0)
    np.testing.assert_allclose(free_wrench(held, motion), 0.0, atol=1e-9)


def test_the_bias_turns_with_the_held_body(collision: tuple[HeldBody, Motion, Array]) -> None:
    held, motion, _ = collision
    np.testing.assert_allclose(felt_wrench(held, motion), np.tile([1.0, 25.0, 0.5], (STEPS, 1)), atol=1e-12)


def test_gaps_of_known_places_and_their_invariance() -> None:
    first = np.array([[0.0, -1.0, 0.0], [0.0, -0.8, 0.0], [0.0, -1.0 - 0.4 * np.sqrt(2.0), np.pi / 4.0]])
    second = np.zeros((3, 3))
    expected = np.array([0.2, 0.0, 0.6 + 0.0])
    np.testing.assert_allclose(gaps(SQUARE, first, LONG, second), expected, atol=1e-12)
    angle, shift = 0.7, np.array([3.0, -2.0])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def moved(pose: Array) -> Array:
        return np.concatenate([pose[:, :2] @ turn.T + shift, pose[:, 2:] + angle], -1)

    np.testing.assert_allclose(gaps(SQUARE, moved(first), LONG, moved(second)), expected, atol=1e-12)


@pytest.mark.parametrize("padding", [0, 1, 3])
def test_runs_cover_the_mask_and_are_apart(padding: int) -> None:
    rng = np.random.default_rng(padding)
    mask = rng.random(200) < 0.1
    found = runs(mask, padding, 0)
    covered = np.zeros(200, dtype=bool)
    for first, last in found:
        assert mask[first : last + 1].any()
        covered[first : last + 1] = True
    if padding:  # a single step is no stretch
        assert np.all(covered[mask])
    assert all(after[0] > before[1] + 1 for before, after in pairwise(found))
    assert runs(np.zeros(5, dtype=bool), padding, 0) == []
