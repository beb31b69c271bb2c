"""Thesis figure 24: observations needed until R^2 >= 0.995, for the ten household objects of figure 25.

Physics-based learning (PBR), locally weighted regression (LWR) and linear regression (LR) get the same noisy
transitions of one object, one more at a time, at most 50; each is scored on 200 transitions without noise, gathered by
the same procedure. Needed is the first number n at which the score reaches 0.995 with n, n + 1 and n + 2 observations.
LWR's bandwidth is learned at every n; a width for each feature was tried and gains nothing.

The thesis's noise, 0.50, has no unit. Its other lengths (a collision radius of 20, table 3) are centimetres if
furniture is to have the size of furniture, so noise is taken as 0.5 cm on places and 0.5 cm/s on velocities of states
after; angles have the noise that moves the object's mass as much, 0.5 cm over its radius of gyration. Half a metre,
or half of each output's own spread, would keep a linear regression of a free object from 0.995 with 50 observations
(its excess error is about sigma^2 8/n), which the thesis's reaches. Two other readings are measured beside, with fewer
repetitions: sigma^2 = 0.50 as figure 26 has it, 0.71 cm; and 0.5 cm on the states before as well, as they are when
nobody tells them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.experiments.accuracy import (
    COLOURS,
    METHODS,
    NOISE_UNIT,
    Predict,
    learn_linear,
    learn_local,
    learn_physics,
    predicted,
    r_squared,
    training_and_test,
)
from pbrl_bringup.experiments.figures import canvas, save
from pbrl_bringup.experiments.household import load_household
from pbrl_bringup.parallel import in_parallel
from pbrl_model.transitions.data import BodyTransitions
from pbrl_model.transitions.model import TransitionPosterior

Array = NDArray[np.float64]

GOAL = 0.995
MOST = 50
"""Observations, as in the thesis."""
NEVER = MOST + 1
IN_A_ROW = 3
SIGMA = 0.50
JUDGED = "sigma 0.50 cm"
READINGS = {
    JUDGED: (SIGMA, False),
    "sigma^2 0.50 (0.71 cm)": (SIGMA**0.5, False),
    "0.50 cm before and after": (SIGMA, True),
}
"""Readings of the thesis's noise: sigma [cm], and whether states before have it too."""
REPETITIONS = {False: (20, 6), True: (3, 0)}
"""Of the reading that is judged and of each other, by whether to be quick."""
THESIS = {
    "LR": "reaches it for none of the five objects with a nonlinear constraint, efficiently for the others",
    "LWR": "reaches it for all but the kitchen table",
    "PBR": "reaches it for all, with the fewest observations but for the bed",
}
THESIS_OF = dict.fromkeys(("shopping_cart", "utility_cart", "dining_table", "office_desk"), "LR not") | {
    "kitchen_table": "LR, LWR not",
    "bed": "PBR worst",
}
"""What figure 24 shows for an object: which learner did not reach the goal."""


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Count the observations that each learner needs for each object, and draw them."""
    names = list(load_household())
    judged, others = REPETITIONS[quick]
    counts = {reading: others if index else judged for index, reading in enumerate(READINGS)}
    jobs = [
        (seed, reading, name, repetition)
        for reading, repetitions in counts.items()
        for name in names
        for repetition in range(repetitions)
    ]
    needed = dict(zip(jobs, in_parallel(trial, jobs, "trials"), strict=True))
    tables = {
        reading: np.array([[needed[seed, reading, name, k] for k in range(repetitions)] for name in names])
        for reading, repetitions in counts.items()
        if repetitions
    }
    save(_figure(names, tables[JUDGED]), out)
    details = {
        "thesis": THESIS,
        "observations needed, median": {reading: _medians(names, table) for reading, table in tables.items()},
        "repetitions": counts,
        "not reached counts as": NEVER,
    }
    return Measured(_rows(tables), details)


def trial(seed: int, reading: str, name: str, repetition: int) -> tuple[int, ...]:
    """Return how many observations each of `METHODS` needs in one repetition with one object."""
    things = load_household()
    sigma, of_start = READINGS[reading]
    rng = np.random.default_rng([seed, list(READINGS).index(reading), list(things).index(name), repetition])
    data, test = training_and_test(rng, things[name], MOST + IN_A_ROW - 1, sigma * NOISE_UNIT, of_start=of_start)
    geometry = things[name].geometry
    before: TransitionPosterior | None = None

    def physics(seen: BodyTransitions) -> Predict:
        nonlocal before
        before = learn_physics(rng, seen, geometry, before)
        return partial(predicted, before)

    return tuple(observations_needed(learner, data, test) for learner in (physics, learn_local, learn_linear))


def observations_needed(
    learn: Callable[[BodyTransitions], Predict], data: BodyTransitions, test: BodyTransitions
) -> int:
    """Return the least n <= 50 at which `learn` reaches 0.995 with n, n + 1 and n + 2 transitions; 51: none."""
    held = 0
    for n in range(1, len(data) + 1):
        held = held + 1 if r_squared(test, learn(data.first(n))(test)) >= GOAL else 0
        if held == IN_A_ROW:
            return n - IN_A_ROW + 1
    return NEVER


def _medians(names: list[str], table: Array) -> dict[str, dict[str, float]]:
    middle = np.median(table, axis=1)
    return {name: dict(zip(METHODS, row.tolist(), strict=True)) for name, row in zip(names, middle, strict=True)}


def _rows(tables: dict[str, Array]) -> list[Row]:
    table = tables[JUDGED]
    reached = (table < NEVER).all(axis=1).sum(axis=0)
    medians = np.median(table, axis=1)
    worst = medians.max(axis=0)
    more = int((table[:, :, 0] > table[:, :, 1:].min(axis=2)).sum())
    rows = [
        at_least(
            f"objects that PBR brings to R^2 {GOAL} in all of {table.shape[1]} repetitions",
            reached[0],
            f"of {len(table)}",
            10,
            LWR=float(reached[1]),
            LR=float(reached[2]),
            thesis="PBR 10, LWR 9, LR 5",
        ),
        at_most("observations, median, PBR's worst object", worst[0], "1", 10, LWR=worst[1], LR=worst[2]),
        at_most(
            "trials in which PBR needs more than LWR or LR", more, f"of {table[:, :, 0].size}", 0, thesis="the bed"
        ),
    ]
    for reading, other in tables.items():
        if reading != JUDGED:
            worst = np.median(other, axis=1).max(axis=0)
            rows.append(
                at_most(
                    f"{reading}: observations, median, PBR's worst object", worst[0], "1", 10, LWR=worst[1], LR=worst[2]
                )
            )
    return rows


def _figure(names: list[str], table: Array) -> Figure:
    """Draw median bars with the range between quartiles, hatched where half of the repetitions never got there."""
    figure, (axes,) = canvas(1, 11.0, 5.0)
    width = 0.27
    for column, method in enumerate(METHODS):
        low, middle, high = np.quantile(table[:, :, column], [0.25, 0.5, 0.75], axis=1)
        place = np.arange(len(names)) + (column - 1) * width
        never = middle >= NEVER
        axes.bar(place[~never], middle[~never], width * 0.92, color=COLOURS[method], label=method)
        axes.bar(
            place[never], MOST, width * 0.92, facecolor="none", edgecolor=COLOURS[method], hatch="///", linewidth=0.6
        )
        top = np.minimum(high, MOST)
        error = np.array([middle - low, top - middle])[:, ~never]
        axes.errorbar(place[~never], middle[~never], error, fmt="none", color="black", capsize=2, linewidth=0.9)
        for x, value, end in zip(place[~never], middle[~never], top[~never], strict=True):
            axes.annotate(f"{value:.3g}", (x, end + 0.6), ha="center", va="bottom", fontsize=8)
    axes.axvline(4.5, color="0.6", linewidth=0.8, linestyle=":")
    axes.set_xticks(range(len(names)), [_label(name) for name in names], fontsize=8)
    axes.set(ylabel=f"observations to $R^2 \\geq {GOAL}$", ylim=(0, MOST * 1.01))
    hatched = Patch(facecolor="none", hatch="///", edgecolor="0.4", label=f"not reached with {MOST}")
    handles, _ = axes.get_legend_handles_labels()
    axes.legend(handles=[*handles, hatched], loc="upper right", fontsize=9, frameon=False)
    axes.set_title(
        f"Figure 24: medians and quartiles of {table.shape[1]} repetitions, noise {SIGMA} cm. "
        "Left five: nonlinear constraint; right five: free",
        fontsize=10,
    )
    return figure


def _label(name: str) -> str:
    """Return an object's name with what the thesis says of it."""
    return "\n".join(
        [*name.split("_"), *([""] if "_" not in name else []), "thesis:", THESIS_OF.get(name, "all reached")]
    )
