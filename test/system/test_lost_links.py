"""Links between robot and controller fail while it drives: it rests within 0.3 s, and goes on when they are back."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from way import fastest

from pbrl_bringup.graph import free_domain, load_graph, running_graph, with_parameters
from pbrl_bringup.processes import Programs
from pbrl_control.ros.floor_conversions import odometry_from_msg

FIRST, EVERY, LASTS = 12.0, 4.0, 1.5
"""[s] of simulated time: of the first fault, from one to the next, and for which each lasts. Until the first, a
controller that compiles on a busy machine has begun to drive."""
FAULTS = {
    "/cmd_vel": "lost: 1.0",
    "/joint_states": "lost: 1.0",
    "/ar_tags/*": "lost: 1.0",
    "/cmd_ve*": "nan: 1.0",
    "/cmd_v*": "late: 30.0",
}
RESTS, AT_REST, DRIVES = 0.3, 0.01, 0.03  # [s], [m/s], [m/s]: where the machine is busy it drives by fits and starts
RATE = 0.5
SCENE = """
name: lost_links
room: {outline: [[-2.0, -2.0], [8.0, -2.0], [8.0, 2.0], [-2.0, 2.0]]}
bodies: {}
faults:
  links:
"""


def begin_of(fault: str) -> float:
    return FIRST + EVERY * list(FAULTS).index(fault)


class Driver(Node):
    """Commands the base to drive on whenever it hears of it, and keeps where it is."""

    def __init__(self, context: Context, programs: Programs) -> None:
        super().__init__("driver", context=context, enable_rosout=False)
        self.way: list[tuple[float, np.ndarray]] = []
        self._programs = programs
        self._spinner = SingleThreadedExecutor(context=context)
        self._spinner.add_node(self)
        self._twist = self.create_publisher(TwistStamped, "/object_twist_command", 10)
        self.create_subscription(Odometry, "/odom", self._on_odometry, 50)

    def _on_odometry(self, message: Odometry) -> None:
        self.way.append(odometry_from_msg(message))
        told = TwistStamped(twist=Twist())
        told.header.frame_id = "base"
        told.twist.linear.x = 0.1
        self._twist.publish(told)

    def until(self, time: float) -> None:
        """Let messages come until a simulated time [s]."""
        while not self.way or self.way[-1][0] < time:
            self._spinner.spin_once(timeout_sec=0.1)
            self._programs.check()

    def leave(self) -> None:
        """Leave the graph."""
        self._spinner.shutdown()
        self.destroy_node()


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Driver]:
    folder = tmp_path_factory.mktemp("lost_links")
    rows = [
        f"    {fault}: {{{how}, since: {begin_of(fault)}, until: {begin_of(fault) + LASTS}}}\n"
        for fault, how in FAULTS.items()
    ]
    scene = folder / "scene.yaml"
    scene.write_text(SCENE + "".join(rows).replace("/ar_tags/*:", '"/ar_tags/*":'), encoding="utf-8")
    graph = load_graph("namo")
    graph = graph.model_copy(update={"nodes": {name: graph.nodes[name] for name in ("sim", "controller")}})
    graph = with_parameters(graph, {"sim.scene": str(scene), "sim.rate": str(RATE)})
    with free_domain() as domain, running_graph(graph, folder / "logs", domain) as programs:
        context = Context()
        rclpy.init(context=context, domain_id=domain)
        driver = Driver(context, programs)
        driver.until(FIRST + EVERY * len(FAULTS))
        yield driver
        driver.leave()
        rclpy.try_shutdown(context=context)


@pytest.mark.timeout(300)
@pytest.mark.parametrize("fault", FAULTS)
def test_the_robot_rests_while_a_link_is_lost_and_goes_on_when_it_is_back(drive: Driver, fault: str) -> None:
    begin = begin_of(fault)
    assert fastest(drive.way, begin - 0.6, begin) > DRIVES, "it drives until then"
    assert fastest(drive.way, begin + RESTS, begin + LASTS - 0.1) < AT_REST
    assert fastest(drive.way, begin + LASTS + 0.8, begin + EVERY - 0.1) > DRIVES
