"""How evenly the controller's commands come: its node beside the simulator's, over DDS, two arms that hold a table."""

from __future__ import annotations

import os
import resource
from pathlib import Path

import numpy as np
from geometry_msgs.msg import Twist
from std_msgs.msg import String

from pbrl_bringup.benches.rows import Row, at_least, at_most
from pbrl_bringup.errors import BringupError
from pbrl_bringup.graph import Graph, free_domain, load_graph, running_graph, with_parameters
from pbrl_bringup.ros.moments import Moments, MomentsClient

RATE = 200.0
"""[Hz]"""
PRIORITY = 50
"""Real-time priority of the controller, where it may have one; that of ros2_control."""
JITTER = 2.0
"""p99 of how far an interval between commands is from the period [ms]."""
SLACK = 0.99
"""Of the rate that has to be held."""
LEAST = 1000
"""Commands that make a percentile."""
PATIENCE = 240.0
"""[s]"""


def jitter_rows(seed: int, out: Path) -> list[Row]:
    """Measure rate and jitter of /cmd_vel at real time while a table is moved along `straight_and_turn`.

    Args:
        seed: of the simulator.
        out: folder for the nodes' logs.

    Raises:
        BringupError: a node ended, or the table was not moved for long enough.
    """
    moments = while_moved(seed, out / "logs")
    if len(moments.sent) < LEAST:
        raise BringupError(f"expected {LEAST} commands while a table is moved, got {len(moments.sent)}; see {out}/logs")
    sent, came = (np.array(each) for each in (moments.sent, moments.came))
    rate = (len(sent) - 1) / (sent[-1] - sent[0])
    off, late = (1e3 * np.abs(np.diff(each) - 1.0 / RATE) for each in (sent, came))
    beside = {
        "priority": priority(),
        "median": np.median(off),
        "worst": off.max(),
        "p99 as they came": np.percentile(late, 99.0),
    }
    what = "their jitter: p99 of |interval - 5 ms| as they were sent"
    return [
        at_least(
            "commands a second beside the simulator, controller.rate 200",
            float(rate),
            "Hz",
            SLACK * RATE,
            commands=len(sent),
            cores=len(os.sched_getaffinity(0)),
        ),
        at_most(what, float(np.percentile(off, 99.0)), "ms", JITTER, **{k: float(v) for k, v in beside.items()}),
    ]


def while_moved(seed: int, logs: Path) -> Moments:
    """Return the moments of the commands from the closed grips to their release."""
    with (
        free_domain() as domain,
        running_graph(two_arms(seed), logs, domain) as programs,
        MomentsClient(domain, programs.check) as client,
    ):
        status = client.listen(String, "/push/status")

        def phase(*names: str) -> bool:
            return status.message is not None and status.message.data.startswith(names)

        moments = client.moments(Twist, "/cmd_vel", lambda: phase("push"))
        client.wait_until(lambda: phase("release", "done", "failed"), PATIENCE, "the table is still moved")
        return moments


def two_arms(seed: int) -> Graph:
    """Return simulator, controller and push node, at real time."""
    whole = load_graph("krang_push")
    graph = whole.model_copy(update={"nodes": {name: whole.nodes[name] for name in ("sim", "controller", "push")}})
    settings = {"sim.scene": "free_table", "sim.seed": str(seed), "push.trajectory": "straight_and_turn"}
    return with_parameters(graph, {**settings, "controller.rate": str(RATE), "controller.priority": str(priority())})


def priority() -> int:
    """Return the controller's priority: none where this user may not give one."""
    return PRIORITY if os.geteuid() == 0 or resource.getrlimit(resource.RLIMIT_RTPRIO)[0] >= PRIORITY else 0
