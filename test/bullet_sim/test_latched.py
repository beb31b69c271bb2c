"""Every message of a latched topic arrives, though sockets overflow and the next comes at once."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from pbrl_bringup.graph import free_domain, node_environment
from pbrl_bringup.middleware import PROFILES
from pbrl_bringup.paths import config_file

HOLDS = 40
SAYS = """
import sys, time
import rclpy
from rclpy.duration import Duration
from std_msgs.msg import String
from bullet_sim.ros import latched
if len(sys.argv) > 1:
    latched.PATIENCE = Duration(seconds=float(sys.argv[1]))
rclpy.init()
node = rclpy.create_node("says")
word = latched.LatchedPublisher(node, String, "/word")
streams = [node.create_publisher(String, f"stream_{number}", 100) for number in range(10)]
count = node.count_subscribers
while not all(count(topic) for topic in ("/word", *(stream.topic_name for stream in streams))):
    time.sleep(0.01)
print("ready", flush=True)
for line in sys.stdin:
    for _ in range(100):
        for stream in streams:
            stream.publish(String(data="x" * 200))
    for which in ("begun", "ended"):
        before = time.monotonic()
        word.publish(String(data=f"{which} {line.strip()}"))
        print(which, time.monotonic() - before, flush=True)
for _ in range(2):  # the second waits for the first
    word.publish(String(data="over"))
"""
FOREVER = "30.0"
"""Patience [s] with a listener that gets no core for a while: on a busy machine that is longer than 0.1 s."""
HEARS = """
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node("hears")
heard = []
qos = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
subscriptions = [node.create_subscription(String, "word", lambda message: heard.append(message.data), qos)]
for number in range(10):
    subscriptions.append(node.create_subscription(String, f"stream_{number}", lambda message: None, 1000))
while "over" not in heard:
    rclpy.spin_once(node)
print("\\n".join(heard))
"""


@pytest.fixture
def environment(tmp_path: Path) -> Iterator[dict[str, str]]:
    """Give one in which sockets hold a few messages, as those of a machine that has too much to do soon do."""
    text = config_file("middleware", "fast_dds", ".xml").read_text(encoding="utf-8")
    profile = tmp_path / "small.xml"
    profile.write_text(text.replace("<receiveBufferSize>4194304<", "<receiveBufferSize>65536<"), encoding="utf-8")
    assert "65536" in profile.read_text(encoding="utf-8")
    with free_domain() as domain:
        yield node_environment(domain) | {PROFILES: str(profile)}


def test_both_ends_of_each_hold_arrive_though_a_socket_overflows(environment: dict[str, str]) -> None:
    python = [sys.executable, "-c"]
    with (
        subprocess.Popen([*python, HEARS], env=environment, stdout=subprocess.PIPE, text=True) as hears,
        subprocess.Popen(
            [*python, SAYS, FOREVER], env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        ) as says,
    ):
        try:
            says.communicate("".join(f"{number}\n" for number in range(HOLDS)).encode(), timeout=60)
            heard = hears.communicate(timeout=60)[0].splitlines()
        finally:
            says.kill()
            hears.kill()
    assert heard == [f"{which} {number}" for number in range(HOLDS) for which in ("begun", "ended")] + ["over"]


def test_who_is_frozen_is_waited_for_once(environment: dict[str, str]) -> None:
    python = [sys.executable, "-c"]
    with (
        subprocess.Popen([*python, HEARS], env=environment) as hears,
        subprocess.Popen(
            [*python, SAYS], env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as says,
    ):
        try:
            assert says.stdout is not None
            assert says.stdin is not None
            assert says.stdout.readline() == "ready\n"
            hears.send_signal(signal.SIGSTOP)
            waited = []
            for number in range(3):
                says.stdin.write(f"{number}\n")
                says.stdin.flush()
                waited += [float(says.stdout.readline().split()[1]) for _ in range(2)]
        finally:
            hears.kill()
            says.kill()
    first, once, *others = waited
    assert first < once
    assert once >= 0.1
    assert sum(others) < 0.1 * len(others), "each was waited for"
