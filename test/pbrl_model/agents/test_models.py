"""What agents believe: physics is recovered from a push or two, regressions return what they were shown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrl_model.agents.domain import ActionSet, Domain
from pbrl_model.agents.models import LocalModel, ObjectOrientedModel, PhysicsModel, TrueModel
from pbrl_model.agents.room import Observer, Push, Room


def pushes(domain: Domain, seed: int, count: int) -> list[Push]:
    rng = np.random.default_rng(seed)
    room, observer = Room(domain, np.array([[1.3, 2.0, 0.3, 0.0, 0.0, 0.0]])), Observer(rng, domain)
    seen, out = observer.look(room.state), []
    for _ in range(count):
        action = int(rng.integers(len(domain.actions or ())))
        assert domain.actions is not None
        wrench = domain.actions.in_world(action, seen[0, 2])
        out.append(observer.watch(room.push(0, wrench, float(domain.actions.duration[action])), seen))
        seen = out[-1].after
    return out


@pytest.mark.parametrize("seed", [2, 3])  # of pushes that make the wheel roll: one that never did is not yet told apart
def test_physics_is_recovered_from_two_pushes(cart: Domain, seed: int) -> None:
    thing, truth = cart.scene.things[0], cart.truth["cart"].parameters
    model = PhysicsModel(np.random.default_rng(0), thing)
    assert not model.ready
    for push in pushes(cart, seed, 2):
        model.observe(push)
    assert cart.actions is not None
    expected = TrueModel(thing, truth).ends(cart.actions)
    np.testing.assert_allclose(model.ends(cart.actions), expected, atol=0.01)
    assert model.posterior is not None and model.posterior.best_class == "wheel"


def test_with_noise_the_error_is_of_the_noise(cart: Domain) -> None:
    noisy = replace(cart, noise=0.0025)
    model = PhysicsModel(np.random.default_rng(0), cart.scene.things[0])
    for push in pushes(noisy, 2, 5):
        model.observe(push)
    assert cart.actions is not None
    expected = TrueModel(cart.scene.things[0], cart.truth["cart"].parameters).ends(cart.actions)
    assert np.abs(model.ends(cart.actions) - expected).max() < 0.04


@pytest.mark.parametrize("make", [lambda cart: LocalModel(), lambda cart: ObjectOrientedModel(cart.scene)])
def test_a_regression_that_saw_one_push_predicts_it(cart: Domain, make: object) -> None:
    model = make(cart)  # type: ignore[operator]
    (push,) = pushes(cart, 3, 1)
    assert not model.ready
    model.observe(push)
    heading = push.before[0, 2]
    c, s = np.cos(-heading), np.sin(-heading)
    turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    actions = ActionSet((turned @ push.wrench)[None], np.array([push.duration]))
    np.testing.assert_allclose(model.ends(actions)[0], turned @ (push.after - push.before)[0, :3], atol=1e-9)


def test_a_condition_that_was_met_has_a_table_of_its_own(cart: Domain) -> None:
    assert cart.actions is not None
    model = ObjectOrientedModel(cart.scene)
    for push in pushes(cart, 4, 8):
        model.observe(push)
    blocked = Room(cart, np.array([[1.97, 1.0, 0.0, 0.0, 0.0, 0.0]]))
    for _ in range(3):
        model.observe(blocked.push(0, np.array([36.0, 0.0, 0.0]), 0.3))
    assert model.conditions >= 2
    table = model.motions(cart.actions).table[:, :, -1]
    forward = int(np.argmax(cart.actions.wrench @ [1.0, 0.0, 0.0] - np.abs(cart.actions.wrench[:, 2])))
    front = 1  # the sector about the body's x axis is the first bit
    assert table[front, forward, 0] < 0.5 * table[0, forward, 0]
