"""The planner among movable obstacles, without a simulator: how long it thinks, what it says, what comes of its plans.

No row here is of the whole system. The random rooms are a kinematic world (`namo_kinematic`): a held thing moves as
its true constraints allow, and of one that refused everything is told; nothing is driven, grasped, felt or learned.
"""

from __future__ import annotations

import statistics
import time
from collections import Counter
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from pbrl_bringup.benches.namo_kinematic import REACHED, RIGHTLY, find_way, office_run, true_models
from pbrl_bringup.benches.namo_rivals import duel
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.experiments.namo_rooms import SIZES, STUCK, TURNED, draw_room, seen
from pbrl_bringup.parallel import in_parallel
from pbrl_bringup.paths import workspace
from pbrl_control.navigation.footprint import KRANG_STOWED
from pbrl_namo.planner import NamoPlan, plan, prior_beliefs
from pbrl_namo.regions.free_space import free_space
from pbrl_namo.regions.settings import MARGIN, RegionSettings
from pbrl_namo.scene import NamoScene
from pbrl_namo.scenes import load_svg, random_office
from pbrl_namo.scenes.hidden import nominal_mass
from pbrl_namo.settings import NamoSettings
from pbrl_namo.warming import compile_kernels

ROOMS = 20
PLANNING = 2.0
"""[s]"""
WALLED, WALLED_SIZES = 40, (10, 20, 40)
SAYING = 5.0
"""[s]"""
OFFICES, THINGS, SHARE = 40, 10, 0.9
DUELS = 10
PEER_SCENES = {"minimal_stilman_2005.svg": 12.4, "1_robot_2_obstacles.svg": 15.3}
"""Files below `test/data/namo_scenes`, and the planning time until its goal was reached of the open project `namosim`,
whose they are [s]."""
BESIDE = 1e-3
"""[m] by which a thing may be further off than the disc's radius and still border a region."""


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Measure all rows.

    Args:
        seed: of all rooms and plans.
        quick: a tenth of the rooms.
        out: folder; nothing is written into it.
    """
    compile_kernels()
    parts = [
        thesis_rooms(seed, _count(ROOMS, quick)),
        unreachable(seed, _count(WALLED, quick)),
        random_rooms(seed, _count(OFFICES, quick)),
        rivals(seed, _count(DUELS, quick)),
        peer_scenes(seed, workspace() / "test/data/namo_scenes"),
    ]
    rows = [row for part in parts for row in part.rows]
    return Measured(rows, {name: detail for part in parts for name, detail in part.details.items()})


def _count(whole: int, quick: bool) -> int:
    return max(2, whole // 10) if quick else whole


def thesis_rooms(seed: int, count: int) -> Measured:
    """Time the first plan in the rooms of the thesis, from what is believed before anything was pushed."""
    layouts = {"one table stuck": STUCK, "and one caster locked": TURNED}
    rows: list[Row] = []
    details: dict[str, Any] = {}
    for name, layout in layouts.items():
        seconds, moves = [], 0
        for number in range(count):
            told, goal, _ = draw_room(np.random.default_rng([seed, number]), layout)
            poses = {each: np.array(told.bodies[each].pose) for each in SIZES}
            took, made = timed(seen(layout, poses, np.array(told.robot.pose), goal), seed)
            seconds.append(took)
            moves += made.chosen is not None
        rows.append(
            at_most(
                f"thesis's room, {name}: first plan, prior drawn, largest",
                max(seconds),
                "s",
                PLANNING,
                median=statistics.median(seconds),
                rooms=float(count),
                rooms_with_a_move=float(moves),
            )
        )
        details[name] = seconds
    return Measured(rows, {"thesis rooms": details})


def timed(scene: NamoScene, seed: int) -> tuple[float, NamoPlan]:
    """Return how long it takes to draw the prior beliefs and to plan [s], and the plan."""
    began = time.perf_counter()
    made = plan(scene, prior_beliefs(scene, seed), seed)
    return time.perf_counter() - began, made


@dataclass(frozen=True)
class Said:
    """What was said of a goal that is walled in.

    Attributes:
        count: of things in the office, those built in among them.
        said: whether it was said, with the goal's region among those cut off and the word in the sentence.
        seconds: until then.
        cut_off: regions.
        reason: the sentence.
    """

    count: int
    said: bool
    seconds: float
    cut_off: int
    reason: str


def unreachable(seed: int, count: int) -> Measured:
    """Plan where everything around the goal's region is built in, so that nothing that is moved could help."""
    found = []
    for number in range(count):
        size = WALLED_SIZES[number % len(WALLED_SIZES)]
        scene = walled_in(random_office(size, np.random.default_rng([seed, number, 2]), move_needed=True))
        took, made = timed(scene, seed)
        said = made.chosen is None and made.goal in made.cut_off and "cut off" in made.reason
        found.append(Said(size, said, took, len(made.cut_off), made.reason))
    share = sum(each.said for each in found) / count
    return Measured(
        [
            at_least("goal walled in: said so, with the regions cut off", share, "1", 1.0, rooms=float(count)),
            at_most(
                f"until it is said, {WALLED_SIZES[0]} to {WALLED_SIZES[-1]} things, largest",
                max(each.seconds for each in found),
                "s",
                SAYING,
                median=statistics.median(each.seconds for each in found),
            ),
        ],
        {"walled in": [asdict(each) for each in found]},
    )


def walled_in(scene: NamoScene) -> NamoScene:
    """Return a scene in which everything that borders the goal's region is built in."""
    free = free_space(scene)
    goal = free.index(scene.goal)
    assert goal is not None
    region = free.regions[goal]
    beside = {
        name: outline
        for name, outline in scene.outlines.items()
        if shapely.distance(outline, region) <= free.radius + BESIDE
    }
    kept = {name: thing for name, thing in scene.movable.items() if name not in beside}
    poses = {name: scene.poses[name] for name in kept}
    return replace(scene, fixed={**scene.fixed, **beside}, movable=kept, poses=poses)


def random_rooms(seed: int, count: int) -> Measured:
    """Find a way in random offices whose furniture is hidden in what it can do; in a kinematic world."""
    runs = in_parallel(office_run, [(seed, number, THINGS) for number in range(count)], "offices")
    ends = Counter(run.end for run in runs)
    return Measured(
        [
            at_least(
                f"planner in a kinematic world, {THINGS} things: goal reached, or rightly said to be out of reach",
                (ends[REACHED] + ends[RIGHTLY]) / count,
                "1",
                SHARE,
                rooms=float(count),
                moves=statistics.median(run.moves for run in runs),
                failed=statistics.median(run.failed for run in runs),
                **{end: float(number) for end, number in ends.items()},
            ),
            at_most(
                "its planning time in a room, sum, largest",
                max(run.planning for run in runs),
                "s",
                PLANNING,
                median=statistics.median(run.planning for run in runs),
            ),
        ],
        {"random rooms": [asdict(run) for run in runs]},
    )


def rivals(seed: int, count: int) -> Measured:
    """Ask the kinodynamic RRT and us for the same opening of known physics."""
    duels = [duel(seed, number) for number in range(count)]
    ours, theirs = (sum(each.ours for each in duels), sum(each.theirs for each in duels))
    return Measured(
        [
            at_least(f"openings made, of {count}", ours, "1", theirs, kinodynamic_rrt=float(theirs)),
            at_most(
                "time to plan one, median",
                statistics.median(each.our_seconds for each in duels),
                "s",
                statistics.median(each.their_seconds for each in duels),
                kinodynamic_rrt=statistics.median(each.their_seconds for each in duels),
                slowest=max(each.our_seconds for each in duels),
                slowest_kinodynamic_rrt=max(each.their_seconds for each in duels),
            ),
        ],
        {"rivals": [asdict(each) for each in duels]},
    )


def peer_scenes(seed: int, folder: Path) -> Measured:
    """Find a way in scenes of `namosim`, everything rolling freely, our robot in place of theirs; no file, no row."""
    rows: list[Row] = []
    details: dict[str, Any] = {}
    for name, peer in PEER_SCENES.items():
        if not (folder / name).is_file():
            continue
        told = load_svg(folder / name, fit=KRANG_STOWED)
        scene, margin = told.scene, max(told.margin, MARGIN)  # what closes a way to their robot is to close it to ours
        free = {each: {"mass": nominal_mass(thing), "locked_casters": []} for each, thing in scene.movable.items()}
        run = find_way(scene, true_models(scene, free), seed, NamoSettings(regions=RegionSettings(margin=margin)))
        seconds = run.planning if run.end == REACHED else float("nan")
        rows.append(
            at_most(
                f"{name}: all planning until the goal is reached, kinematic world",
                seconds,
                "s",
                peer,
                namosim=peer,
                compared="our planning, with the moves carried out kinematically; namosim's planning until its goal",
                end=run.end,
                moves=float(run.moves),
            )
        )
        details[name] = asdict(run)
    return Measured(rows, {"peer scenes": details})
