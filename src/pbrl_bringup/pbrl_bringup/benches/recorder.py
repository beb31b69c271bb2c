"""A recorder that is killed in mid-run leaves a file that reads up to its last finished chunk."""

from __future__ import annotations

import signal
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rosgraph_msgs.msg import Clock

from pbrl_bag import BagError
from pbrl_bag.mcap_file import McapFile
from pbrl_bringup.benches.rows import Measured, at_least, at_most
from pbrl_bringup.errors import BringupError
from pbrl_bringup.graph import Node, free_domain, node_command, node_environment
from pbrl_bringup.processes import Programs
from pbrl_bringup.ros.client import GraphClient
from pbrl_bringup.terminal import progress

RUNS, QUICK_RUNS = 20, 4
LIFE = (1.0, 3.0)  # [s] how long a recorder lives before it is killed, drawn evenly
PATIENCE = 30.0  # [s]
UNDER_WAY = 20_000  # [bytes] in the file once the simulator's topics are recorded


@dataclass(frozen=True)
class Killed:
    """One run: whether the file reads, how much of what was published before the kill is missing [s]."""

    life: float
    readable: bool
    messages: int
    loss: float
    problem: str = ""


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Kill recorders of a running simulator and read what they leave."""
    rng = np.random.default_rng(seed)
    lives = rng.uniform(*LIFE, QUICK_RUNS if quick else RUNS)
    sim = Node(package="krang_sim", executable="sim_node", parameters={"scene": "locked_caster", "seed": seed})
    runs = []
    with free_domain() as domain, Programs(out / "logs", node_environment(domain)) as programs:
        programs.start("sim", node_command("sim", sim))
        with GraphClient(domain) as client, progress("killing recorders", total=len(lives)) as bar:
            client.wait_for_service("/grasp", PATIENCE)
            for number, life in enumerate(lives):
                runs.append(kill_one(programs, client, out / f"bag_{number}", float(life)))
                bar(number + 1)
    readable = sum(run.readable for run in runs)
    worst = max(run.loss for run in runs)
    rows = [
        at_least(f"recordings readable after kill -9, of {len(runs)}", readable, "1", len(runs)),
        at_most("longest loss before the kill", worst, "s", 1.0, mean_loss=float(np.mean([run.loss for run in runs]))),
    ]
    return Measured(rows, {"runs": [vars(run) for run in runs]})


def kill_one(programs: Programs, client: GraphClient, bag: Path, life: float) -> Killed:
    """Start a recorder, let it record for `life` seconds more once it is under way, kill it, read what it wrote."""
    if bag.exists():
        raise BringupError(f"{bag}: expected a name that is free, but it exists; choose another --out or remove it")
    name = bag.name
    node = Node(package="pbrl_bag", executable="recorder_node", parameters={"output": str(bag)})
    clock = client.listen(Clock, "/clock", latched=False)
    program = programs.start(name, node_command(name, node))
    # In mid-run: discovery of the simulator is over and chunks are coming.
    client.wait_until(lambda: size_of(bag) > UNDER_WAY, PATIENCE, f"{name} recorded nothing")
    end = time.monotonic() + life
    client.wait_until(lambda: time.monotonic() > end, PATIENCE, "the clock stands still")
    program.process.send_signal(signal.SIGKILL)
    programs.stop(name)
    client.forget(clock)
    return read_back(next(bag.glob("*.mcap")), life, clock.time_ns)


def size_of(bag: Path) -> int:
    """Return the size [bytes] of a bag's files so far."""
    return sum(file.stat().st_size for file in bag.glob("*.mcap"))


def read_back(path: Path, life: float, heard: int) -> Killed:
    """Read every message of a file, and compare the last one's time with `heard` [ns], the last before the kill."""
    try:
        messages = list(McapFile(path).messages())
    except BagError as error:
        return Killed(life, False, 0, life, str(error))
    if not messages:
        return Killed(life, False, 0, life, "no messages")
    return Killed(life, True, len(messages), max(0, heard - max(message.log_time for message in messages)) / 1e9)
