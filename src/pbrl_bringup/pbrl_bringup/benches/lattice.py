"""The lattice planner: a third party's map and primitives beside SBPL's figures, and carts through doors of offices.

Times are of this process's own work (CPU seconds, one core), the best of several runs on the third party's map, so that
what else the machine does matters little. SBPL's figures were measured by others on the same kind of machine; they are
in `test/data/lattice/README.md`.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pbrl_bringup.benches.lattice_offices import Office, random_office, turn_into_door
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most, within
from pbrl_bringup.paths import workspace
from pbrl_planner.cart import navigator
from pbrl_planner.lattice import (
    ArticulatedBody,
    GeneratorSettings,
    Lattice,
    LatticePlan,
    LatticeProblem,
    LatticeSettings,
    Motions,
    generate,
    plan,
    read_environment,
    read_primitives,
)

OPTIMAL = 119_407
SBPL = {"expansions a second": 230e3, "first plan [s]": 0.92, "epsilon 1 [s], fastest": 7.2}
THESIS = {"first plan [s]": 1.23, "expansions to it": 15158.0}
RUNS = 5
OFFICES = 20
NARROW = 1.8
"""[m] corridor out of which the straight cart gets through no door."""
ORDINARY, ORDINARY_DOOR = 2.4, 38
"""[m] corridor and [cells] door, 0.95 m, of an office where nothing is tight."""
TURNING = (1.9, 2.0, 2.2)
"""[m] corridors out of which it does."""
PATIENCE = 60.0
"""[s] a plan."""


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Measure all rows.

    Args:
        seed: of the offices.
        quick: fewer runs and offices.
        out: folder; nothing is written into it.
    """
    parts = [cubicles(2 if quick else RUNS), offices(seed, 2 if quick else OFFICES), turning(quick)]
    rows = [row for part in parts for row in part.rows]
    return Measured(rows, {name: detail for part in parts for name, detail in part.details.items()})


THINNED = navigator.PATIENCE.thinned
"""Blocks in which the navigator leaves states out to begin with."""


@dataclass(frozen=True)
class Run:
    """One plan and the CPU seconds it took.

    Attributes:
        plan: it.
        bound: seconds until the lower bound was there, wall.
        first: until the first plan as good as the first epsilon asks; inf without one.
        all: until the end.
    """

    plan: LatticePlan
    bound: float
    first: float
    all: float


def timed(problem: LatticeProblem, settings: LatticeSettings) -> Run:
    """Plan, and note the CPU seconds until the first plan that is as good as the first epsilon asks, and the last."""
    seen: list[float] = []
    began = time.process_time()

    def note(made: LatticePlan) -> None:
        if made.epsilon <= settings.epsilon:
            seen.append(time.process_time() - began)

    found = plan(problem, settings, note)
    return Run(found, found.seconds_to_bound, seen[0] if seen else float("inf"), time.process_time() - began)


def cubicles(runs: int) -> Measured:
    """Plan on the third party's map."""
    folder = workspace() / "test/data/lattice"
    environment = read_environment(folder / "cubicle-25mm-inflated-env.cfg.gz")
    motions = Motions(read_primitives(folder / "pr2.mprim"), environment.pace)
    problem = LatticeProblem(Lattice(environment.grid, motions), environment.start, environment.goal)
    settings = LatticeSettings(time_limit=PATIENCE)
    timed(problem, settings)  # compiles, or loads what was compiled
    made = [timed(problem, settings) for _ in range(runs)]
    fastest = min(made, key=lambda run: run.all)
    forward = timed(problem, LatticeSettings(time_limit=PATIENCE, direction="forward"))
    rates = [run.plan.expansions / run.all for run in made]
    rows = [
        within("cubicles: cost at epsilon 1", fastest.plan.cost, "1", OPTIMAL, 0.0, epsilon=fastest.plan.epsilon),
        at_least(
            "cubicles: states expanded a second, one core, lower bound's time included",
            max(rates),
            "1/s",
            1e6,
            SBPL=SBPL["expansions a second"],
            median=statistics.median(rates),
            forward=forward.plan.expansions / forward.all,
        ),
        at_most(
            "cubicles: first plan, epsilon 3, lower bound included",
            min(run.first for run in made),
            "s",
            0.25,
            SBPL=SBPL["first plan [s]"],
            median=statistics.median(run.first for run in made),
            expansions=fastest.plan.history[0].expansions,
            cost=fastest.plan.history[0].cost,
            SBPL_cost=130_588,
        ),
        at_most(
            "cubicles: from nothing to epsilon 1",
            fastest.all,
            "s",
            2.0,
            SBPL=SBPL["epsilon 1 [s], fastest"],
            median=statistics.median(run.all for run in made),
            expansions=fastest.plan.expansions,
            SBPL_expansions=1_580_262,
            forward=forward.all,
        ),
    ]
    return Measured(rows, {"cubicles": [told(run) for run in (*made, forward)]})


def told(run: Run) -> dict[str, Any]:
    """Return what there is to say of a run."""
    return {
        "cpu_seconds": run.all,
        "cpu_seconds_to_first": run.first,
        "cost": run.plan.cost,
        "epsilon": run.plan.epsilon,
        "expansions": run.plan.expansions,
        "exhausted": run.plan.exhausted,
        "reason": run.plan.reason,
        "history": [asdict(each) for each in run.plan.history],
    }


def motion_sets() -> dict[str, Motions]:
    """Return the motions of the PR2 with a cart that may be articulated, and with one that is held straight."""
    body = ArticulatedBody.pr2_with_cart()
    return {
        "articulated": Motions(generate(), None, body),
        "straight": Motions(generate(GeneratorSettings(articulations=1)), None, body),
    }


def solve(office: Office, motions: Motions) -> Run:
    """Plan in an office that is new, as the navigator does: what the sweeps meet is found out within the time."""
    problem = LatticeProblem(Lattice(office.grid, motions), office.start, office.goal)
    return timed(problem, LatticeSettings(time_limit=PATIENCE, direction="forward", thinned=THINNED))


def offices(seed: int, count: int) -> Measured:
    """Plan from a corridor into a room, with a cart that may be articulated and with one held straight."""
    sets = motion_sets()
    for motions in sets.values():
        solve(turn_into_door(NARROW), motions)  # sweeps the primitives
    made: dict[str, list[Run]] = {name: [] for name in sets}
    for number in range(count):
        office = random_office(NARROW, np.random.default_rng([seed, number]))
        for name, motions in sets.items():
            made[name].append(solve(office, motions))
    bent, straight = made["articulated"], made["straight"]
    easy = [
        solve(random_office(ORDINARY, np.random.default_rng([seed, number]), ORDINARY_DOOR), sets["articulated"])
        for number in range(count)
    ]
    passed = sum(a.plan.found and not b.plan.found and b.plan.exhausted for a, b in zip(bent, straight, strict=True))
    found = [run for run in bent if run.plan.found]
    rows = [
        at_least(
            "offices: through a door 10 cm wider than the cart where the straight one proves that it cannot, share",
            passed / count,
            "1",
            1.0,
            offices=float(count),
            straight_found=float(sum(run.plan.found for run in straight)),
        ),
        at_least(
            "offices: plan at epsilon 1, or proof that there is none, share of all",
            _share([run.plan.epsilon == 1.0 or run.plan.exhausted for run in (*bent, *straight, *easy)]),
            "1",
            1.0,
        ),
        first_plan_row(
            "offices with narrow doors: articulated cart, first plan, median", found, THESIS["first plan [s]"]
        ),
        first_plan_row("ordinary offices: articulated cart, first plan, median", easy, 0.05),
    ]
    told_of = {name: [told(run) for run in runs] for name, runs in (made | {"ordinary": easy}).items()}
    return Measured(rows, {"offices": told_of})


def first_plan_row(what: str, runs: Sequence[Run], limit: float) -> Row:
    """Return the row of how soon there was a plan, of runs that found one."""
    found = [run for run in runs if run.plan.found]
    return at_most(
        what,
        _median([run.first for run in found]),
        "s",
        limit,
        thesis=THESIS["first plan [s]"],
        largest=max((run.first for run in found), default=float("nan")),
        expansions=_median([_to_first(run.plan) for run in found]),
        thesis_expansions=THESIS["expansions to it"],
        epsilon_1=_median([run.all for run in found]),
        plans=float(len(found)),
        asked=float(len(runs)),
    )


def _to_first(found: LatticePlan) -> int:
    """Return the expansions until there was a plan as good as the first epsilon asks."""
    first = LatticeSettings().epsilon
    return next(step.expansions for step in found.history if step.epsilon <= first)


def turning(quick: bool) -> Measured:
    """Compare what is swept in a turn of 90 degrees into a door, out of corridors where both carts can."""
    body, sets = ArticulatedBody.pr2_with_cart(), motion_sets()
    shares, against = {}, {}
    for corridor in TURNING[:1] if quick else TURNING:
        runs = {name: solve(turn_into_door(corridor), motions) for name, motions in sets.items()}
        areas = {name: body.area(body.between(run.plan.poses, 0.01)) for name, run in runs.items() if run.plan.found}
        shares[corridor] = 1.0 - areas.get("articulated", np.nan) / areas.get("straight", np.nan)
        against[f"corridor {corridor} m"] = shares[corridor]
        against |= {f"{name}, corridor {corridor} m [m^2]": area for name, area in areas.items()}
    row = at_least(
        f"turn of 90 degrees out of a corridor of {TURNING[0]} m: swept area saved by articulation",
        shares[TURNING[0]],
        "1",
        0.25,
        **against,
    )
    return Measured([row], {"turning": against})


def _share(values: Sequence[bool]) -> float:
    return sum(values) / len(values)


def _median(values: Sequence[float]) -> float:
    return statistics.median(values) if values else float("nan")
