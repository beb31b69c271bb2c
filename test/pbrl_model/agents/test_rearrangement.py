"""Several bodies: an order that works, one put aside, one that cannot be reached; the joint posterior."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pbrl_model.agents.apartment import play_oo_lwr, play_pbrl, play_truth
from pbrl_model.agents.domain import Domain, Goal
from pbrl_model.agents.joint_posterior import JointLearner, simulate_push, touches
from pbrl_model.agents.room import Push, Room

Boxes = Callable[[bool], Domain]


def test_the_true_model_rearranges_the_apartment(apartment: Domain) -> None:
    episode = play_truth(apartment, 0)
    assert episode.success and not any("not reached" in note for note in episode.notes)
    assert episode.reward[-1] > -0.08 > episode.reward[0]
    assert play_truth(apartment, 0).states.tobytes() == episode.states.tobytes()


def test_what_stands_in_the_door_goes_first_or_is_put_aside(two_boxes: Boxes) -> None:
    with_goal = play_truth(two_boxes(True), 0)
    assert with_goal.success and with_goal.plans[0][0] == "small"
    without = play_truth(two_boxes(False), 0)
    assert without.success and any("small: put aside for large" in note for note in without.notes)


def test_a_goal_that_cannot_be_reached_is_told(two_boxes: Boxes) -> None:
    domain = two_boxes(True)
    large, small = domain.scene.things
    behind = replace(large, goal=Goal(np.array([9.0, 9.0, np.nan]), 0.1))
    episode = play_truth(replace(domain, scene=replace(domain.scene, things=(behind, small))), 0)
    assert not episode.success and "large: its goal was not reached" in episode.notes


def test_everything_is_learned_by_pushing_and_brought_to_its_place(two_boxes: Boxes) -> None:
    domain = replace(two_boxes(True), noise=0.001)
    episode, posterior = play_pbrl(domain, 1)
    assert episode.success
    assert set(episode.classes.values()) == {"free"}
    assert posterior.rows.shape[1:] == (2, 12)
    assert 2 <= episode.learning <= 40


def test_regression_with_a_small_budget_ends(two_boxes: Boxes) -> None:
    episode = play_oo_lwr(two_boxes(True), 0, 20, 10)
    assert len(episode.reward) <= 31 and "conditions of contact" in episode.notes[0]


def pushed(domain: Domain, start: np.ndarray, wrench: list[float]) -> Push:
    return Room(domain, start).push(0, np.array(wrench), 0.3)


def test_touch_is_seen_in_the_geometry(two_boxes: Boxes) -> None:
    domain = two_boxes(False)
    start = domain.scene.start
    assert not touches(domain.scene, pushed(domain, start, [30.0, 0.0, 0.0]))
    start[0, :2] = [1.5, 1.0]  # 5 cm from the small box
    assert touches(domain.scene, pushed(domain, start, [60.0, 0.0, 0.0]))


def test_a_push_with_contact_tells_of_the_body_that_was_not_pushed(two_boxes: Boxes) -> None:
    domain = two_boxes(False)
    learner = JointLearner(np.random.default_rng(0), domain.scene)
    assert learner.observe(pushed(domain, domain.scene.start, [40.0, 10.0, 2.0]))
    learner.learn(0)
    before = learner.joint(400)
    assert any("small: never pushed" in note for note in before.notes)
    start = domain.scene.start
    start[0, :2] = [1.5, 1.0]
    crash = pushed(domain, start, [60.0, 0.0, 0.0])
    assert not learner.observe(crash)
    after = learner.joint(400)
    errors = [
        np.abs(simulate_push(domain.scene, each.rows, each.coefficients, crash)[:, 1, 0] - crash.after[1, 0]).mean()
        for each in (before, after)
    ]
    assert errors[1] < 0.5 * errors[0]


def test_joint_draws_are_independent_where_nothing_touched(two_boxes: Boxes) -> None:
    domain = two_boxes(False)
    learner = JointLearner(np.random.default_rng(0), replace(domain.scene))
    for index, wrench in ((0, [40.0, 10.0, 2.0]), (1, [-15.0, 2.0, 0.5])):
        far = domain.scene.start
        far[1, :2] = [3.0, 1.0]
        assert learner.observe(Room(domain, far).push(index, np.array(wrench), 0.3))
        learner.learn(index)
    posterior = learner.joint(200)
    masses = np.log(posterior.rows[:, :, 0])
    assert abs(np.corrcoef(masses.T)[0, 1]) < 0.25
    assert posterior.converged.all()
