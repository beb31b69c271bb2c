"""A whole trajectory of an object over DDS: drive-up, grasp, the way, release; it ends where it was to end."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64, String

from pbrl_bringup.graph import free_domain, load_graph, running_graph, with_parameters
from pbrl_bringup.processes import Programs
from pbrl_control.percept import object_planar
from pbrl_control.push import Phase
from pbrl_control.ros.conversions import tag_from_msg
from pbrl_control.trajectories.trajectory_plan import load_trajectory

EVERY = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PLAN, SCENE = "turn_about_caster", "locked_caster"
PLACE, YAW = 0.04, math.radians(2.0)  # [m, rad] of the end, as tags show it: their bias is up to 8 mm
PATIENCE = 240.0  # [s]
SEEN = 10  # tags that make a pose
BEFORE = "before"  # in place of a phase, until the first one is told


class Watcher(Node):
    """Keeps what the push says, the poses that tags show in each of its phases, and shares of the asked twist."""

    def __init__(self, context: Context) -> None:
        super().__init__("watcher", context=context, enable_rosout=False)
        self.phases: list[str] = []
        self.poses: dict[str, list[np.ndarray]] = {}
        self.shares: list[float] = []
        self.create_subscription(String, "/push/status", lambda message: self.phases.append(message.data), EVERY)
        self.create_subscription(PoseStamped, f"/ar_tags/{load_trajectory(PLAN).object}/pose", self._see, 10)
        self.create_subscription(
            Float64, "/body_controller/share", lambda message: self.shares.append(message.data), 10
        )

    def _see(self, message: PoseStamped) -> None:
        phase = self.phases[-1] if self.phases else BEFORE
        self.poses.setdefault(phase, []).append(object_planar(tag_from_msg(message)))

    def seen(self, phase: str) -> bool:
        """Say whether poses of a phase have come for as long as it takes to see where."""
        return len(self.poses.get(phase, [])) >= SEEN

    def ended(self) -> bool:
        """Say whether it failed, or is seen to be done."""
        return self.seen("done") or any(phase.startswith("failed") for phase in self.phases)


@pytest.fixture
def watched(nothing_left: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[int, Watcher, Executor]]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = Context()
    with free_domain() as domain:
        rclpy.init(context=context, domain_id=domain)
        watcher, executor = Watcher(context), SingleThreadedExecutor(context=context)
        executor.add_node(watcher)
        yield domain, watcher, executor
        executor.shutdown()
        watcher.destroy_node()
        rclpy.try_shutdown(context=context)


def spin_until(done: Callable[[], bool], executor: Executor, *running: Programs) -> None:
    """Spin until something is so; fails when a program has ended, or after `PATIENCE`."""
    deadline = time.monotonic() + PATIENCE
    while not done():
        assert time.monotonic() < deadline, f"not so after {PATIENCE:.0f} s"
        executor.spin_once(timeout_sec=0.05)
        for programs in running:
            programs.check()


def test_a_table_is_turned_to_where_its_trajectory_ends(watched: tuple[int, Watcher, Executor], tmp_path: Path) -> None:
    domain, watcher, executor = watched
    whole = with_parameters(
        load_graph("krang_push"),
        {"sim.scene": SCENE, "sim.seed": "3", "sim.rate": "0", "push.trajectory": PLAN},
    )
    robot, push = (
        whole.model_copy(update={"nodes": {name: whole.nodes[name] for name in names}})
        for names in (("sim", "controller"), ("push",))
    )
    with running_graph(robot, tmp_path / "robot", domain) as running:
        # A watcher that is found late would miss the drive-up, which lasts a quarter of a second at this rate.
        spin_until(lambda: watcher.seen(BEFORE), executor, running)
        with running_graph(push, tmp_path / "push", domain) as pushing:
            spin_until(watcher.ended, executor, running, pushing)
    # Whoever is found late does not hear all phases: some last a quarter of a second at this rate.
    logged = re.findall(r"\[push\]: (\w+): ", (tmp_path / "push" / "push.log").read_text(encoding="utf-8"))
    order = list(dict.fromkeys(logged))
    assert order == [phase for phase in Phase if phase in order], "phases come in their order"
    assert {"grasp", "push", "release"} <= set(order)
    assert order[-1] == watcher.phases[-1] == "done"
    start, end = (np.mean(watcher.poses[phase][-SEEN:], axis=0) for phase in (BEFORE, "done"))
    goal = load_trajectory(PLAN).trajectory(start).end
    assert math.dist(goal[:2], end[:2]) < PLACE
    assert abs(goal[2] - end[2]) < YAW
    assert abs(start[2] - end[2]) > math.radians(15.0), "which is elsewhere"
    assert 0.0 <= min(watcher.shares) <= np.median(watcher.shares) <= max(watcher.shares) <= 1.0 + 1e-9
    assert np.median(watcher.shares) > 0.5
