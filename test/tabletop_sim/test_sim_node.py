"""The node as a user starts it: links of a desk's scene fail as they do in a room's."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import rclpy
import yaml
from ament_index_python.packages import get_package_prefix, get_package_share_directory
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

SINCE, LASTS = 4.0, 6.0  # [s] of simulated time


def test_links_fail_as_the_scene_has_it(domain: int, tmp_path: Path) -> None:
    desk = yaml.safe_load((Path(get_package_share_directory("pbrl_config")) / "desks" / "desk.yaml").read_text())
    desk["faults"] = {"links": {"/joint_states": {"lost": 1.0, "since": SINCE}}}
    scene = tmp_path / "desk.yaml"
    scene.write_text(yaml.safe_dump(desk))
    heard: dict[str, list[float]] = {"joints": [], "clock": []}
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node("listener", context=context)
    spinner = SingleThreadedExecutor(context=context)
    spinner.add_node(node)

    def joints(message: JointState) -> None:
        heard["joints"].append(message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec)

    node.create_subscription(JointState, "/joint_states", joints, 10)
    node.create_subscription(Clock, "/clock", lambda message: heard["clock"].append(message.clock.sec), 10)
    executable = Path(get_package_prefix("tabletop_sim")) / "lib" / "tabletop_sim" / "sim_node"
    words = [f"scene:={scene}", "vision:=noise", f"duration:={LASTS}"]
    command = [str(executable), "--ros-args", *(word for each in words for word in ("-p", each))]
    environment = os.environ | {"ROS_DOMAIN_ID": str(domain)}
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None:
            spinner.spin_once(timeout_sec=0.05)
        _, told = process.communicate()
    spinner.shutdown()
    node.destroy_node()
    rclpy.try_shutdown(context=context)
    assert process.returncode == 0 and "faults are injected" in told
    assert 0.0 < max(heard["joints"]) < SINCE <= max(heard["clock"])
