"""Somebody subscribes to everything and never reads: nobody else waits for him."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rosgraph_msgs.msg import Clock

from pbrl_bringup.graph import free_domain, load_graph, running_graph, with_parameters
from pbrl_bringup.processes import Programs

READER = Path(__file__).parent / "reader_that_stops.py"
TOPICS = 8
"""So many topics it has heard from before it stops."""
LASTS = 8.0
"""[s] of the wall clock with a reader that has stopped, and as many before it."""
NO_SLOWER, PAUSE = 0.5, 1.0
"""Share of the speed before it came that is left at least, on a machine that has other work too; and the longest
silence beyond the longest before it [s]. Who waited would go at a tenth of the speed: each message waits 0.1 s."""
TRIES = 3
"""Readers that stop, one after the other, until one of them holds up nobody: whoever waits for such a reader waits for
each, where a machine that has other work is late now and then."""
RATE = 0.5


class Watcher:
    """When it heard of which simulated time."""

    def __init__(self, context: Context, programs: Programs) -> None:
        self.node = rclpy.create_node("watcher", context=context, enable_rosout=False)
        self.heard: list[tuple[float, float]] = []
        self._programs = programs
        self._spinner = SingleThreadedExecutor(context=context)
        self._spinner.add_node(self.node)
        self.node.create_subscription(Clock, "/clock", self._on_clock, 10)

    def _on_clock(self, message: Clock) -> None:
        self.heard.append((time.monotonic(), message.clock.sec + 1e-9 * message.clock.nanosec))

    def listen(self, seconds: float) -> tuple[float, float]:
        """Listen for so long [s]; return how fast simulated time went, and the longest silence [s]."""
        first, until = len(self.heard), time.monotonic() + seconds
        while time.monotonic() < until:
            self._spinner.spin_once(timeout_sec=0.1)
            self._programs.check()
        wall, simulated = np.array(self.heard[first:]).T
        return float((simulated[-1] - simulated[0]) / (wall[-1] - wall[0])), float(np.diff(wall).max())

    def until_heard(self) -> None:
        """Wait for the first message."""
        while not self.heard:
            self._spinner.spin_once(timeout_sec=0.1)
            self._programs.check()

    def leave(self) -> None:
        """Leave the graph."""
        self._spinner.shutdown()
        self.node.destroy_node()


def test_nobody_waits_for_a_reader_that_has_stopped(tmp_path: Path, nothing_left: None) -> None:
    graph = load_graph("namo")
    graph = graph.model_copy(update={"nodes": {name: graph.nodes[name] for name in ("sim", "controller", "recorder")}})
    graph = with_parameters(graph, {"sim.rate": str(RATE), "recorder.output": str(tmp_path / "bag")})
    with free_domain() as domain, running_graph(graph, tmp_path / "logs", domain) as programs:
        context = Context()
        rclpy.init(context=context, domain_id=domain)
        watcher = Watcher(context, programs)
        watcher.until_heard()
        alone, usual = watcher.listen(LASTS)
        for _ in range(TRIES):
            rate, silence = beside_a_stopped_reader(watcher, domain)
            if rate > NO_SLOWER * alone and silence < usual + PAUSE:
                break
        watcher.leave()
        rclpy.try_shutdown(context=context)
    assert rate > NO_SLOWER * alone, "the simulator does not wait for it"
    assert silence < usual + PAUSE


def beside_a_stopped_reader(watcher: Watcher, domain: int) -> tuple[float, float]:
    """Start a reader and wait until it has stopped; return what `listen` then hears, and kill it."""
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    command = [sys.executable, str(READER), str(TOPICS)]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as reader:
        try:
            assert reader.stdout is not None
            assert int(reader.stdout.readline()) >= TOPICS
            os.waitpid(reader.pid, os.WUNTRACED)  # it has stopped
            return watcher.listen(LASTS)
        finally:
            reader.kill()
