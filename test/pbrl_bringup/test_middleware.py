"""The profile of the middleware that the workspace has: off shared memory, and heard by whoever is on this machine."""

from __future__ import annotations

import subprocess
import sys

import pytest

from pbrl_bringup.graph import free_domain, node_environment
from pbrl_bringup.paths import config_file

RANGE, PROFILES = "ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTRTPS_DEFAULT_PROFILES_FILE"
TALKS = """
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node("talks")
word = node.create_publisher(String, "word", QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
word.publish(String(data=open("/proc/self/maps").read()))
rclpy.spin(node)
"""
HEARS = """
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.wait_for_message import wait_for_message
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node("hears")
qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
heard, message = wait_for_message(String, node, "word", qos_profile=qos, time_to_wait=60.0)
print(message.data if heard else "nothing was heard")
"""


@pytest.mark.parametrize("listener", [None, "LOCALHOST", "SUBNET"])
def test_a_node_maps_no_shared_memory_and_is_heard_by_others_of_this_machine(listener: str | None) -> None:
    with free_domain() as domain:
        others = {key: value for key, value in node_environment(domain).items() if key != "FASTDDS_BUILTIN_TRANSPORTS"}
        talks = others | {PROFILES: str(config_file("middleware", "fast_dds", ".xml")), RANGE: "SYSTEM_DEFAULT"}
        hears = talks if listener is None else others | {RANGE: listener}
        with subprocess.Popen([sys.executable, "-c", TALKS], env=talks) as talking:
            try:
                done = subprocess.run(
                    [sys.executable, "-c", HEARS], env=hears, capture_output=True, text=True, timeout=100, check=True
                )
            finally:
                talking.kill()
    assert "libfastrtps" in done.stdout
    assert "/dev/shm/fastrtps" not in done.stdout
