"""Episodes: the agent with the true model arrives, the same seed gives the same episode, faults are told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrl_model.agents.domain import Domain, Goal
from pbrl_model.agents.episodes import run_episode
from pbrl_model.errors import ModelError


def test_the_true_model_reaches_the_goal_round_the_wall(cart: Domain) -> None:
    episode = run_episode(replace(cart, steps=45), "truth", 3)
    assert episode.reached and episode.reward[-1] > -0.05
    assert episode.recovered_after == 0.0
    assert episode.poses[:, 1].max() > 2.6  # there is no other way than over the wall's end
    assert (episode.actions[-3:] == -1).all()


def test_pbrl_reaches_the_goal_and_its_model_is_recovered_after_two_pushes(cart: Domain) -> None:
    episode = run_episode(replace(cart, steps=45), "pbrl", 3)
    assert episode.reached
    assert episode.recovered_after <= 2.0


@pytest.mark.parametrize("agent", ["truth", "lwr", "oo-lwr", "pbrl"])
def test_the_same_seed_gives_the_same_bytes(cart: Domain, agent: str) -> None:
    short = replace(cart, steps=4 if agent == "pbrl" else 24, noise=0.0025)
    first, again, other = (run_episode(short, agent, seed) for seed in (5, 5, 6))
    assert first.poses.tobytes() == again.poses.tobytes()
    assert first.accuracy.tobytes() == again.accuracy.tobytes()
    assert first.poses.tobytes() != other.poses.tobytes()


def test_agents_of_one_seed_start_alike(cart: Domain) -> None:
    starts = [run_episode(replace(cart, steps=1), agent, 7).poses[0] for agent in ("truth", "lwr", "pbrl")]
    np.testing.assert_array_equal(starts[0], starts[1])
    np.testing.assert_array_equal(starts[0], starts[2])


def test_a_goal_in_a_wall_ends_with_a_sentence_and_not_in_a_loop(cart: Domain) -> None:
    thing = cart.scene.things[0]
    walled = replace(thing, goal=Goal(np.array([2.47, 0.5, np.nan]), 0.03))
    domain = replace(cart, scene=replace(cart.scene, things=(walled,)), steps=3)
    episode = run_episode(domain, "truth", 0)
    assert not episode.reached
    assert all("no plan" in status for status in episode.statuses)


def test_faults_are_told_in_a_line(cart: Domain, apartment: Domain) -> None:
    with pytest.raises(ModelError, match="agent: expected one of truth"):
        run_episode(cart, "pbr", 0)
    with pytest.raises(ModelError, match="expected one object"):
        run_episode(apartment, "truth", 0)
