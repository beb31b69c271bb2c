"""Figure 35 again: how the time to plan among movable obstacles grows with how many there are.

Offices of 5 to 80 obstacles are drawn, several of each size, in which something has to be moved; in each the next
manipulation is planned from what is believed before anything was pushed. Trials are run one after the other on one
core, so that they do not slow each other down.
"""

from __future__ import annotations

import math
import statistics
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from pbrl_bringup.benches.rows import Measured, Row, at_most
from pbrl_bringup.experiments.namo_scaling_figure import Fit, draw, length_of
from pbrl_bringup.terminal import progress
from pbrl_namo.planner import NamoPlan, plan, prior_beliefs
from pbrl_namo.scene import NamoScene
from pbrl_namo.scenes import random_office

SIZES = (5, 10, 20, 40, 80)
ROOMS = 9
"""Of each size."""
QUICK_ROOMS = 2
SHOWN = 40
"""Obstacles of the room that is drawn."""
EXPONENT, LARGEST = 1.2, 20.0
"""Of seconds over obstacles; seconds of a room of the largest size."""
MOVE, CUT_OFF, NONE = "a move", "cut off", "no move works"
"""What a plan can answer where something has to be moved."""


@dataclass(frozen=True)
class Planned:
    """What became of one room.

    Attributes:
        count: of movable obstacles.
        number: of the room among those of its size.
        process: time on the processor, of drawing the prior belief and of planning [s].
        wall: likewise, on the clock [s].
        believing: the part of `wall` that the prior belief took [s].
        regions: of the free space.
        openings: between them.
        estimated: openings of which it was estimated whether they can be made.
        answer: one of `MOVE`, `CUT_OFF`, `NONE`.
        reason: in words, where there is no move.
    """

    count: int
    number: int
    process: float
    wall: float
    believing: float
    regions: int
    openings: int
    estimated: int
    answer: str
    reason: str


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Plan in all rooms and draw the times, and one room of 40 obstacles, into `out`.

    Args:
        seed: of all rooms and plans.
        quick: two rooms of each size.
        out: folder of the figure.
    """
    trial(seed, SIZES[0], 0)  # compiles, or loads what was compiled
    rooms = [(count, number) for count in SIZES for number in range(QUICK_ROOMS if quick else ROOMS)]
    found: list[Planned] = []
    shown: tuple[NamoScene, NamoPlan] | None = None
    with progress("rooms", len(rooms)) as bar:
        for count, number in rooms:
            done, scene, made = trial(seed, count, number)
            found.append(done)
            if count == SHOWN and (shown is None or seen_of(scene, made) > seen_of(*shown)):
                shown = scene, made
            bar(len(found))
    assert shown is not None
    fit = fitted(found)
    draw(found, fit, *shown, out)
    details = {"rooms": [asdict(each) for each in found], "sizes": [summary(found, count) for count in SIZES]}
    return Measured(rows_of(found, fit), details)


def trial(seed: int, count: int, number: int) -> tuple[Planned, NamoScene, NamoPlan]:
    """Draw an office and plan in it.

    Args:
        seed: of the experiment.
        count: of movable obstacles.
        number: of the room.
    """
    scene = random_office(count, np.random.default_rng([seed, count, number]), move_needed=True)
    process, wall = time.process_time(), time.perf_counter()
    beliefs = prior_beliefs(scene, seed)
    believing = time.perf_counter() - wall
    made = plan(scene, beliefs, seed)
    wall, process = time.perf_counter() - wall, time.process_time() - process
    answer = MOVE if made.chosen is not None else CUT_OFF if made.goal in made.cut_off else NONE
    estimated = sum(each is not None for each in made.estimates)
    regions, openings = len(made.free.regions), len(made.openings)
    done = Planned(count, number, process, wall, believing, regions, openings, estimated, answer, made.reason)
    return done, scene, made


def seen_of(scene: NamoScene, made: NamoPlan) -> float:
    """Return how much there is to see of a plan: how far something is moved [m]; less where that opens no way yet."""
    if made.chosen is None or made.chosen.plan is None:
        return -1.0
    return 0.0 if made.chosen.opening.then else length_of(scene, made.chosen.plan)


def fitted(found: Sequence[Planned]) -> Fit:
    """Fit a power law to the medians of each size, by least squares on logarithms."""
    sizes = sorted({each.count for each in found})
    medians = [statistics.median(each.process for each in found if each.count == size) for size in sizes]
    exponent, constant = np.polyfit(np.log(sizes), np.log(medians), 1)
    return Fit(tuple(sizes), tuple(medians), float(exponent), math.exp(constant))


def rows_of(found: Sequence[Planned], fit: Fit) -> list[Row]:
    """Return the rows of the experiment."""
    largest = max(each.count for each in found)
    many = [each for each in found if each.count == largest]
    walls = [statistics.median(each.wall for each in found if each.count == size) for size in fit.sizes]
    by_clock = float(np.polyfit(np.log(fit.sizes), np.log(walls), 1)[0])
    answers = {answer: float(sum(each.answer == answer for each in found)) for answer in (MOVE, CUT_OFF, NONE)}
    return [
        at_most(
            f"exponent of planning time over obstacles, {min(fit.sizes)} to {largest}",
            fit.exponent,
            "1",
            EXPONENT,
            by_the_clock=by_clock,
            thesis="linear, more than 30 obstacles (figure 35)",
        ),
        at_most(
            f"planning time with {largest} obstacles, largest of {len(many)} rooms",
            max(each.wall for each in many),
            "s",
            LARGEST,
            median=statistics.median(each.wall for each in many),
            **answers,
        ),
    ]


def summary(found: Sequence[Planned], count: int) -> dict[str, object]:
    """Return what became of the rooms of one size."""
    own = [each for each in found if each.count == count]
    return {
        "obstacles": count,
        "median_process": statistics.median(each.process for each in own),
        "median_wall": statistics.median(each.wall for each in own),
        "largest_wall": max(each.wall for each in own),
        "median_believing": statistics.median(each.believing for each in own),
        "median_regions": statistics.median(each.regions for each in own),
        "median_openings": statistics.median(each.openings for each in own),
        "answers": dict(Counter(each.answer for each in own)),
    }
