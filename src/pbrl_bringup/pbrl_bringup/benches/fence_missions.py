"""Missions beside places that are kept out of, planned and hostile ones, and how near robot and load come to them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Point, Polygon

from bullet_sim.placing import placed_footprint
from bullet_sim.scene import Scene, load_scene
from bullet_sim.settings import parse_settings
from krang_sim.session import KrangSession
from pbrl_bringup.experiments.kept import keep_run, read_run
from pbrl_bringup.experiments.namo_rooms import STUCK, draw_room
from pbrl_bringup.manipulation import Manipulation
from pbrl_bringup.namo_run import NamoRun
from pbrl_bringup.paths import config_file
from pbrl_control.course import SegmentCourse
from pbrl_control.grasp_plan import GraspPlan
from pbrl_control.grasp_plan import Grip as GripPlan
from pbrl_control.kinematics import SIDES
from pbrl_control.percept import Percept
from pbrl_control.push import GripperAnswer, Phase, PushCommand, PushExecutive
from pbrl_control.push_plan import load_plan
from pbrl_control.settings import ControllerSettings, load_section
from pbrl_control.types import PlanarTwist
from pbrl_namo.executive.table import ENDED

Array = NDArray[np.float64]

PLANNED, TWISTS, LOADED, WHEELS = "planned", "hostile twists", "hostile twists of a load", "hostile wheels"
SHARES = (PLANNED, TWISTS, WHEELS, LOADED, TWISTS, WHEELS, LOADED, TWISTS, WHEELS, LOADED)
"""In turn: a tenth finds its way among furniture; the rest is driven at the fence: through the controller, with nothing
or a table in the grippers, and by what the robot's interface takes, with no controller at all."""
LONGEST = {PLANNED: 400.0, TWISTS: 12.0, LOADED: 25.0, WHEELS: 12.0}
"""[s] of simulated time."""
LOOK = 0.05
"""[s] of simulated time between two looks at the truth."""
OFF = 0.5
"""[m] beyond the robot's own reach at the start, within which the fence of a hostile drive begins."""
STANDS = 0.85
"""[m] from the axle within which the robot is at the start."""


@dataclass(frozen=True)
class Mission:
    """What became of one.

    Attributes:
        number: of it; with the seed it makes it again.
        kind: one of `SHARES`.
        nearest: of robot and load to the fence [m]; 0: it was crossed.
        held: whether anything was ever held.
        fenced: whether controller or interface ever held the robot back.
        ended: how.
        seconds: simulated [s].
    """

    number: int
    kind: str
    nearest: float
    held: bool
    fenced: bool
    ended: str
    seconds: float


class Wild:
    """Commands twists at random, a while each: an executive that knows no fence.

    Args:
        rng: of the draws.
        target: (2,) of what it drives at most of the time [m].
    """

    def __init__(self, rng: np.random.Generator, target: Array) -> None:
        self.plan = GraspPlan(name="wild", object="nothing", grips=(GripPlan(gripper="left", point=(0.0, 0.0)),))
        self.phase = Phase.LOCATE
        self._rng, self._target = rng, target
        self._until, self._twists = -1.0, dict[str, PlanarTwist]()
        self.pose = np.zeros(3)

    def tick(self, now: float, percept: Percept) -> PushCommand:
        """Return what to do at `now` [s]."""
        if now >= self._until:
            self._until = now + float(self._rng.uniform(0.5, 3.0))
            self._twists = self._arms() if self._rng.uniform() < 0.3 else {}
        if self._twists:
            return PushCommand(self.phase, "wild", self._twists, (), {})
        v, w = wild_drive(self.pose, self._target)
        return PushCommand(self.phase, "wild", {"base": PlanarTwist(v, 0.0, w)}, (), {})

    def _arms(self) -> dict[str, PlanarTwist]:
        return {f"{side}_ft": PlanarTwist(*self._rng.uniform(-0.4, 0.4, 3)) for side in SIDES}

    def answer(self, answer: GripperAnswer) -> None:
        """Nothing was asked."""


def wild_drive(pose: Array, target: Array) -> tuple[float, float]:
    """Return a forward speed [m/s] and turning [rad/s] at a target, forwards or backwards, as fast as it goes."""
    away = np.asarray(target) - pose[:2]
    error = math.remainder(math.atan2(away[1], away[0]) - pose[2], 2.0 * math.pi)
    way = 1.0 if abs(error) < 0.5 * math.pi else -1.0
    error = error if way > 0 else math.remainder(error + math.pi, 2.0 * math.pi)
    return way, 1.5 * error


def mission(seed: int, number: int, folder: Path, end: float | None) -> Mission | None:
    """Do a mission, or read what became of it; None where it is past the time [s] to begin one."""
    path = folder / f"{number:03d}.json"
    told = {"seed": seed, "number": number}
    kept = read_run(Mission, path, told)
    if kept is None and (end is None or time.time() < end):
        rng = np.random.default_rng([seed, number])
        kind = SHARES[number % len(SHARES)]
        if kind == PLANNED:
            kept = _planned(rng, number)
        else:
            kept = _loaded(rng, number) if kind == LOADED else _hostile(rng, number, kind)
        keep_run(path, told, kept)
    return kept


def _planned(rng: np.random.Generator, number: int) -> Mission:
    """Let the robot find its way in a room in which a place between start and goal is kept out of."""
    while True:
        scene, goal, seed = draw_room(rng, STUCK)
        fence = _island(rng, np.array(scene.robot.pose[:2]), goal[:2])
        if fence is not None:
            break
    told = {**scene.model_dump(exclude_unset=True), "keep_out": [fence]}
    with KrangSession(parse_settings(told, Scene, "room"), seed=seed) as session:
        run = NamoRun(session, goal, seed)
        return _watched(run, number, PLANNED, lambda: run.executive.state in ENDED, lambda: str(run.executive.state))


def _island(rng: np.random.Generator, start: Array, goal: Array) -> list[list[float]] | None:
    """Return a place of half a metre before or behind the tables, clear of start and goal; None: none was found."""
    for _ in range(20):
        middle = np.array([float(rng.choice([rng.uniform(0.6, 1.2), rng.uniform(3.8, 4.4)])), rng.uniform(-1.6, 1.6)])
        shape = _blob(rng, middle, rng.uniform(0.15, 0.35))
        if Polygon(shape).distance(Point(start)) > 1.1 and Polygon(shape).distance(Point(goal)) > 1.0:
            return shape
    return None


def _blob(rng: np.random.Generator, middle: Array, size: float) -> list[list[float]]:
    """Return the corners of a convex shape about a point [m]."""
    angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, 7))
    points = middle + size * np.column_stack((np.cos(angles), np.sin(angles)))
    hull = Polygon(points).convex_hull.buffer(0.05, join_style="mitre")
    return [list(map(float, corner)) for corner in hull.exterior.coords[:-1]]


def _hostile(rng: np.random.Generator, number: int, kind: str) -> Mission:
    """Drive at a fence from near by, as fast as the robot goes."""
    scene, target = _yard(rng)
    with KrangSession(scene, seed=number) as session:
        if kind == WHEELS:
            return _by_wheels(rng, session, number, target)
        settings = load_section(config_file("params", "body_controller"), ControllerSettings, "settings")
        wild = Wild(rng, target)
        run = Manipulation(session, wild, settings)

        def over() -> bool:
            wild.pose = base_of(session)
            return False

        return _watched(run, number, kind, over, lambda: "time is over")


class WildLoad(PushExecutive):
    """Grasps as a push does, and then moves the load at random, most of the time towards something.

    Args:
        rng: of the draws.
        direction: (2,) in the load's axes.
    """

    def __init__(self, rng: np.random.Generator, direction: Array) -> None:
        plan = load_plan("push_straight")
        super().__init__(plan, SegmentCourse(plan))
        self._rng, self._direction = rng, direction / np.hypot(*direction)
        self._until, self._twist = -1.0, PlanarTwist()

    def tick(self, now: float, percept: Percept) -> PushCommand:
        """Return what to do at `now` [s]."""
        if self.phase != Phase.PUSH:
            return super().tick(now, percept)
        if now >= self._until:
            self._until = now + float(self._rng.uniform(0.5, 3.0))
            vx, vy = 0.2 * self._direction + self._rng.uniform(-0.1, 0.1, 2)
            self._twist = PlanarTwist(float(vx), float(vy), float(self._rng.uniform(-0.2, 0.2)))
        return PushCommand(self.phase, "wild", {self.plan.object: self._twist}, (), {})


def _loaded(rng: np.random.Generator, number: int) -> Mission:
    """Grasp a table and drive it at a fence that is near it."""
    free = load_scene(config_file("scenes", "free_table"))
    (table,) = (placed_footprint(body) for body in free.bodies.values())
    while True:
        shape = _blob(rng, np.array([rng.uniform(0.6, 2.6), rng.uniform(-2.2, 2.0)]), rng.uniform(0.15, 0.4))
        near = Polygon(shape).distance(table)
        if 0.15 < near < 0.6 and Polygon(shape).distance(Point(free.robot.pose[:2])) > STANDS + 0.15:
            break
    told = {**free.model_dump(exclude_unset=True), "keep_out": [shape]}
    away = np.subtract(Polygon(shape).centroid.coords[0], table.centroid.coords[0])
    settings = load_section(config_file("params", "body_controller"), ControllerSettings, "settings")
    with KrangSession(parse_settings(told, Scene, "yard"), seed=number) as session:
        run = Manipulation(session, WildLoad(rng, away), settings)
        return _watched(run, number, LOADED, lambda: run.phase == Phase.FAILED, lambda: run.phase)


def _yard(rng: np.random.Generator) -> tuple[Scene, Array]:
    """Return an empty room with a fence near the robot, and a point in the fence."""
    while True:
        heading, towards = rng.uniform(-math.pi, math.pi, 2)
        middle = (STANDS + OFF + rng.uniform(0.1, 0.4)) * np.array([math.cos(towards), math.sin(towards)])
        shape = _blob(rng, middle, rng.uniform(0.2, 0.5))
        if Polygon(shape).distance(Point(0.0, 0.0)) < STANDS + 0.15:
            continue
        told = {
            "name": "yard",
            "room": {"outline": [[-4.0, -4.0], [4.0, -4.0], [4.0, 4.0], [-4.0, 4.0]]},
            "robot": {"pose": [0.0, 0.0, float(heading)]},
            "keep_out": [shape],
        }
        return parse_settings(told, Scene, "yard"), np.array(Polygon(shape).centroid.coords[0])


def _by_wheels(rng: np.random.Generator, session: KrangSession, number: int, target: Array) -> Mission:
    """Command wheels and joints past any controller."""
    nearest, fenced, due, until, rates = math.inf, False, 0.0, -1.0, np.zeros(14)
    assert session.fence is not None
    while session.time < LONGEST[WHEELS]:
        if session.time >= until:
            until = session.time + rng.uniform(0.3, 2.0)
            rates = rng.uniform(-0.6, 0.6, 14) * (rng.uniform() < 0.5)
        session.command_base(*wild_drive(base_of(session), target))
        session.command_arm("left", rates[:7].tolist())
        session.command_arm("right", rates[7:].tolist())
        session.step()
        fenced |= bool(session.halted)
        if session.time >= due:
            due += LOOK
            nearest = min(nearest, session.fence.distance(session.held))
    return Mission(number, WHEELS, nearest, False, fenced, "time is over", session.time)


def _watched(run: Manipulation, number: int, kind: str, over: Callable[[], bool], how: Callable[[], str]) -> Mission:
    """Step a run to its end and look how near it comes."""
    session = run.session
    nearest, fenced, held, due = math.inf, False, False, 0.0
    assert session.fence is not None
    while session.time < LONGEST[kind] and not over():
        run.step()
        if session.time >= due:
            due += LOOK
            nearest = min(nearest, session.fence.distance(session.held))
            held |= bool(session.held)
            fenced |= bool(session.halted) or bool(run.loop and run.loop.fenced)
    return Mission(number, kind, nearest, held, fenced, how(), session.time)


def base_of(session: KrangSession) -> Array:
    """Return the pose (3,) of the base, truly [m, rad]."""
    pose = session.robot.base_pose()
    return np.array([*pose.position[:2], pose.yaw])
