"""Robot and cart under local control: how well a plan is followed, how long a tick and a costmap take.

The robot is a kinematic one with noise and delays, so that the controller alone is measured. Times are of this thread's
own work (CPU seconds), medians.
"""

from __future__ import annotations

import math
import time
from collections import deque
from pathlib import Path

import numpy as np
from scipy.ndimage import distance_transform_edt

from pbrl_bringup.benches.rows import Measured, at_least, at_most
from pbrl_control.cart import (
    CartBody,
    CartCommand,
    CartController,
    CartPercept,
    CartPlan,
    CartSettings,
    CostWindow,
    DriveStatus,
)
from pbrl_control.planar import Array
from pbrl_planner.costmap import CostField, Costmap, CostmapSettings, RangeScan, squared_distances

TICK, DELAY = 0.05, 0.05
"""[s] between two ticks, and from a command to its motion."""
SIGMA = np.array([0.003, 0.003, 0.003, 0.004])
"""Noise of x, y [m], heading and articulation [rad]."""
SETTINGS = CartSettings(delay=DELAY)
SCANS = 40
"""A scan of 1041 beams each, for the costmap."""


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Measure all rows.

    Args:
        seed: of noise.
        quick: fewer repetitions.
        out: folder; nothing is written into it.
    """
    rng = np.random.default_rng(seed)
    off, turned, ended, still = [], [], [], []
    for _ in range(1 if quick else 10):
        for path in paths().values():
            moved, status = follow(path, open_floor(), rng)
            off.append(float(np.hypot(moved[:, 0], moved[:, 1]).max()))
            turned.append(math.degrees(float(np.abs(moved[:, 2:]).max())))
            ended.append(status is DriveStatus.ARRIVED)
            still.append(silent(path, rng))
    free, walls = tick_times(open_floor(), rng), tick_times(corridor(), rng)
    update = update_times(rng)
    ours, theirs = distance_times(rng, 2 if quick else 5)
    rows = [
        at_most("robot and cart from the goal on their plan, worst", max(off), "m", 0.03),
        at_most("the same, heading and articulation", max(turned), "deg", 2.0),
        at_least("plans at whose end it arrived", float(np.mean(ended)), "", 1.0),
        at_most("command to stand after the last scan, worst", max(still), "s", SETTINGS.stop_within - DELAY),
        at_most("tick on open floor", float(np.median(free)), "s", 0.002),
        at_most("tick between two walls, 3 cm off", float(np.median(walls)), "s", 0.002),
        at_most("scan into a costmap of 240 x 240 cells, inflated", float(np.median(update)), "s", 0.02),
        at_least("distances of a map of 1000 x 1000 cells", theirs / ours, "times scipy's speed", 1.0),
    ]
    return Measured(rows, {"tick": {"free": free, "walls": walls}, "update": update})


def body() -> CartBody:
    """Return the PR2 with its hands on a steel cart's short side."""
    half, aside = 0.334, np.array([[0.0, 0.25], [0.0, -0.25]])
    robot = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    cart = np.array([[0.0, -0.3], [0.9, -0.3], [0.9, 0.3], [0.0, 0.3]])
    return CartBody(robot, cart, (0.65, 0.0), aside + np.array([0.284, 0.0]), aside)


def paths() -> dict[str, Array]:
    """Return plans of poses (n, 4) by name."""
    share = np.linspace(0.0, 1.0, 60)
    zero = np.zeros(60)
    return {
        "straight": np.column_stack((2.0 * share, zero, zero, zero)),
        "arc": np.column_stack((1.2 * np.sin(1.4 * share), 1.2 * (1.0 - np.cos(1.4 * share)), 1.4 * share, zero)),
        "in place": np.column_stack((zero, zero, -2.0 * share, zero)),
        "articulated": np.column_stack(
            (np.sin(1.3 * share), 1.0 - np.cos(1.3 * share), 1.3 * share, 0.6 * np.sin(math.pi * share))
        ),
    }


def open_floor() -> CostField:
    """Return 8 m by 8 m of nothing."""
    return CostField(np.zeros((320, 320), dtype=np.uint8), 0.025, (-3.0, -4.0), 0.0)


def corridor() -> CostField:
    """Return the same with a wall to either side of the robot."""
    floor = open_floor()
    middle = floor.origin[1] + (np.arange(320) + 0.5) * floor.resolution
    floor.cells[np.abs(middle) > 0.36] = 254
    return floor


class _Follower:
    """A robot that does what it is told, a delay later."""

    def __init__(self, path: Array, rng: np.random.Generator) -> None:
        plan = CartPlan.timed(path, SETTINGS.limits, SETTINGS.share)
        self.controller = CartController(plan, body(), SETTINGS)
        self.state, self.now, self._rng = np.array(path[0]), 0.0, rng
        self._sent: deque[Array] = deque([np.zeros(4)] * round(DELAY / TICK))

    def percept(self, costs: CostWindow, scan_time: float) -> CartPercept:
        seen = self.state + SIGMA * self._rng.normal(size=4)
        return CartPercept(seen[:3], self.now, float(seen[3]), 0.0, self.now, scan_time, costs)

    def obey(self, command: CartCommand) -> None:
        self._sent.append(np.array([*command.twist, command.articulation_rate]))
        vx, vy, omega, bend = self._sent.popleft()
        middle = self.state[2] + 0.5 * TICK * omega
        c, s = math.cos(middle), math.sin(middle)
        self.state = self.state + TICK * np.array([c * vx - s * vy, s * vx + c * vy, omega, bend])
        self.now += TICK


def follow(path: Array, costs: CostWindow, rng: np.random.Generator) -> tuple[Array, DriveStatus]:
    """Follow a plan; return how far from its goal the robot was when a command arrived (n, 4), and how it ended."""
    robot, off = _Follower(path, rng), []
    while True:
        command = robot.controller.step(robot.now, robot.percept(costs, robot.now))
        robot.obey(command)
        off.append(robot.state - command.goal)
        if command.status is not DriveStatus.MOVING or robot.now > 120.0:
            return np.array(off), command.status


def silent(path: Array, rng: np.random.Generator) -> float:
    """Return after which time without a scan nothing but standing is commanded [s]."""
    robot, last = _Follower(path, rng), 2.0
    while True:
        scan = min(robot.now, last)
        command = robot.controller.step(robot.now, robot.percept(open_floor(), scan))
        robot.obey(command)
        if robot.now > last + TICK and not np.any([*command.twist, command.articulation_rate]):
            return robot.now - TICK - last


def tick_times(costs: CostWindow, rng: np.random.Generator) -> list[float]:
    """Return what ticks along a straight plan take [s]."""
    robot, found = _Follower(paths()["straight"], rng), []
    for _ in range(100):
        percept = robot.percept(costs, robot.now)
        begin = time.thread_time()
        command = robot.controller.step(robot.now, percept)
        found.append(time.thread_time() - begin)
        robot.obey(command)
    return found[5:]


def update_times(rng: np.random.Generator) -> list[float]:
    """Return what it takes to roll a costmap, take in a scan and inflate [s]."""
    costmap, mine, found = Costmap(CostmapSettings()), body(), []
    for k in range(SCANS):
        pose = np.array([0.017 * k, 0.01 * k, 0.01 * k])
        ranges = 2.5 + np.sin(0.02 * np.arange(1041)) + rng.normal(0.0, 0.01, 1041)
        scan = RangeScan(TICK * k, -2.27, math.radians(0.25), (0.1, 30.0), ranges)
        outlines = mine.outlines(pose, 0.2)
        begin = time.thread_time()
        costmap.recentre(pose[0], pose[1])
        costmap.observe(scan, pose, outlines)
        costmap.field(TICK * k)
        found.append(time.thread_time() - begin)
    return found[5:]


def distance_times(rng: np.random.Generator, runs: int) -> tuple[float, float]:
    """Return what the exact distances of a large map take, ours and scipy's, the best of several runs [s]."""
    lethal = rng.random((1000, 1000)) < 0.01
    ours, theirs = [], []
    squared_distances(lethal[:10])
    for _ in range(runs):
        begin = time.thread_time()
        squared_distances(lethal)
        middle = time.thread_time()
        distance_transform_edt(~lethal)
        ours.append(middle - begin)
        theirs.append(time.thread_time() - middle)
    return min(ours), min(theirs)
