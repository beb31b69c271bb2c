"""Kills a recorder in mid-run and looks at what it left: used by tests and by the bench of that name."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

import rclpy
from ament_index_python.packages import get_package_prefix
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import UInt64

from pbrl_bag.errors import BagError
from pbrl_bag.mcap_file import McapFile
from pbrl_bag.metadata import files_of_bag, read_metadata

TOPIC = "/pulse"
STARTUP_SECONDS = 60.0  # [s] a busy machine is given to start a node


@dataclass(frozen=True)
class CrashResult:
    """What a killed recorder left behind.

    Attributes:
        sent: counter of the last message published before the kill.
        recorded: counter of the last message recorded.
        missing: counters absent between the first and the last recorded.
        lost_seconds: from the last message recorded to the kill [s].
        finished: the last file has a footer (it should not).
        metadata_count: what metadata.yaml says; the files may hold more.
    """

    sent: int
    recorded: int
    missing: int
    lost_seconds: float
    finished: bool
    metadata_count: int


def executable(package: str, name: str) -> Path:
    """Return a node's executable as `ros2 run` finds it: below lib/ of the package's prefix."""
    return Path(get_package_prefix(package)) / "lib" / package / name


def crash_recorder(folder: Path, run_seconds: float, rate: float = 200.0) -> CrashResult:
    """Record a counter published at `rate`, kill the recorder with SIGKILL, and read the file.

    Args:
        folder: bag folder for the recorder to make.
        run_seconds: how long to publish after the recorder has subscribed [s].
        rate: messages per second [Hz].

    Raises:
        BagError: the recorder did not start, or the file it left cannot be read.
    """
    context = Context()
    rclpy.init(context=context)
    node = Node("pulse", context=context)
    command = [str(executable("pbrl_bag", "recorder_node")), "--ros-args", "-p", f"output:={folder}"]
    command += ["-p", f"topics:=['{TOPIC}']"]
    recorder = subprocess.Popen(command, env=os.environ.copy())
    try:
        sent = _pulse(node, context, recorder, run_seconds, rate)
        killed = time.time()
        recorder.send_signal(signal.SIGKILL)
        recorder.wait()
    finally:
        if recorder.poll() is None:
            recorder.kill()
            recorder.wait()
        node.destroy_node()
        rclpy.shutdown(context=context)
    return inspect(folder, sent, killed)


def inspect(folder: Path, sent: int, killed: float) -> CrashResult:
    """Read what is left of a recording of the counter.

    Args:
        folder: the bag.
        sent: counter of the last message published.
        killed: wall time of the kill [s].
    """
    files = [McapFile(path) for path in files_of_bag(folder)]
    messages = [message for file in files for message in file.messages() if message.topic == TOPIC]
    if not messages:
        raise BagError(f"{folder}: expected messages on {TOPIC} before the kill, got none")
    counters = [int.from_bytes(message.data[4:12], "little") for message in messages]
    return CrashResult(
        sent=sent,
        recorded=counters[-1],
        missing=counters[-1] - counters[0] + 1 - len(set(counters)),
        lost_seconds=killed - messages[-1].log_time / 1e9,
        finished=files[-1].finished,
        metadata_count=int(read_metadata(folder)["message_count"]),
    )


def _pulse(node: Node, context: Context, recorder: subprocess.Popen, run_seconds: float, rate: float) -> int:
    """Publish a counter once the recorder listens; return the last one sent."""
    publisher = node.create_publisher(UInt64, TOPIC, 1000)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    deadline = time.monotonic() + STARTUP_SECONDS
    while publisher.get_subscription_count() == 0:
        executor.spin_once(timeout_sec=0.02)
        if recorder.poll() is not None or time.monotonic() > deadline:
            raise BagError(f"recorder_node: expected it to subscribe to {TOPIC}, got exit code {recorder.poll()}")
    start, sent = time.monotonic(), 0
    while (elapsed := time.monotonic() - start) < run_seconds:
        while sent < elapsed * rate:
            sent += 1
            publisher.publish(UInt64(data=sent))
        time.sleep(0.5 / rate)
    return sent
