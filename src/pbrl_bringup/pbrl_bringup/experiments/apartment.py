"""Thesis figure 23c: eleven things in an apartment, learned by pushing them, then brought to their places.

The thesis gave its PBRL agent a categorical prior over modes learned beforehand, since Metropolis under the continuous
prior of table 2 mixed too slowly. Here the prior is the continuous one, of every parameter of all eleven at once, with
the class of constraint (none, a wheel, a pivot) left to the evidence; the agent makes a few pushes of its own choosing,
and plans in the posterior's mean. OO-LWR gets the thesis's 1000 observations, with pushes of the right strength as a
gift, and more pushes to reach the goals by; its searches are of bounded size.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pbrl_bringup.benches.rows import Measured, Row, at_least
from pbrl_bringup.experiments.cart_pushing import COLOURS, LABELS
from pbrl_bringup.experiments.figures import canvas, save
from pbrl_bringup.experiments.scene_drawing import draw_body, draw_room
from pbrl_bringup.parallel import in_parallel
from pbrl_bringup.paths import config_file
from pbrl_model.agents.apartment import Rearranged, play_oo_lwr, play_pbrl, play_truth
from pbrl_model.agents.domain import Domain
from pbrl_model.agents.domain_file import load_domain

Array = NDArray[np.float64]

SEEDS = {"pbrl": (10, 1), "truth": (3, 1), "oo-lwr": (2, 1)}
"""Episodes of each agent: in full, quick. Episodes of the same seed start alike."""
OBSERVATIONS, QUICK_OBSERVATIONS = 1000, 110
PUSHES, QUICK_PUSHES = 200, 20
NEEDED = 0.8
THESIS = (
    "PBRL, its prior a choice among modes learned beforehand, quickly gets a model and a viable plan; OO-LWR has none\n"
    "after 1000 observations (figure 23c). Ours: the continuous prior of table 2, jointly over all eleven."
)


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Play the episodes and compare the agents."""
    jobs = [(agent, seed + k, quick) for agent, counts in SEEDS.items() for k in range(counts[quick])]
    episodes: dict[str, list[Rearranged]] = {agent: [] for agent in SEEDS}
    for episode in in_parallel(play, jobs, "episodes"):
        episodes[episode.agent].append(episode)
    domain = apartment_domain()
    save(figure_of(domain, episodes), out)
    return Measured(rows_of(episodes), details_of(domain, episodes))


def play(agent: str, seed: int, quick: bool) -> Rearranged:
    """Play one episode of an agent."""
    domain = apartment_domain()
    if agent == "truth":
        return play_truth(domain, seed)
    if agent == "pbrl":
        return play_pbrl(domain, seed)[0]
    budgets = (QUICK_OBSERVATIONS, QUICK_PUSHES) if quick else (OBSERVATIONS, PUSHES)
    return play_oo_lwr(domain, seed, *budgets)


def apartment_domain() -> Domain:
    """Return the domain of `config/experiments/apartment.yaml`."""
    return load_domain(config_file("experiments", "apartment"))


def rows_of(episodes: Mapping[str, Sequence[Rearranged]]) -> list[Row]:
    """Return the acceptance row."""
    learned, truth, local = episodes["pbrl"], episodes["truth"], episodes["oo-lwr"]
    count = len(learned)
    return [
        at_least(
            f"seeds of {count} in which a plan reaches all goal poses, physics learned under the continuous prior",
            sum(episode.success for episode in learned),
            "1",
            float(np.ceil(NEEDED * count)),
            goals_reached=float(np.mean([np.mean(list(e.reached.values())) for e in learned])),
            median_pushes_to_learn=float(np.median([e.learning for e in learned])),
            median_pushes_to_plan_end=float(np.median([len(e.reward) - 1 - e.learning for e in learned])),
            true_model_successes=f"{sum(e.success for e in truth)} of {len(truth)}",
            oo_lwr_successes=f"{sum(e.success for e in local)} of {len(local)} after {local[0].learning} observations",
            thesis="PBRL plans under a categorical prior; OO-LWR has no plan after 1000 observations",
        )
    ]


def details_of(domain: Domain, episodes: Mapping[str, Sequence[Rearranged]]) -> dict[str, object]:
    """Return what report.json holds beside the rows."""
    truth = {
        name: "revolute" if physics.parameters.has_hinge else "wheel" if physics.parameters.has_wheel else "free"
        for name, physics in domain.truth.items()
    }
    return {
        "thesis": THESIS,
        "tolerances": {
            thing.name: [thing.goal.position_tolerance, thing.goal.heading_tolerance]
            for thing in domain.scene.things
            if thing.goal is not None
        },
        "episodes": [
            {
                "agent": each.agent,
                "seed": each.seed,
                "all goals reached": each.success,
                "reached": each.reached,
                "distance [m]": each.distance,
                "pushes to learn": each.learning,
                "pushes in all": len(each.reward) - 1,
                "classes found right": sum(truth[name] == found for name, found in each.classes.items()),
                "inferences converged": each.converged,
                "plans": each.plans,
                "notes": each.notes,
            }
            for agent in episodes
            for each in episodes[agent]
        ],
    }


def figure_of(domain: Domain, episodes: Mapping[str, Sequence[Rearranged]]) -> Figure:
    """Draw the first episode of PBRL before and after, and the reward traces."""
    figure, (before, after, traces) = canvas(3, 17.0, 5.4)
    shown = episodes["pbrl"][0]
    _draw_state(before, domain, shown.states[0], "start; dashed: goals")
    _draw_state(
        after, domain, shown.states[-1], f"PBRL's end after {len(shown.reward) - 1} pushes, with the ways taken"
    )
    for index, thing in enumerate(domain.scene.things):
        if thing.goal is not None:
            after.plot(*shown.states[:, index, :2].T, color="#1f6fb4", lw=0.8, alpha=0.8)
    for agent, each in episodes.items():
        _draw_traces(traces, agent, each)
    traces.set_xlabel("pushes")
    traces.set_ylabel("reward: minus mean distance from the goals [m]")
    traces.set_xscale("function", functions=(np.sqrt, np.square))
    traces.set_xlim(left=0.0)
    traces.set_ylim(top=0.1)
    traces.set_title("mean, shaded: least to most", fontsize=10)
    traces.legend(fontsize=8, loc="lower right")
    figure.suptitle("Apartment: eleven things, eight with goals")
    figure.supxlabel(f"Thesis: {THESIS}", fontsize=9)
    return figure


def _draw_state(axes: Axes, domain: Domain, poses: Array, title: str) -> None:
    draw_room(axes, domain.scene)
    for thing, pose in zip(domain.scene.things, poses, strict=True):
        physics = domain.truth[thing.name].parameters
        colour = "#b05fb0" if physics.has_hinge else "#1f6fb4" if physics.has_wheel else "#777777"
        draw_body(axes, thing.footprint, pose, colour, filled=True)
        axes.text(pose[0], pose[1], thing.name.replace("_", "\n"), fontsize=5.5, ha="center", va="center")
        if thing.goal is not None:
            goal = np.array([*thing.goal.pose[:2], np.nan_to_num(thing.goal.pose[2])])
            draw_body(axes, thing.footprint, goal, "#cc2222", style="--")
    axes.set_title(f"{title}\nblue: with a wheel, violet: pinned, grey: free", fontsize=9)


def _draw_traces(axes: Axes, agent: str, episodes: Sequence[Rearranged]) -> None:
    longest = max(len(episode.reward) for episode in episodes)
    rewards = np.array([np.pad(e.reward, (0, longest - len(e.reward)), mode="edge") for e in episodes])
    pushes = np.arange(longest)
    axes.fill_between(pushes, rewards.min(axis=0), rewards.max(axis=0), color=COLOURS[agent], alpha=0.15, lw=0)
    axes.plot(pushes, rewards.mean(axis=0), color=COLOURS[agent], label=f"{LABELS[agent]} ({len(episodes)} episodes)")
    if agent == "pbrl":
        done = float(np.median([episode.learning for episode in episodes]))
        axes.axvline(done, color=COLOURS[agent], ls=":", lw=1)
        axes.text(done, axes.get_ylim()[0], " learned", fontsize=8, color=COLOURS[agent], va="bottom")
