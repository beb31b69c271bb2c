"""Two robots in one ROS domain, each in a namespace and a room of its own: both move what shuts them in, and arrive."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from pbrl_msgs.msg import NamoStatus
from rosgraph_msgs.msg import Clock

from pbrl_bringup.benches.rows import Measured, at_least, at_most
from pbrl_bringup.files import write_text
from pbrl_bringup.graph import free_domain, load_graph, running_graph, wait_ready, with_parameters
from pbrl_bringup.processes import Programs
from pbrl_bringup.ros.client import GraphClient, Heard
from pbrl_bringup.terminal import progress

ROOM = """
name: {name}
room: {{outline: [[-0.5, -1.5], [5.0, -1.5], [5.0, 1.5], [-0.5, 1.5]]}}
robot: {{pose: [0.6, {y}, 0.0]}}
bodies:
  cupboard: {{kind: fixture, polygon: [[1.9, {low}], [2.6, {low}], [2.6, {high}], [1.9, {high}]], height: 1.0}}
"""
TABLE = """\
  table: {{kind: office_table, size: [1.0, 1.0], height: 0.7775, nominal_mass: 33.0, pose: [2.2, {table}, 0.0]}}
"""
"""A table and a cupboard that leave no gap that the robot fits through; the second room is the first in a mirror."""
GOALS = {"/robot_1": (4.3, 0.0), "/fleet/robot_2": (4.2, -0.4)}
"""Of each robot, by its namespace [m]: another one, so that a goal that goes astray shows."""
RATE = 0.5
"""Simulated seconds a second: two simulators and two planners share what may be two cores."""
STARTED, LONGEST = 90.0, 1500.0
"""[s] until the nodes are there, and until both have arrived."""
NEAR = 0.25
"""From the goal a robot has arrived [m]."""
SOON = 900.0
"""Until both have arrived [s]: with a push that goes wrong, and a table that is learned anew."""


@dataclass(frozen=True)
class Arrival:
    """What became of one robot.

    Attributes:
        robot: its namespace.
        arrived: whether its executive ended at the goal that this robot was given.
        sentence: with which it ended.
        seconds: of the wall clock since both were there.
        simulated: on its own clock [s].
        openings: tables that it moved out of the way.
        plans: answers of its planner.
    """

    robot: str
    arrived: bool
    sentence: str
    seconds: float
    simulated: float
    openings: int
    plans: int


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Let both find their way; in the quick version there is no table in it, and time goes as fast as it can."""
    arrivals = together(seed, 0.0 if quick else RATE, out, shut_in=not quick)
    slowest, simulated = (max(getattr(each, name) for each in arrivals) for name in ("seconds", "simulated"))
    there = sum(each.arrived for each in arrivals)
    rows = [
        at_least("robots at their own goals, side by side in one domain", there, "1", len(GOALS)),
        at_most("wall clock until both have arrived", slowest, "s", SOON, simulated=simulated),
    ]
    if not quick:
        least = min(each.openings for each in arrivals)
        rows.insert(1, at_least("tables that each moved out of its way, at least", least, "1", 1))
    return Measured(rows, {"robots": [asdict(each) for each in arrivals]})


def together(seed: int, rate: float, out: Path, *, shut_in: bool) -> list[Arrival]:
    """Run two graphs in one domain until both robots have ended.

    Args:
        seed: of the first robot; the second has the next.
        rate: simulated seconds a second; 0: as fast as possible.
        out: folder for scenes and logs.
        shut_in: whether a table is in each robot's way.

    Raises:
        BringupError: a node ends, does not come, or a robot does not end.
    """
    with free_domain() as domain, ExitStack() as stack:
        running: list[Programs] = []
        for number, (robot, goal) in enumerate(GOALS.items()):
            name = robot.rpartition("/")[2]
            scene = out / f"{name}.yaml"
            write_text(scene, room(name, mirrored=bool(number), shut_in=shut_in))
            told = {
                "sim.scene": str(scene.resolve()),
                "sim.seed": str(seed + number),
                "sim.rate": str(float(rate)),
                "namo.goal": f'"{goal[0]} {goal[1]}"',
                "namo.seed": str(seed + number),
            }
            graph = with_parameters(load_graph("namo"), told)
            programs = stack.enter_context(running_graph(graph, out / "logs" / name, domain, robot))
            running.append(programs)
            with GraphClient(domain, programs.check, robot) as client:
                wait_ready(graph, client, STARTED)

        def check() -> None:
            for each in running:
                each.check()

        return watched(stack.enter_context(GraphClient(domain, check)))


def room(name: str, *, mirrored: bool, shut_in: bool) -> str:
    """Return the text of a scene."""
    side = -1.0 if mirrored else 1.0
    low, high = sorted((-1.4 * side, -0.4 * side))
    text = ROOM + TABLE if shut_in else ROOM
    return text.format(name=name, y=0.3 * side, table=0.75 * side, low=low, high=high)


def watched(client: GraphClient) -> list[Arrival]:
    """Wait until every robot has ended, and return how.

    Raises:
        BringupError: one has not, or a node has died.
    """
    began = time.monotonic()
    status = {robot: client.listen(NamoStatus, f"{robot}/namo/status") for robot in GOALS}
    clocks = {robot: client.listen(Clock, f"{robot}/clock", latched=False) for robot in GOALS}
    ended: dict[str, Arrival] = {}

    with progress("robots at their goals", total=len(GOALS)) as bar:

        def all_ended() -> bool:
            for robot, heard in status.items():
                if robot not in ended and heard.message is not None and heard.message.finished:
                    ended[robot] = arrival(robot, heard.message, clocks[robot], time.monotonic() - began)
                    bar(len(ended))
            return len(ended) == len(GOALS)

        client.wait_until(all_ended, LONGEST, "not every robot has ended")
    return [ended[robot] for robot in GOALS]


def arrival(robot: str, told: NamoStatus, clock: Heard, seconds: float) -> Arrival:
    """Return what became of a robot by its last status."""
    goal = np.array(GOALS[robot])
    own = np.hypot(told.goal.x - goal[0], told.goal.y - goal[1]) < NEAR
    simulated = 0.0 if clock.message is None else clock.message.clock.sec + 1e-9 * clock.message.clock.nanosec
    return Arrival(
        robot,
        bool(told.success and own),
        f"{told.state}: {told.sentence}",
        seconds,
        float(simulated),
        int(told.openings),
        int(told.plans),
    )
