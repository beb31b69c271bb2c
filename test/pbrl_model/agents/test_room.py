"""The true world: at rest after a push, walls hold, pins hold, same push same bytes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrl_model.agents.domain import Domain
from pbrl_model.agents.motions import push_ends
from pbrl_model.agents.pushes import SIZES, STRENGTH, fitted_actions, measure
from pbrl_model.agents.room import REST, Observer, Room, jittered


def test_a_push_ends_at_rest_where_the_kernel_has_it_wherever_the_body_stands(cart: Domain) -> None:
    assert cart.actions is not None
    thing, truth = cart.scene.things[0], cart.truth["cart"].parameters
    ends = push_ends(thing, truth.to_vector()[None], cart.actions)[0]
    for action, pose in ((0, [1.2, 2.0, 0.0]), (9, [3.5, 2.0, 2.1]), (14, [1.2, 2.5, -1.0])):
        state = np.array([[*pose, 0.0, 0.0, 0.0]])
        push = Room(cart, state).push(0, cart.actions.in_world(action, pose[2]), float(cart.actions.duration[action]))
        c, s = np.cos(pose[2]), np.sin(pose[2])
        x, y, turn = ends[action]
        np.testing.assert_allclose(
            push.after[0, :3], [pose[0] + c * x - s * y, pose[1] + s * x + c * y, pose[2] + turn], atol=2e-3
        )
        assert np.abs(push.after[0, 3:]).max() <= REST


def test_walls_hold(cart: Domain) -> None:
    room = Room(cart, np.array([[1.9, 1.5, 0.0, 0.0, 0.0, 0.0]]))
    for _ in range(5):
        room.push(0, np.array([60.0, 0.0, 0.0]), 0.3)
    wall = cart.scene.walls[0][:, 0].min()
    assert room.state[0, 0] + cart.scene.things[0].footprint[:, 0].max() < wall + 0.01


def test_what_is_pinned_turns_about_its_pin(apartment: Domain) -> None:
    index = apartment.scene.index("kitchen_table")
    truth = apartment.truth["kitchen_table"].parameters
    room = Room(apartment, jittered(np.random.default_rng(0), apartment))
    room.push(index, np.array([60.0, -80.0, 30.0]), 0.3)
    x, y, theta = room.state[index, :3]
    c, s = np.cos(theta), np.sin(theta)
    anchor = [x + c * truth.anchor_x - s * truth.anchor_y, y + s * truth.anchor_x + c * truth.anchor_y]
    np.testing.assert_allclose(anchor, [truth.hinge_x, truth.hinge_y], atol=2e-3)
    assert abs(theta) > 0.02


def test_the_same_push_gives_the_same_bytes(apartment: Domain) -> None:
    ends = [Room(apartment).push(6, np.array([40.0, 10.0, 3.0]), 0.3).after.tobytes() for _ in range(2)]
    assert ends[0] == ends[1]


def test_observation_is_exact_without_noise_and_says_rest_of_rest(cart: Domain) -> None:
    state = np.array([[1.0, 2.0, 0.3, 0.0, 0.0, 0.0]])
    exact = Observer(np.random.default_rng(0), cart)
    np.testing.assert_array_equal(exact.look(state), state)
    noisy = Observer(np.random.default_rng(0), replace(cart, noise=0.01))
    looks = np.array([noisy.look(state)[0] for _ in range(2000)])
    assert (looks[:, 3:] == 0.0).all()
    lever = float(np.sqrt(cart.scene.things[0].inertia_per_mass))
    np.testing.assert_allclose(looks[:, :3].std(axis=0), [0.01, 0.01, 0.01 / lever], rtol=0.08)


def test_a_push_is_two_transitions_or_one_where_nothing_moved(cart: Domain) -> None:
    moved = Room(cart).push(0, np.array([40.0, 0.0, 0.0]), 0.3)
    assert len(moved.transitions()) == 2 and not moved.transitions().wrench[1].any()
    still = Room(cart).push(0, np.array([2.0, 0.0, 0.0]), 0.3)
    assert still.stood_still and len(still.transitions()) == 1
    assert len(moved.whole()) == 1


@pytest.mark.parametrize("name", ["couch", "chair", "dining_table", "kitchen_table"])
def test_pushes_fitted_to_a_body_move_it_as_far_as_wanted(apartment: Domain, name: str) -> None:
    thing = apartment.scene.things[apartment.scene.index(name)]
    rows = apartment.truth[name].parameters.to_vector()[None]
    actions = fitted_actions(thing, rows)
    far = measure(push_ends(thing, rows, actions)[0])
    assert len(actions) > 30
    wanted = np.abs(far[:, None] - np.array(SIZES)).min(axis=1) < 0.02
    hardest = np.linalg.norm(actions.wrench[:, :2], axis=1) > 0.99 * STRENGTH
    assert (wanted | hardest).all() and wanted.mean() > 0.8
