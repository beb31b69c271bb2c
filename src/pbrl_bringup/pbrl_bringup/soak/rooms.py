"""One room after another: the simulator is started anew for each, all other nodes stay, and are looked at."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil
import yaml
from geometry_msgs.msg import Pose2D
from pbrl_msgs.action import ReachGoal
from pbrl_msgs.msg import NamoStatus
from rosgraph_msgs.msg import Clock

from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments.namo_rooms import STUCK, draw_room
from pbrl_bringup.files import write_text
from pbrl_bringup.graph import free_domain, load_graph, node_command, node_environment, wait_ready, with_parameters
from pbrl_bringup.processes import Programs
from pbrl_bringup.ros.client import GraphClient, Heard
from pbrl_bringup.terminal import progress

LONGEST = 400.0
"""Of one room [s of simulated time]."""
STARTED, ANSWERED, SILENT = 120.0, 15.0, 600.0
"""[s] of the wall clock: until nodes are there, until a goal is taken, and for a room that does not end."""
EVERY = 5.0
"""[s] between two looks at the processes."""
RATE = 0.9
"""Simulated seconds a second: at any rate but 1 the simulator waits for its controllers, as long as they are there."""
MEMORY = 10.0
"""[MB] of what it heard that `namo_node` keeps: so much is full after some minutes, and memory flat from then on."""


@dataclass(frozen=True)
class Sample:
    """What one node had at a moment.

    Attributes:
        time: [s of the wall clock].
        node: its name.
        memory: resident [bytes].
        handles: open files and sockets.
        threads: of its process.
    """

    time: float
    node: str
    memory: int
    handles: int
    threads: int


@dataclass(frozen=True)
class Room:
    """What became of one room.

    Attributes:
        number: of it.
        reached: whether the goal was.
        sentence: told last.
        seconds: simulated [s].
    """

    number: int
    reached: bool
    sentence: str
    seconds: float


def in_rooms(folder: Path, seed: int, length: float) -> tuple[list[Room], list[Sample]]:
    """Run rooms until so much time has been simulated.

    Args:
        folder: for scenes, logs and the recording; new.
        seed: of everything.
        length: of all rooms together [s of simulated time].

    Raises:
        BringupError: a node does not come, or ends by itself.
    """
    folder.mkdir(parents=True)
    told = {"sim.seed": "0", "namo.goal": '""', "namo.memory": str(MEMORY)}
    graph = with_parameters(load_graph("namo"), {**told, "recorder.output": str(folder / "bag")}, ("recorder",))
    rooms: list[Room] = []
    samples: list[Sample] = []
    with free_domain() as domain, Programs(folder / "logs", node_environment(domain)) as programs:
        stay = {name: node for name, node in graph.nodes.items() if name != "sim"}
        for name, node in stay.items():
            programs.start(name, node_command(name, node))
        with GraphClient(domain, programs.check) as client, progress("simulated", total=length) as bar:
            wait_ready(graph.model_copy(update={"nodes": stay}), client, STARTED)
            status = client.listen(NamoStatus, "/namo/status")
            client.wait_for_subscribers("/namo/status", 2, STARTED)  # the other is the recorder
            clock = client.listen(Clock, "/clock", latched=False)
            while (done := sum(room.seconds for room in rooms)) < length:
                bar(done)
                number = len(rooms)
                scene, goal, mission = draw_room(np.random.default_rng([seed, number]), STUCK)
                path = folder / f"room_{number:03d}.yaml"
                write_text(path, yaml.safe_dump(json.loads(scene.model_dump_json(exclude_unset=True))))
                sim = graph.nodes["sim"].model_copy(
                    update={"parameters": {"scene": str(path.resolve()), "seed": number, "rate": RATE}}
                )
                programs.start("sim", node_command("sim", sim))
                rooms.append(_one(client, status, clock, number, goal, mission, samples))
                programs.stop("sim")
        programs.stop("recorder")
    return rooms, samples


def _one(
    client: GraphClient,
    status: Heard,
    clock: Heard,
    number: int,
    goal: np.ndarray,
    seed: int,
    samples: list[Sample],
) -> Room:
    """Let the robot find its way in a room, and look at the nodes meanwhile."""
    client.wait_for_service("/grasp", STARTED)
    before = clock.count
    client.wait_until(lambda: clock.count > before + 50, STARTED, "the clock stands still")
    heard = status.count
    _send(client, number, goal, seed)
    looked = 0.0

    def over() -> bool:
        nonlocal looked
        if time.time() - looked > EVERY:
            looked = time.time()
            samples.extend(look(("sim", "controller", "namo", "recorder")))
        ended = status.count > heard + 1 and status.message.finished and _is_of(status.message, goal)
        return ended or seconds(clock) > LONGEST

    client.wait_until(over, SILENT, f"room {number} does not end")
    told: NamoStatus = status.message
    return Room(number, bool(told.success), f"{told.state}: {told.sentence}", seconds(clock))


def _is_of(told: NamoStatus, goal: np.ndarray) -> bool:
    return bool(np.hypot(told.goal.x - goal[0], told.goal.y - goal[1]) < 1e-6)


def seconds(clock: Heard) -> float:
    """Return what a clock shows [s]."""
    return 0.0 if clock.message is None else clock.message.clock.sec + 1e-9 * clock.message.clock.nanosec


def _send(client: GraphClient, number: int, goal: np.ndarray, seed: int) -> None:
    """Send a goal by the action; raise BringupError where nobody takes it."""
    request = ReachGoal.Impl.SendGoalService.Request()
    for attempt in range(4):
        request.goal_id.uuid = [attempt, number % 256, *os.urandom(14)]
        request.goal = ReachGoal.Goal(goal=Pose2D(x=goal[0], y=goal[1], theta=goal[2]), seed=seed)
        with suppress(BringupError):
            client.call(ReachGoal.Impl.SendGoalService, "/reach_goal/_action/send_goal", request, ANSWERED)
            return
    raise BringupError("/reach_goal: expected somebody who takes a goal, got no answer")


def look(nodes: Sequence[str]) -> list[Sample]:
    """Return what each node has now; one that is not there is left out."""
    found, now = [], time.time()
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):
            line = process.cmdline()
            for node in nodes:
                if f"__node:={node}" in line:
                    found.append(Sample(now, node, process.memory_info().rss, process.num_fds(), process.num_threads()))
    return found
