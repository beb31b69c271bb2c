"""Nodes of a graph: on this machine, heard by others on it, without shared memory, unless a user says otherwise."""

from __future__ import annotations

import subprocess
import sys

import pytest

from pbrl_bringup.graph import free_domain, node_environment
from pbrl_bringup.middleware import MIDDLEWARE, PROFILES, RANGE, TRANSPORTS, on_this_machine
from pbrl_bringup.paths import config_file

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


@pytest.fixture(autouse=True)
def _nothing_settled(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (RANGE, PROFILES, TRANSPORTS, MIDDLEWARE):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize("listener", [None, "LOCALHOST", "SUBNET"])
def test_a_node_maps_no_shared_memory_and_is_heard_by_others_of_this_machine(listener: str | None) -> None:
    with free_domain() as domain:
        environment = node_environment(domain)
        others = {key: value for key, value in environment.items() if key not in (PROFILES, RANGE)}
        hears = environment if listener is None else others | {RANGE: listener}
        with subprocess.Popen([sys.executable, "-c", TALKS], env=environment) as talks:
            try:
                done = subprocess.run(
                    [sys.executable, "-c", HEARS], env=hears, capture_output=True, text=True, timeout=100, check=True
                )
            finally:
                talks.kill()
    assert "libfastrtps" in done.stdout
    assert "/dev/shm/fastrtps" not in done.stdout


@pytest.mark.parametrize(
    "settled",
    [
        {RANGE: "SUBNET"},
        {PROFILES: "/somewhere/mine.xml"},
        {TRANSPORTS: "LARGE_DATA"},
        {MIDDLEWARE: "rmw_cyclonedds_cpp"},
    ],
)
def test_what_a_user_has_settled_stays(settled: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    for key, value in settled.items():
        monkeypatch.setenv(key, value)
    environment = node_environment(1)
    assert settled.items() <= environment.items()
    assert environment[RANGE] == settled.get(RANGE, "LOCALHOST")
    assert environment.get(PROFILES) == settled.get(PROFILES)


@pytest.mark.parametrize("before", [{}, {RANGE: "LOCALHOST"}, {MIDDLEWARE: "rmw_fastrtps_dynamic_cpp"}])
def test_this_machine_means_the_profile_and_twice_is_once(before: dict[str, str]) -> None:
    once = before | on_this_machine(before)
    assert once[PROFILES] == str(config_file("middleware", "fast_dds", ".xml"))
    assert once[RANGE] != "LOCALHOST", "by that rmw_fastrtps adds shared memory"
    assert once | on_this_machine(once) == once
