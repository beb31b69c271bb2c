"""From RViz's goal to the goal: simulator, costmaps, planner, controller and navigator, each a node, over DDS."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
import yaml
from geometry_msgs.msg import Point, PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMsg
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import String

from pbrl_bringup.graph import free_domain, node_environment
from pbrl_bringup.paths import node_executable
from pbrl_control.ros.qos import COMMANDS, LATCHED
from pbrl_planner.cart.outline import motions
from pbrl_planner.ros.cart_controller_node import CartControllerNode
from pbrl_planner.ros.cart_navigator_node import CartNavigatorNode
from pbrl_planner.ros.conversions import pose_to_msg
from pbrl_planner.ros.costmap_node import CostmapNode
from pbrl_planner.ros.lattice_planner_node import LatticePlannerNode
from pr2_cart_sim.maps import FREE, OCCUPIED, GridMap, save_map

PATIENCE = 200.0  # [s] of the wall clock


@pytest.fixture
def hall(tmp_path: Path) -> Path:
    """A hall of 6 by 3 m with a box in it that is not in the map."""
    cells = np.full((64, 124), FREE, np.int8)
    cells[:2] = cells[-2:] = OCCUPIED
    cells[:, :2] = cells[:, -2:] = OCCUPIED
    save_map(GridMap(0.05, (-0.1, -0.1), cells), tmp_path / "hall_map.yaml")
    cart = {"kind": "utility_cart", "size": [1.0, 0.55], "height": 0.90, "nominal_mass": 25.0, "upper_shelf": False}
    box = {"kind": "fixture", "polygon": [[0, 0], [0.4, 0], [0.4, 0.3], [0, 0.3]], "height": 0.8, "pose": [3.6, 0, 0]}
    scene = {
        "map": "hall_map.yaml",
        "room": {"outline": [[-0.1, -0.1], [6.1, -0.1], [6.1, 3.1], [-0.1, 3.1]]},
        "robot": {"pose": [1.0, 1.5, 0.0], "torso": 0.244, "holds": "cart"},
        "bodies": {"cart": cart | {"pose": [2.134, 1.5, 0.0]}},
        "clutter": {"box": box},
        "sensors": {"base_laser": {"increment": 0.0175}, "tilt_laser": {"increment": 0.5, "rate": 0.1}},
    }
    path = tmp_path / "hall.yaml"
    path.write_text(yaml.safe_dump(scene))
    return path


class Graph:
    """The nodes but for the simulator, spun in this thread; what they say."""

    def __init__(self) -> None:
        sim_time = Parameter("use_sim_time", value=True)
        self.listener = Node("listener")
        self.nodes = [
            CostmapNode(parameter_overrides=[sim_time]),
            LatticePlannerNode(parameter_overrides=[sim_time, Parameter("coarse", value=True)]),
            CartControllerNode(parameter_overrides=[sim_time]),
            CartNavigatorNode(parameter_overrides=[sim_time]),
            self.listener,
        ]
        self.executor = EventsExecutor()
        for node in self.nodes:
            self.executor.add_node(node)
        self.said: list[str] = []
        self.place = Point()
        self.plans: list[PathMsg] = []
        self.floors: list[OccupancyGrid] = []
        create = self.listener.create_subscription
        create(String, "/cart_navigator/status", lambda message: self.said.append(message.data), LATCHED)
        create(PathMsg, "/plan", self.plans.append, LATCHED)
        create(PoseWithCovarianceStamped, "/amcl_pose", self._on_pose, COMMANDS)
        create(OccupancyGrid, "/local_costmap/costmap", self.floors.append, LATCHED)
        self.goal = self.listener.create_publisher(PoseStamped, "/goal_pose", COMMANDS)

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        self.place = message.pose.pose.position

    def off(self, x: float, y: float) -> float:
        """How far the robot is from a place, as the localiser says [m]."""
        return float(np.hypot(self.place.x - x, self.place.y - y))

    def until(self, condition: Callable[[], Any]) -> None:
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, self.said
            self.executor.spin_once(timeout_sec=0.1)

    def close(self) -> None:
        self.executor.shutdown()
        for node in self.nodes:
            node.destroy_node()


@pytest.fixture
def graph(hall: Path) -> Iterator[Graph]:
    words = [f"scene:={hall}", "rate:=0.9", "command_lag:=0.1", "seed:=1"]
    command = [str(node_executable("pr2_cart_sim", "sim_node")), "--ros-args"]
    command += [word for each in words for word in ("-p", each)]
    motions(1.0, 0.55, True)  # before anything moves: the planner's node finds it done
    with free_domain() as domain:
        rclpy.init(domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        made = Graph()
        sim = subprocess.Popen(command, env=node_environment(domain))
        yield made
        made.close()
        rclpy.try_shutdown()
        sim.terminate()
        assert sim.wait(PATIENCE) == 0


def test_a_goal_from_rviz_is_driven_to(graph: Graph) -> None:
    graph.until(lambda: graph.floors)
    goal = PoseStamped(pose=pose_to_msg(np.array([1.6, 1.5, 0.0])))
    goal.header.frame_id = "map"
    graph.goal.publish(goal)
    graph.until(lambda: graph.said and graph.said[-1].startswith(("arrived", "failed")))
    assert graph.said[-1].startswith("arrived"), graph.said
    assert graph.plans[-1].poses[-1].pose.position.x == pytest.approx(1.6, abs=0.04)
    assert graph.off(1.6, 1.5) < 0.12
