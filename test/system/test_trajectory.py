"""A whole trajectory of an object over DDS: drive-up, grasp, the way, release; it ends where it was to end."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64, String

from pbrl_bringup.graph import Graph, free_domain, load_graph, running_graph, with_parameters
from pbrl_bringup.processes import Programs
from pbrl_control.percept import object_planar
from pbrl_control.ros.conversions import tag_from_msg
from pbrl_control.trajectories.trajectory_plan import load_trajectory

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PLAN, SCENE = "turn_about_caster", "locked_caster"
PLACE, YAW = 0.04, math.radians(2.0)  # [m, rad] of the end, as tags show it: their bias is up to 8 mm
PATIENCE = 240.0  # [s]
SEEN = 10  # tags that make a pose


class Watcher(Node):
    """Keeps what the push says, the poses that tags show in each of its phases, and shares of the asked twist."""

    def __init__(self, context: Context) -> None:
        super().__init__("watcher", context=context, enable_rosout=False)
        self.phases: list[str] = []
        self.poses: dict[str, list[np.ndarray]] = {}
        self.shares: list[float] = []
        self.create_subscription(String, "/push/status", lambda message: self.phases.append(message.data), LATCHED)
        self.create_subscription(PoseStamped, f"/ar_tags/{load_trajectory(PLAN).object}/pose", self._see, 10)
        self.create_subscription(
            Float64, "/body_controller/share", lambda message: self.shares.append(message.data), 10
        )

    def _see(self, message: PoseStamped) -> None:
        if self.phases:
            self.poses.setdefault(self.phases[-1], []).append(object_planar(tag_from_msg(message)))

    def ended(self) -> bool:
        """Say whether it failed, or has been done for as long as it takes to see where."""
        last = self.phases[-1] if self.phases else ""
        return last.startswith("failed") or len(self.poses.get("done", [])) >= SEEN


@pytest.fixture
def graph(tmp_path: Path, nothing_left: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[int, Programs]]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    whole = load_graph("krang_push")
    graph: Graph = whole.model_copy(
        update={"nodes": {name: whole.nodes[name] for name in ("sim", "controller", "push")}}
    )
    settings = {"sim.scene": SCENE, "sim.seed": "3", "sim.rate": "0", "push.trajectory": PLAN}
    with (
        free_domain() as domain,
        running_graph(with_parameters(graph, settings), tmp_path / "logs", domain) as programs,
    ):
        yield domain, programs


def test_a_table_is_turned_to_where_its_trajectory_ends(graph: tuple[int, Programs]) -> None:
    domain, programs = graph
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    watcher, executor = Watcher(context), SingleThreadedExecutor(context=context)
    executor.add_node(watcher)
    try:
        deadline = time.monotonic() + PATIENCE
        while not watcher.ended():
            assert time.monotonic() < deadline, f"not done after {PATIENCE:.0f} s: {watcher.phases}"
            executor.spin_once(timeout_sec=0.05)
            programs.check()
    finally:
        executor.shutdown()
        watcher.destroy_node()
        rclpy.try_shutdown(context=context)
    assert watcher.phases[-1] == "done", watcher.phases
    assert {"approach", "grasp", "push", "release"} <= set(watcher.phases)
    start, end = (np.mean(watcher.poses[phase][-SEEN:], axis=0) for phase in ("approach", "done"))
    goal = load_trajectory(PLAN).trajectory(start).end
    assert math.dist(goal[:2], end[:2]) < PLACE
    assert abs(goal[2] - end[2]) < YAW
    assert abs(start[2] - end[2]) > math.radians(15.0), "which is elsewhere"
    assert 0.0 <= min(watcher.shares) <= np.median(watcher.shares) <= max(watcher.shares) <= 1.0 + 1e-9
    assert np.median(watcher.shares) > 0.5
