"""Section 4.6 and table 1 again: the PR2 pushes a cart through offices with people in them, from one goal to the next.

Offices, people and the order of goals are drawn from the seed. Each leg is a run of its own that begins where the one
before was to end, so that legs are independent of each other, and kept as soon as they have ended. The planner's work
is counted as in the thesis: expansions and time until the first plan (epsilon 3), epsilon in the end, failed calls.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bullet_sim.settings import parse_settings
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.cart.outcome import CartOutcome
from pbrl_bringup.cart_run import run_cart
from pbrl_bringup.experiments.cart_office_figure import draw
from pbrl_bringup.experiments.kept import keep_run, read_run
from pbrl_bringup.parallel import in_parallel
from pbrl_control.planar import Array, compose
from pbrl_planner.cart.navigator import PROVED
from pr2_cart_sim.floor_plan import OfficePlan
from pr2_cart_sim.make_office import AHEAD, write_office
from pr2_cart_sim.scene import OfficeScene, load_office

HOUR, QUICK = 3600.0, 60.0
"""Simulated time that is driven [s]."""
LEGS = 8
"""In one office."""
ROUND = 4
"""Legs that are driven before it is looked whether there are enough: the same number on however many cores."""
LONGEST, QUICK_LONGEST = 300.0, 180.0
"""Of a leg [s]."""
FAR = 0.5
"""Of the greatest distance between two goals of an office, which the next goal is away at least."""
MANNERS = {"social": True, "step_in_rate": 1.0}
"""People stop before robot and cart; now and then somebody steps in front of them."""
TILT = {"rate": 20.0, "increment": 0.04}
"""Of the tilting laser: a ninth of its beams, since each costs as much to cast as one of the base's."""
OFFICE = {"people": 3}
"""People walk to and fro. They go straight on: in a corridor where none can pass beside the cart each stops all others.
"""
FIRST_PLAN, SHARE_OPTIMAL = 0.05, 0.95
POSITION, ANGLE = 0.03, math.radians(2.0)
TICK = 2.0
"""Of the local controller at most [ms]."""
THESIS = {"calls": 134.0, "failures": 25.0, "expansions": 15157.87, "seconds": 1.23, "epsilon": 1.30}


@dataclass(frozen=True)
class Leg:
    """What is driven.

    Attributes:
        number: of the leg.
        office: file of its scene.
        start: (3,) of `base` [m, rad].
        goal: (3,) [m, rad].
        names: of both.
    """

    number: int
    office: Path
    start: tuple[float, ...]
    goal: tuple[float, ...]
    names: tuple[str, str]

    def told(self, seed: int, longest: float) -> dict[str, Any]:
        """Return what a kept leg is recognised by."""
        return {
            "seed": seed,
            "leg": self.number,
            "from": self.names[0],
            "to": self.names[1],
            "start": list(self.start),
            "goal": list(self.goal),
            "longest": longest,
        }


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Drive, and draw the drive through the first office, into `out`.

    Args:
        seed: of offices, people, goals, sensors.
        quick: one leg instead of an hour.
        out: folder of offices, kept legs and figure.
    """
    wanted, longest = (QUICK, QUICK_LONGEST) if quick else (HOUR, LONGEST)
    legs: list[Leg] = []
    found: list[CartOutcome] = []
    while sum(each.seconds for each in found) < wanted:
        legs += [leg_of(seed, len(found) + k, out) for k in range(1 if quick else ROUND)]
        found += driven(legs[len(found) :], seed, longest, out)
    first = [(leg, done) for leg, done in zip(legs, found, strict=True) if leg.office == legs[0].office]
    draw(load_office(legs[0].office), [done for _, done in first], out)
    told = [summary(leg, done) for leg, done in zip(legs, found, strict=True)]
    return Measured(rows_of(found), {"legs": told})


def leg_of(seed: int, number: int, out: Path, office: Mapping[str, Any] = OFFICE) -> Leg:
    """Return a leg; its office, what is told of it beyond `OfficePlan`'s own, is made if it is not there yet."""
    which = number // LEGS
    file = out / "offices" / f"office_{which}.yaml"
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        plan = parse_settings(dict(office), OfficePlan, "the experiment's office")
        write_office(file, plan, int(np.random.default_rng([seed, which]).integers(2**31)))
    scene = load_office(file)
    goals = {name: tuple(map(float, pose)) for name, pose in scene.goals.items()}
    start = tuple(map(float, scene.robot.pose))
    order = route({**goals, "start": start}, "start", LEGS, np.random.default_rng([seed, which, 1]))
    places = {**goals, "start": start}
    begin, end = order[number % LEGS], order[number % LEGS + 1]
    return Leg(number, file, places[begin], places[end], (begin, end))


def route(places: dict[str, tuple[float, ...]], start: str, count: int, rng: np.random.Generator) -> list[str]:
    """Return names of places to go to one after the other, the start first, each far from the one before.

    Args:
        places: (3,) by name [m, rad].
        start: name of the first, which is never gone back to.
        count: of goals.
        rng: of the draws.
    """
    names = sorted(name for name in places if name != start)
    away = {(a, b): math.dist(places[a][:2], places[b][:2]) for a in places for b in names}
    found = [start]
    while len(found) <= count:
        here = found[-1]
        most = max(away[here, name] for name in names)
        far = [name for name in names if name != here and away[here, name] >= FAR * most]
        found.append(far[int(rng.integers(len(far)))])
    return found


def driven(
    legs: Sequence[Leg], seed: int, longest: float, out: Path, tilt: Mapping[str, Any] = TILT
) -> list[CartOutcome]:
    """Return what became of legs; those that were kept are not driven again."""
    paths = [out / "legs" / f"leg_{leg.number:03d}.json" for leg in legs]
    jobs = [
        (leg, seed, longest, path, tilt)
        for leg, path in zip(legs, paths, strict=True)
        if read_run(CartOutcome, path, leg.told(seed, longest)) is None
    ]
    if jobs:
        in_parallel(drive, jobs, "legs")
    done = [read_run(CartOutcome, path, leg.told(seed, longest)) for leg, path in zip(legs, paths, strict=True)]
    return [each for each in done if each is not None]


def drive(leg: Leg, seed: int, longest: float, path: Path, tilt: Mapping[str, Any] = TILT) -> None:
    """Drive a leg and keep it."""
    scene = scene_of(load_office(leg.office), np.array(leg.start), tilt)
    drawn = int(np.random.default_rng([seed, leg.number, 2]).integers(2**31))
    keep_run(path, leg.told(seed, longest), run_cart(scene, np.array(leg.goal), drawn, longest))


def scene_of(office: OfficeScene, start: Array, told: Mapping[str, Any] = TILT) -> OfficeScene:
    """Return an office with the robot and its cart at a pose (3,) of `base`, and people of the experiment's manners.

    Args:
        office: with robot and cart anywhere.
        start: of `base` [m, rad].
        told: of the tilting laser.
    """
    cart = compose(start, np.array([AHEAD, 0.0, 0.0]))
    robot = office.robot.model_copy(update={"pose": tuple(map(float, start))})
    tilt = office.sensors.tilt_laser.model_copy(update=dict(told))
    held = office.bodies["cart"].model_copy(update={"pose": tuple(map(float, cart))})
    return office.model_copy(
        update={
            "robot": robot,
            "sensors": office.sensors.model_copy(update={"tilt_laser": tilt}),
            "bodies": {**office.bodies, "cart": held},
            "manners": office.manners.model_copy(update=MANNERS),
        }
    )


def rows_of(found: Sequence[CartOutcome]) -> list[Row]:
    """Return the rows of table 1, and what became of the drive."""
    return [*planner_rows(found), *drive_rows(found)]


def planner_rows(found: Sequence[CartOutcome]) -> list[Row]:
    """Return table 1: what the planner was asked, and what it answered."""
    calls = [call for each in found for call in each.calls]
    made = [call for call in calls if call.found]
    failed = [call for call in calls if not call.found]
    proved = [call for call in failed if call.answer in PROVED]
    seconds = [call.seconds_first for call in made if call.seconds_first is not None]
    expansions = [call.expansions_first for call in made]
    epsilons = [call.epsilon for call in made if call.epsilon is not None]
    hours = sum(each.seconds for each in found) / HOUR
    return [
        at_least(
            "calls of the planner",
            len(calls),
            "1",
            round(THESIS["calls"] * min(hours, 1.0)),
            thesis=THESIS["calls"],
            simulated_minutes=60.0 * hours,
        ),
        at_most(
            "expansions until the first plan, mean",
            _mean(expansions),
            "1",
            THESIS["expansions"],
            thesis=THESIS["expansions"],
            deviation=float(np.std(expansions)) if expansions else math.nan,
            plans=float(len(made)),
        ),
        at_most(
            "time until the first plan, of one core, mean",
            _mean(seconds),
            "s",
            FIRST_PLAN,
            thesis=THESIS["seconds"],
            median=float(np.median(seconds)) if seconds else math.nan,
            largest=max(seconds, default=math.nan),
        ),
        at_most("epsilon in the end, mean", _mean(epsilons), "1", THESIS["epsilon"], thesis=THESIS["epsilon"]),
        at_least(
            "plans that are the cheapest there are (epsilon 1.0 in the end), share",
            _mean([epsilon == 1.0 for epsilon in epsilons]),
            "1",
            SHARE_OPTIMAL,
        ),
        at_most(
            "calls of the planner that failed without proof that there was no path",
            len(failed) - len(proved),
            "1",
            0,
            failures=float(len(failed)),
            proved=float(len(proved)),
            thesis_failures=THESIS["failures"],
            seconds_of_the_longest=max((call.seconds for call in failed), default=math.nan),
        ),
    ]


def drive_rows(found: Sequence[CartOutcome]) -> list[Row]:
    """Return what became of the drive, by the simulator's truth."""
    scores = [each.score for each in found]
    touches = [touch for score in scores for touch in score.contacts]
    people = [score.nearest_person for score in scores if score.nearest_person is not None]
    things = [score.nearest_thing for score in scores if score.nearest_thing is not None]
    ticks = [1e3 * tick for score in scores for tick in score.tick_seconds]
    reached = [each for each in found if each.reached]
    return [
        at_most(
            "contacts with people, furniture or walls",
            len(touches),
            "1",
            0,
            people=float(sum(touch.person for touch in touches)),
            simulated_minutes=sum(each.seconds for each in found) / 60.0,
            way=sum(score.way for score in scores),
        ),
        at_least("least distance of robot or cart to anybody", min(people, default=math.nan), "m", 0.0),
        at_least("least distance of robot or cart to anything else", min(things, default=math.nan), "m", 0.0),
        *_error_rows("distance from the plan", [e for score in scores for e in score.position_errors], "m", POSITION),
        *_error_rows(
            "heading and articulation off the plan", [e for score in scores for e in score.angle_errors], "rad", ANGLE
        ),
        at_most(
            "tick of the local controller, of one core, median",
            float(np.median(ticks)) if ticks else math.nan,
            "ms",
            TICK,
            most_of_100=float(np.quantile(ticks, 0.99)) if ticks else math.nan,
        ),
        at_least(
            "goals reached, share",
            len(reached) / len(found),
            "1",
            1.0,
            legs=float(len(found)),
            off=max((each.score.goal_error for each in reached), default=math.nan),
        ),
    ]


def _error_rows(what: str, errors: Sequence[float], unit: str, limit: float) -> list[Row]:
    """Return the rows of an error of each tick: its 95 % quantile, and the greatest."""
    known = np.array(errors) if len(errors) else np.array([math.nan])
    return [
        at_most(
            f"{what}, 95 of 100 ticks", float(np.quantile(known, 0.95)), unit, limit, median=float(np.median(known))
        ),
        at_most(f"{what}, greatest", float(known.max()), unit, limit, ticks=float(len(errors))),
    ]


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if len(values) else math.nan


def summary(leg: Leg, done: CartOutcome) -> dict[str, Any]:
    """Return what there is to say of a leg, without its trace."""
    answers = [str(call.answer) for call in done.calls]
    return {
        "from": leg.names[0],
        "to": leg.names[1],
        "office": leg.office.stem,
        "reached": done.reached,
        "sentence": done.sentence,
        "seconds": done.seconds,
        "way": done.score.way,
        "answers": {answer: answers.count(answer) for answer in sorted(set(answers))},
        "contacts": [(touch.mover, touch.other, touch.time, touch.force) for touch in done.score.contacts],
        "nearest_person": done.score.nearest_person,
        "nearest_thing": done.score.nearest_thing,
        "goal_error": done.score.goal_error,
    }
