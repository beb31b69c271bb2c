"""Several bodies: the kernel where nothing touches, Chipmunk where something may."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_model.engines.contact_world import ContactScene, contact_scene, rollout_contact, start_states
from pbrl_model.engines.several_bodies import needs_contact, rollout_bodies
from pbrl_model.parameters import BodyParameters

Array = NDArray[np.float64]

SQUARE = np.array([[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]])
CORNER = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.2], [0.2, 0.2], [0.2, 1.0], [0.0, 1.0]])
ROOM = np.array([[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]])


def rows_of(*bodies: BodyParameters) -> Array:
    return np.array([[*body.to_vector(), 0.2, 0.5] for body in bodies])


def still(scene: ContactScene, poses: list[list[float]]) -> Array:
    return start_states(scene, np.array(poses))[None, None]


def test_worlds_are_rolled_out_by_the_engine_they_need_and_agree_with_contact_everywhere() -> None:
    scene = contact_scene([SQUARE, SQUARE, CORNER], [ROOM])
    bodies = BodyParameters(10.0), BodyParameters(20.0, 0.2, 0.1, 0.4, 0.02, 0.5), BodyParameters(15.0, mu_ground=0.02)
    rng = np.random.default_rng(0)
    start = start_states(scene, np.array([[-1.2, -1.0, 0.2], [0.9, -1.0, -0.1], [-0.3, 0.5, 0.4]]))
    wrench = np.tile((rng.normal(size=(40, 1, 3, 3)) * [4.0, 4.0, 0.5]), (1, 150, 1, 1))
    states, touching = rollout_bodies(scene, rows_of(*bodies), start, wrench)
    assert 5 < touching.sum() < 35  # both engines had work
    reference = rollout_contact(scene, rows_of(*bodies), start, wrench)
    np.testing.assert_array_equal(states[touching], reference[touching])
    np.testing.assert_allclose(states[~touching], reference[~touching], rtol=0, atol=1e-9)


def test_one_world_is_a_world() -> None:
    scene = contact_scene([SQUARE])
    states, touching = rollout_bodies(scene, rows_of(BodyParameters(5.0)), np.zeros((1, 6)), np.ones((20, 1, 3)))
    assert states.shape == (1, 21, 1, 6) and touching.tolist() == [False]


@pytest.mark.parametrize("gap", [-0.05, 0.0005, 0.002, 0.1])
def test_bodies_and_walls_may_touch_where_they_are_nearer_than_the_margin(gap: float) -> None:
    pair = contact_scene([SQUARE, SQUARE])
    assert needs_contact(pair, still(pair, [[0, 0, 0], [0.6 + gap, 0.1, 0]])).tolist() == [gap < 1e-3]
    corners = contact_scene([SQUARE, SQUARE])  # tip to side, at 45 degrees
    reach = 0.3 + 0.3 * np.sqrt(2.0)
    assert needs_contact(corners, still(corners, [[0, 0, 0], [reach + gap, 0.0, np.pi / 4]])).tolist() == [gap < 1e-3]
    walled = contact_scene([SQUARE], [ROOM])  # a wall is 2 cm thick to each side
    assert needs_contact(walled, still(walled, [[1.68 - gap, 0.5, 0.0]])).tolist() == [gap < 1e-3]


def test_a_body_in_the_notch_of_another_does_not_touch_it() -> None:
    scene = contact_scene([CORNER, SQUARE])
    assert needs_contact(scene, still(scene, [[0, 0, 0], [0.6, 0.6, 0]])).tolist() == [False]
    assert needs_contact(scene, still(scene, [[0, 0, 0], [0.6, 0.45, 0]])).tolist() == [True]


def test_one_touch_in_a_window_is_enough_and_windows_are_told_apart() -> None:
    scene = contact_scene([SQUARE, SQUARE])
    far = np.tile(still(scene, [[0, 0, 0], [1.5, 0, 0]]), (3, 40, 1, 1))
    far[1, 17, 1, 0] = 0.55
    assert needs_contact(scene, far).tolist() == [False, True, False]


def test_a_body_that_was_lost_from_sight_may_touch() -> None:
    scene = contact_scene([SQUARE, SQUARE])
    seen = np.tile(still(scene, [[0, 0, 0], [1.5, 0, 0]]), (2, 4, 1, 1))
    seen[0, 2, 1, 0] = np.nan
    assert needs_contact(scene, seen).tolist() == [True, False]


def test_joined_bodies_always_need_chipmunk() -> None:
    scene = contact_scene([SQUARE, SQUARE], joins=[[0, 1, 0, 0, 0, 0, 5.0]])
    assert needs_contact(scene, still(scene, [[0, 0, 0], [5, 0, 0]])).tolist() == [True]
