"""Rows and figures of the agents' experiments, from episodes made by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrl_bringup.benches.rows import Measured
from pbrl_bringup.experiments import apartment, cart_pushing
from pbrl_model.agents.apartment import Rearranged
from pbrl_model.agents.domain import Domain
from pbrl_model.agents.domain_file import load_domain
from pbrl_model.agents.episodes import AGENTS, Episode

CONFIG = Path(__file__).resolve().parents[2] / "config" / "experiments"


def episode(agent: str, final: float, recovered: int, seed: int = 0) -> Episode:
    reward = np.linspace(-3.0, final, 11)
    accuracy = np.where(np.arange(11) < recovered, 0.5, 0.999)
    return Episode(
        agent=agent,
        seed=seed,
        reward=reward,
        poses=np.column_stack([np.linspace(1.0, 4.0, 11), np.ones(11), np.zeros(11)]),
        actions=np.arange(10),
        accuracy=accuracy,
        statuses=("a plan reaches the goal",) * 10,
        expanded=np.ones(10, dtype=np.int64),
        reached=final > -0.03,
    )


def episodes(learned: float, recovered: int) -> dict[str, list[Episode]]:
    finals = {"truth": -0.02, "pbrl": learned, "oo-lwr": -1.0, "lwr": -2.0}
    return {agent: [episode(agent, finals[agent], recovered, seed) for seed in range(10)] for agent in AGENTS}


@pytest.fixture
def cart() -> Domain:
    return load_domain(CONFIG / "shopping_cart.yaml")


def test_rows_hold_where_pbrl_is_as_good_as_the_truth_and_not_where_it_is_not() -> None:
    assert all(row.holds for row in cart_pushing.rows_of(episodes(-0.025, 2), 2))
    short, late, away = cart_pushing.rows_of(episodes(-0.4, 3), 2)
    assert short.value == pytest.approx(0.38 / 3.0) and not short.holds
    assert late.value == 0 and not late.holds
    assert not away.holds


def test_a_model_counts_as_recovered_only_where_it_stays_so() -> None:
    one = episode("pbrl", -0.02, 2)
    assert one.recovered_after == 2.0
    relapsed = one.accuracy.copy()
    relapsed[6] = 0.9
    assert replace(one, accuracy=relapsed).recovered_after == 7.0
    assert np.isnan(replace(one, accuracy=np.full(11, 0.5)).recovered_after)
    assert np.isnan(replace(one, accuracy=np.where(np.arange(11) == 10, np.nan, 0.999)).recovered_after)


def test_the_cart_figure_is_drawn_and_the_same_twice(cart: Domain, tmp_path: Path) -> None:
    measured = cart_pushing.measured(cart, episodes(-0.025, 2), tmp_path, "what it says", 2)
    first = (tmp_path / "figure.png").read_bytes()
    assert isinstance(measured, Measured) and measured.details["thesis"] == "what it says"
    cart_pushing.measured(cart, episodes(-0.025, 2), tmp_path, "what it says", 2)
    assert (tmp_path / "figure.png").read_bytes() == first


def rearranged(domain: Domain, agent: str, success: bool) -> Rearranged:
    states = np.repeat(domain.scene.start[None, :, :3], 6, axis=0)
    goals = [thing.name for thing in domain.scene.things if thing.goal is not None]
    return Rearranged(
        agent=agent,
        seed=0,
        reward=np.linspace(-2.0, -0.05, 6),
        states=states,
        learning=3,
        reached=dict.fromkeys(goals, True) | {goals[0]: success},
        distance=dict.fromkeys(goals, 0.05),
        classes=dict.fromkeys(domain.scene.names, "free"),
        converged=11,
        plans=(("couch", "a plan reaches the goal", 4),),
        notes=(),
    )


def test_the_apartment_row_counts_the_seeds_in_which_all_is_in_place(tmp_path: Path) -> None:
    domain = load_domain(CONFIG / "apartment.yaml")
    played = {
        "pbrl": [rearranged(domain, "pbrl", success) for success in (True,) * 8 + (False,) * 2],
        "truth": [rearranged(domain, "truth", True)],
        "oo-lwr": [rearranged(domain, "oo-lwr", False)],
    }
    (row,) = apartment.rows_of(played)
    assert row.value == 8 and row.holds
    assert not apartment.rows_of(played | {"pbrl": played["pbrl"][1:]})[0].holds
    details = apartment.details_of(domain, played)
    assert details["episodes"][0]["classes found right"] == 8  # type: ignore[index]
    apartment.figure_of(domain, played).savefig(tmp_path / "figure.png")
