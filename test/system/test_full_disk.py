"""The disk is full for the recorder: `./pbrl run` says what it said, and the rest of the graph goes on."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rosgraph_msgs.msg import Clock

from pbrl_bag.mcap_file import McapFile
from pbrl_bringup.graph import free_domain

MOST = 800_000  # [bytes] of a file; the simulator keeps none, and the middleware wants some
LONGER = 3.0  # [s] of simulated time after the recorder's end


def test_the_graph_goes_on_without_its_recorder(
    tmp_path: Path, nothing_left: None, little_room: Callable[[int], AbstractContextManager[None]]
) -> None:
    environment = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    settings = ["--set", f"recorder.output={tmp_path / 'bag'}", "--set", "sim.rate=0.5", "--with", "recorder"]
    with free_domain() as domain:
        command = [sys.executable, "-m", "pbrl_bringup", "run", "namo", *settings, "--domain", str(domain)]
        with little_room(MOST):
            graph = subprocess.Popen(
                command, cwd=tmp_path, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
            )
        with graph:
            assert graph.stderr is not None
            said = next(line for line in graph.stderr if "cannot write" in line)
            context = Context()
            rclpy.init(context=context, domain_id=domain)
            node = rclpy.create_node("listener", context=context, enable_rosout=False)
            times: list[float] = []
            node.create_subscription(Clock, "/clock", lambda m: times.append(m.clock.sec + 1e-9 * m.clock.nanosec), 10)
            spinner = SingleThreadedExecutor(context=context)
            spinner.add_node(node)
            while not times or times[-1] < times[0] + LONGER:
                spinner.spin_once(timeout_sec=0.1)
                assert graph.poll() is None
            spinner.shutdown()
            node.destroy_node()
            rclpy.try_shutdown(context=context)
            graph.send_signal(signal.SIGINT)
            rest = graph.stderr.read()
    assert "messages before it are kept" in said and "Traceback" not in rest
    assert len(list(McapFile(tmp_path / "bag" / "bag_0.mcap").messages())) > 100
