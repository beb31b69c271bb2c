"""What the two shopping cart experiments share: episodes of every agent, their rows, their figure (thesis figure 23).

Each agent observes, updates its model, plans with A* in it and pushes. Reward is minus the distance of the cart from
the cross [m]. The thesis prints no numbers for figure 23, only what it shows; that stands beside ours.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.experiments.figures import canvas, save
from pbrl_bringup.experiments.scene_drawing import draw_body, draw_room
from pbrl_bringup.parallel import in_parallel
from pbrl_bringup.paths import config_file
from pbrl_model.agents.domain import Domain
from pbrl_model.agents.domain_file import load_domain
from pbrl_model.agents.episodes import AGENTS, RECOVERED, Episode, run_episode

Array = NDArray[np.float64]

EPISODES, QUICK_EPISODES = 10, 2
QUICK_STEPS = 60
WITHIN = 0.05  # of the true model's final reward
PUSHES = 2  # after which the thesis's PBRL had recovered the true model
SHARE = 0.9  # of the episodes
LABELS = {"truth": "true model", "pbrl": "PBRL", "oo-lwr": "OO-LWR", "lwr": "LWR"}
COLOURS = {"truth": "#222222", "pbrl": "#1f6fb4", "oo-lwr": "#3a9a5b", "lwr": "#d9822b"}


def run_all(seed: int, quick: bool, noise: float) -> tuple[Domain, dict[str, list[Episode]]]:
    """Play every agent's episodes in parallel.

    Args:
        seed: of the first episode; the others follow. All agents start alike in episodes of the same seed.
        quick: fewer and shorter episodes.
        noise: on observations [m], [m/s].
    """
    seeds = range(seed, seed + (QUICK_EPISODES if quick else EPISODES))
    jobs = [(agent, number, noise, quick) for agent in AGENTS for number in seeds]
    played = in_parallel(play, jobs, "episodes")
    episodes: dict[str, list[Episode]] = {agent: [] for agent in AGENTS}
    for episode in played:
        episodes[episode.agent].append(episode)
    return cart_domain(noise, quick), episodes


def play(agent: str, seed: int, noise: float, quick: bool) -> Episode:
    """Play one episode."""
    return run_episode(cart_domain(noise, quick), agent, seed)


def cart_domain(noise: float, quick: bool) -> Domain:
    """Return the domain of `config/experiments/shopping_cart.yaml`."""
    domain = load_domain(config_file("experiments", "shopping_cart"))
    return replace(domain, noise=noise, steps=min(domain.steps, QUICK_STEPS) if quick else domain.steps)


def measured(
    domain: Domain, episodes: Mapping[str, Sequence[Episode]], out: Path, thesis: str, most_pushes: int
) -> Measured:
    """Make rows and details of episodes, and write the figure.

    Args:
        domain: that was played.
        episodes: by agent.
        out: folder of the figure.
        thesis: what it says of its own figure.
        most_pushes: after which PBRL's model is to be recovered.
    """
    save(figure_of(domain, episodes, thesis), out)
    details = {
        "thesis": thesis,
        "final reward [m], mean": {agent: final_reward(each) for agent, each in episodes.items()},
        "episodes that end at the goal": {agent: sum(e.reached for e in each) for agent, each in episodes.items()},
        f"pushes until R^2 >= {RECOVERED}": {
            agent: [e.recovered_after for e in each] for agent, each in episodes.items()
        },
        "pushes until the goal": {agent: [pushes_to_goal(e) for e in each] for agent, each in episodes.items()},
        "reward [m], mean over episodes": {
            agent: np.mean([e.reward for e in each], axis=0).round(4).tolist() for agent, each in episodes.items()
        },
    }
    return Measured(rows_of(episodes, most_pushes), details)


def rows_of(episodes: Mapping[str, Sequence[Episode]], most_pushes: int) -> list[Row]:
    """Return the acceptance rows."""
    truth, learned = episodes["truth"], episodes["pbrl"]
    start = float(np.mean([-e.reward[0] for e in truth]))
    short = max(final_reward(truth) - final_reward(learned), 0.0) / start
    count = len(learned)
    finals = {f"{agent.replace('-', '_')}_m": final_reward(each) for agent, each in episodes.items()}
    reached = {
        f"{agent.replace('-', '_')}_at_goal": float(sum(e.reached for e in each)) for agent, each in episodes.items()
    }
    recovered = [e.recovered_after for e in learned]
    return [
        at_most(
            "final reward by which PBRL falls short of the true model's, as a share of the reward at the start",
            short,
            "1",
            WITHIN,
            start_m=-start,
            **finals,
            thesis="PBRL nearly as well as the baseline agent",
        ),
        at_least(
            f"episodes of {count} in which PBRL's model has R^2 >= {RECOVERED} after at most {most_pushes} pushes",
            sum(value <= most_pushes for value in recovered),
            "1",
            float(np.ceil(SHARE * count)),
            median_pushes=float(np.median(recovered)),
            worst_pushes=float(np.max(recovered)),
            thesis="true model recovered after two steps, noise-free",
        ),
        at_least(
            f"episodes of {count} in which PBRL ends at the goal",
            sum(e.reached for e in learned),
            "1",
            float(np.ceil(SHARE * count)),
            **reached,
            thesis="PBRL and OO-LWR reach it, LWR stays behind the wall",
        ),
    ]


def final_reward(episodes: Sequence[Episode]) -> float:
    """Return the mean reward [m] at the end."""
    return float(np.mean([episode.reward[-1] for episode in episodes]))


def pushes_to_goal(episode: Episode) -> float:
    """Return the number of pushes until the goal was reached for good; NaN: never."""
    if not episode.reached:
        return float("nan")
    moved = np.flatnonzero(episode.actions >= 0)
    return float(moved[-1] + 1) if moved.size else 0.0


def figure_of(domain: Domain, episodes: Mapping[str, Sequence[Episode]], thesis: str) -> Figure:
    """Draw the first episode's paths, the reward traces and how right the models were."""
    figure, (left, middle, right) = canvas(3, 15.0, 5.2)
    _draw_paths(left, domain, episodes)
    _draw_rewards(middle, episodes)
    _draw_accuracy(right, episodes)
    figure.suptitle(
        f"Shopping cart, observations with noise of {100.0 * domain.noise:g} cm"
        if domain.noise
        else "Shopping cart, observations without noise"
    )
    figure.supxlabel(f"Thesis: {thesis}", fontsize=9)
    return figure


def _draw_paths(axes: Axes, domain: Domain, episodes: Mapping[str, Sequence[Episode]]) -> None:
    thing = domain.scene.things[0]
    draw_room(axes, domain.scene)
    for agent in ("lwr", "oo-lwr", "truth", "pbrl"):
        path = episodes[agent][0].poses
        axes.plot(
            path[:, 0],
            path[:, 1],
            color=COLOURS[agent],
            lw=1.4 if agent in ("truth", "pbrl") else 0.7,
            label=LABELS[agent],
        )
        draw_body(axes, thing.footprint, path[-1], COLOURS[agent])
    draw_body(axes, thing.footprint, episodes["truth"][0].poses[0], "#999999")
    if thing.goal is not None:
        axes.plot(*thing.goal.pose[:2], "x", color="#c22", ms=11, mew=2.5)
    axes.set_title("paths of the first episode; grey: start, cross: goal", fontsize=10)
    axes.legend(fontsize=8, loc="upper left")


def _draw_rewards(axes: Axes, episodes: Mapping[str, Sequence[Episode]]) -> None:
    for agent, each in episodes.items():
        rewards = np.array([episode.reward for episode in each])
        pushes = np.arange(rewards.shape[1])
        axes.fill_between(pushes, *np.quantile(rewards, [0.1, 0.9], axis=0), color=COLOURS[agent], alpha=0.15, lw=0)
        axes.plot(pushes, rewards.mean(axis=0), color=COLOURS[agent], label=LABELS[agent])
    _root_axis(axes, "reward: minus distance from the goal [m]")
    axes.set_title(f"mean of {len(episodes['pbrl'])} episodes, shaded: 10 to 90 %", fontsize=10)
    axes.legend(fontsize=8)


def _draw_accuracy(axes: Axes, episodes: Mapping[str, Sequence[Episode]]) -> None:
    for agent, each in episodes.items():
        if agent == "truth":
            continue
        missing = 1.0 - np.array([episode.accuracy for episode in each])
        ready = np.flatnonzero(np.isfinite(missing).all(axis=0))
        low, middle, high = np.quantile(np.maximum(missing[:, ready], 1e-8), [0.1, 0.5, 0.9], axis=0)
        axes.fill_between(ready, low, high, color=COLOURS[agent], alpha=0.15, lw=0)
        axes.plot(ready, middle, color=COLOURS[agent], label=LABELS[agent])
    axes.axhline(1.0 - RECOVERED, color="#888", ls=":", lw=1)
    axes.text(
        0.98,
        1.0 - RECOVERED,
        f"R² = {RECOVERED}",
        fontsize=8,
        ha="right",
        va="bottom",
        transform=axes.get_yaxis_transform(),
    )
    axes.axvline(PUSHES, color="#888", ls=":", lw=1)
    axes.set_yscale("log")
    _root_axis(axes, "1 - R² of the model on held-out pushes")
    axes.set_title("median model error; dotted: recovered, two pushes", fontsize=10)


def _root_axis(axes: Axes, label: str) -> None:
    axes.set_xscale("function", functions=(np.sqrt, np.square))
    axes.set_xlim(left=0.0)
    axes.set_xlabel("pushes")
    axes.set_ylabel(label)
