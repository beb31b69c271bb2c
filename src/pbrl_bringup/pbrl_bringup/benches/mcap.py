"""A recording read by two readers that know nothing of ours: rosbags (Python) and @mcap/core (npm)."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections import Counter
from pathlib import Path

from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.msg import get_types_from_msg
from rosgraph_msgs.msg import Clock

from bullet_sim.scene import load_scene
from pbrl_bag.mcap_file import McapFile
from pbrl_bringup.benches.rows import Measured, Row, at_least
from pbrl_bringup.debian import ensure_program
from pbrl_bringup.errors import BringupError
from pbrl_bringup.graph import Node, free_domain, node_command, node_environment
from pbrl_bringup.processes import Programs
from pbrl_bringup.ros.client import GraphClient
from pbrl_bringup.simulate import simulate_push
from pbrl_control.push_plan import load_plan

SCRIPT = Path(__file__).with_name("read_mcap.mjs")
NPM_PACKAGES = (
    "@mcap/core@2.2.2",
    "@mcap/support@1.1.0",
    "@foxglove/rosmsg@5.0.5",
    "@foxglove/rosmsg2-serialization@3.1.0",
)


RECORDED = 4.0  # [s] of a running graph
PATIENCE = 60.0  # [s]


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Make a recording without and one with middleware, and count what each reader decodes of them."""
    rows, details = [], {}
    for how, make in (("simulate", simulated_bag), ("recorder node", recorded_bag)):
        bag = out / how.replace(" ", "_")
        shutil.rmtree(bag, ignore_errors=True)
        make(seed, bag)
        file = next(bag.glob("*.mcap"))
        ours = dict(Counter(message.topic for message in McapFile(file).messages()))
        readers = {"rosbags": read_with_rosbags(bag), "@mcap/core": read_with_npm(file)}
        details[how] = {"ours": ours, **readers}
        rows += [decoded_row(how, name, ours, counts) for name, counts in readers.items()]
    return Measured(rows, details)


def decoded_row(how: str, reader: str, ours: dict[str, int], counts: dict[str, int]) -> Row:
    """Return the row that compares what a reader decoded with what is in the file."""
    total = sum(ours.values())
    decoded = sum(min(counts.get(topic, 0), count) for topic, count in ours.items())
    return at_least(
        f"bag of {how}: messages decoded by {reader}", decoded, "1", total, written=total, topics=len(counts)
    )


def simulated_bag(seed: int, bag: Path) -> None:
    """Record a push in one process."""
    simulate_push(load_scene("locked_caster"), load_plan("turn_table"), seed, bag)


def recorded_bag(seed: int, bag: Path) -> None:
    """Record a running simulator with the recorder node, as the messages are on the wire."""
    sim = Node(package="krang_sim", executable="sim_node", parameters={"scene": "three_tables", "seed": seed})
    recorder = Node(package="pbrl_bag", executable="recorder_node", parameters={"output": str(bag)})
    with free_domain() as domain, Programs(bag.parent / "logs", node_environment(domain)) as programs:
        for name, node in {"recorder": recorder, "sim": sim}.items():
            programs.start(name, node_command(name, node))
        with GraphClient(domain, programs.check) as client:
            clock = client.listen(Clock, "/clock", latched=False)
            client.wait_until(lambda: clock.count > 100 * RECORDED, PATIENCE, "the clock stands still")
        programs.stop("recorder")


def read_with_rosbags(bag: Path) -> dict[str, int]:
    """Decode every message with rosbags, with the definitions in the bag; return the count by topic."""
    store = get_typestore(Stores.EMPTY)
    counts: Counter[str] = Counter()
    with Reader(bag) as reader:
        for connection in reader.connections:
            store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
        for connection, _, data in reader.messages():
            store.deserialize_cdr(data, connection.msgtype)
            counts[connection.topic] += 1
    return dict(counts)


def read_with_npm(file: Path) -> dict[str, int]:
    """Decode every message with @mcap/core; return the count by topic.

    Raises:
        BringupError: there is no node or npm, the packages cannot be had, or a message does not decode.
    """
    node = ensure_program("node", "nodejs", "the bench of MCAP readers")
    folder = npm_folder()
    result = subprocess.run([node, str(SCRIPT), str(file.resolve())], cwd=folder, capture_output=True, text=True)
    if result.returncode:
        raise BringupError(
            result.stderr.strip().splitlines()[-1] if result.stderr.strip() else "read_mcap said nothing"
        )
    return dict(json.loads(result.stdout))


def npm_folder() -> Path:
    """Return the folder with the npm packages; fetch them first where it is not there.

    Raises:
        BringupError: npm is missing or failed.
    """
    base = Path(os.environ.get("VIRTUAL_ENV", "out/bench")) / "cache/read_mcap"
    if (base / "node_modules/@foxglove/rosmsg2-serialization").is_dir():
        return base
    npm = ensure_program("npm", "npm", "the bench of MCAP readers")
    base.mkdir(parents=True, exist_ok=True)
    (base / "package.json").write_text('{"private": true}\n', encoding="utf-8")
    command = [npm, "install", "--no-audit", "--no-fund", "--loglevel=error", *NPM_PACKAGES]
    result = subprocess.run(command, cwd=base, capture_output=True, text=True)
    if result.returncode:
        said = (result.stderr.strip().splitlines() or ["nothing"])[0]
        raise BringupError(f"npm could not install {NPM_PACKAGES[0]} and its like: {said}; is the network there?")
    return base
