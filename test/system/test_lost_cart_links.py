"""Links fail while the PR2 takes its cart through a hall: it rests within 0.3 s, and goes on when they are back."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import rclpy
import yaml
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String
from way import fastest

from pbrl_bringup.graph import free_domain, load_graph, node_command, node_environment, wait_ready, with_parameters
from pbrl_bringup.processes import Programs
from pbrl_bringup.ros.client import GraphClient
from pbrl_control.ros.floor_conversions import odometry_from_msg
from pbrl_control.ros.qos import COMMANDS, LATCHED
from pbrl_planner.ros.conversions import pose_to_msg
from pr2_cart_sim.maps import FREE, OCCUPIED, GridMap, save_map

FIRST, EVERY, LASTS = 30.0, 5.0, 1.5
"""[s] of simulated time: of the first fault, from one to the next, and for which each lasts."""
FAULTS = {
    "/scan": {"lost": 1.0},
    "/joint_states": {"lost": 1.0},
    "/cart_pose/*": {"lost": 1.0},
    "/cmd_vel": {"lost": 1.0},
    "/cmd_ve*": {"nan": 1.0},
}
RESTS, AT_REST, DRIVES = 0.3, 0.02, 0.05  # [s], [m/s], [m/s]
LENGTH, GOAL = 26.0, (23.5, 1.5, 0.0)  # [m], [m, rad]
RATE = "0.9"
STARTED = 200.0  # [s] of the wall clock


def begin_of(fault: str) -> float:
    return FIRST + EVERY * list(FAULTS).index(fault)


def write_hall(folder: Path) -> Path:
    """Write a hall that takes longer to drive through than the faults last, all on its map."""
    cells = np.full((64, int(20 * LENGTH) + 4), FREE, np.int8)
    cells[:2] = cells[-2:] = OCCUPIED
    cells[:, :2] = cells[:, -2:] = OCCUPIED
    save_map(GridMap(0.05, (-0.1, -0.1), cells), folder / "hall_map.yaml")
    cart = {"kind": "utility_cart", "size": [1.0, 0.55], "height": 0.90, "nominal_mass": 25.0, "upper_shelf": False}
    far = LENGTH + 0.1
    links = {fault: how | {"since": begin_of(fault), "until": begin_of(fault) + LASTS} for fault, how in FAULTS.items()}
    scene = {
        "map": "hall_map.yaml",
        "room": {"outline": [[-0.1, -0.1], [far, -0.1], [far, 3.1], [-0.1, 3.1]]},
        "robot": {"pose": [1.0, 1.5, 0.0], "torso": 0.244, "holds": "cart"},
        "bodies": {"cart": cart | {"pose": [2.134, 1.5, 0.0]}},
        "sensors": {"base_laser": {"increment": 0.0175}, "tilt_laser": {"increment": 0.5, "rate": 0.1}},
        "faults": {"links": links},
    }
    path = folder / "hall.yaml"
    path.write_text(yaml.safe_dump(scene), encoding="utf-8")
    return path


class Passenger(Node):
    """Asks for the goal as RViz does, and keeps where the base is and what the navigator says."""

    def __init__(self, context: Context, programs: Programs) -> None:
        super().__init__("passenger", context=context, enable_rosout=False)
        self.way: list[tuple[float, np.ndarray]] = []
        self.floors: list[OccupancyGrid] = []
        self.said: list[str] = []
        self._programs = programs
        self._spinner = SingleThreadedExecutor(context=context)
        self._spinner.add_node(self)
        self.create_subscription(Odometry, "/odom", lambda heard: self.way.append(odometry_from_msg(heard)), 50)
        self.create_subscription(OccupancyGrid, "/local_costmap/costmap", self.floors.append, LATCHED)
        self.create_subscription(String, "/cart_navigator/status", lambda heard: self.said.append(heard.data), LATCHED)
        self._goal = self.create_publisher(PoseStamped, "/goal_pose", COMMANDS)

    def send(self) -> None:
        """Give the goal as soon as there is a floor to plan on."""
        self.until(lambda: bool(self.floors) and self._goal.get_subscription_count() > 0)
        goal = PoseStamped(pose=pose_to_msg(np.array(GOAL)))
        goal.header.frame_id = "map"
        self._goal.publish(goal)

    def until(self, condition: Callable[[], bool]) -> None:
        """Let messages come until a condition holds."""
        deadline = time.monotonic() + STARTED
        while not condition():
            assert time.monotonic() < deadline, self.said
            self._spinner.spin_once(timeout_sec=0.1)
            self._programs.check()

    def leave(self) -> None:
        """Leave the graph."""
        self._spinner.shutdown()
        self.destroy_node()


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Passenger]:
    folder = tmp_path_factory.mktemp("lost_cart_links")
    graph = load_graph("pr2")
    told = {"sim.scene": str(write_hall(folder)), "sim.rate": RATE, "sim.command_lag": "0.07"}
    nodes = with_parameters(graph, told).nodes
    after = {name: node for name, node in nodes.items() if name not in ("sim", "recorder")}
    with free_domain() as domain, Programs(folder / "logs", node_environment(domain)) as programs:
        for name, node in after.items():
            programs.start(name, node_command(name, node))
        with GraphClient(domain, programs.check) as client:
            wait_ready(graph.model_copy(update={"nodes": after}), client, STARTED)
        # Simulated time begins last: the drive is under way when the first link fails.
        programs.start("sim", node_command("sim", nodes["sim"]))
        context = Context()
        rclpy.init(context=context, domain_id=domain)
        passenger = Passenger(context, programs)
        passenger.send()
        end = FIRST + EVERY * len(FAULTS)
        passenger.until(lambda: bool(passenger.way) and passenger.way[-1][0] > end)
        yield passenger
        passenger.leave()
        rclpy.try_shutdown(context=context)


@pytest.mark.timeout(300)
@pytest.mark.parametrize("fault", FAULTS)
def test_robot_and_cart_rest_while_a_link_is_lost_and_go_on_when_it_is_back(drive: Passenger, fault: str) -> None:
    begin = begin_of(fault)
    assert fastest(drive.way, begin - 0.6, begin) > DRIVES, "it drives until then"
    assert fastest(drive.way, begin + RESTS, begin + LASTS - 0.1) < AT_REST
    assert fastest(drive.way, begin + LASTS + 0.8, begin + EVERY - 0.1) > DRIVES, drive.said
