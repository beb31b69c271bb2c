"""Recorder and player as processes, found as `ros2 run` finds them, on a graph of their own."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String, UInt8MultiArray

from pbrl_bag import describe, read_recording
from pbrl_bag.mcap_file import McapFile
from pbrl_bag.metadata import read_metadata
from pbrl_bag.ros.conversions import message_class
from pbrl_bag.ros.crash_harness import crash_recorder, executable
from pbrl_bag.ros.player_node import PlayerNode

PATIENCE = 60.0  # [s] for things that take a fraction of a second on an idle machine
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
LOOSE = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)

pytestmark = pytest.mark.usefixtures("ros_domain")


class Graph:
    """One node of ours beside the process under test."""

    def __init__(self) -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node("test", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.processes: list[subprocess.Popen] = []

    def start(self, name: str, namespace: str = "", **parameters: object) -> subprocess.Popen:
        command = [str(executable("pbrl_bag", name)), "--ros-args"]
        if namespace:
            command += ["-r", f"__ns:={namespace}", "-r", f"/clock:={namespace}/clock"]
        for key, value in parameters.items():
            command += ["-p", f"{key}:={value}"]
        process = subprocess.Popen(command, env=os.environ.copy(), stderr=subprocess.PIPE, text=True)
        self.processes.append(process)
        return process

    def until(self, done: Callable[[], bool]) -> None:
        deadline = time.monotonic() + PATIENCE
        while not done():
            self.executor.spin_once(timeout_sec=0.02)
            assert time.monotonic() < deadline, "waited in vain"

    def close(self) -> None:
        for process in self.processes:
            if process.poll() is None:
                process.kill()
            process.communicate()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


@pytest.fixture
def graph() -> Iterator[Graph]:
    made = Graph()
    yield made
    made.close()


MOST = 3_000_000  # [bytes] of a file that the recorder may write; its middleware wants some, too


def test_a_recorder_whose_disk_is_full_says_so_in_a_line_and_keeps_what_it_has(
    graph: Graph, tmp_path: Path, little_room: Callable[[int], AbstractContextManager[None]]
) -> None:
    noise = np.random.default_rng(0).integers(0, 256, 100_000, dtype=np.uint8)  # does not pack
    with little_room(MOST):
        recorder = graph.start("recorder_node", output=str(tmp_path / "bag"), topics="[/noise]")
    publisher = graph.node.create_publisher(UInt8MultiArray, "/noise", 10)
    graph.until(lambda: publisher.get_subscription_count() > 0)

    def ended() -> bool:
        publisher.publish(UInt8MultiArray(data=noise))
        return recorder.poll() is not None

    graph.until(ended)
    said = [line for line in recorder.stderr.read().splitlines() if "cannot write" in line]
    assert recorder.returncode == 2
    assert len(said) == 1 and said[0].startswith("recorder_node: ") and "messages before it are kept" in said[0]
    file = McapFile(tmp_path / "bag" / "bag_0.mcap")
    messages = list(file.messages())
    assert f"the {len(messages)} messages" in said[0]
    assert len(messages) >= 5 and all(bytes(noise) in message.data for message in messages)
    assert read_metadata(tmp_path / "bag")["message_count"] <= len(messages)


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_recording_that_is_stopped_is_whole(graph: Graph, tmp_path: Path, how: signal.Signals) -> None:
    latched = graph.node.create_publisher(String, "/latched", LATCHED)
    latched.publish(String(data="said before anyone listened"))
    loose = graph.node.create_publisher(String, "/loose", LOOSE)
    out = graph.node.create_publisher(String, "/left_out", 10)
    graph.node.create_publisher(String, "/push/_action/feedback", LATCHED).publish(String(data="hidden"))
    recorder = graph.start("recorder_node", output=tmp_path / "bag", exclude="['/left_*', '/rosout']")
    graph.until(lambda: loose.get_subscription_count() > 0 and latched.get_subscription_count() > 0)
    late = graph.node.create_publisher(String, "/late", 100)
    graph.until(lambda: late.get_subscription_count() > 0)
    for i in range(100):
        late.publish(String(data=str(i)))
        out.publish(String(data=str(i)))
    recorded = tmp_path / "bag" / "bag_0.mcap"
    graph.until(lambda: {"/late", "/latched"} <= {m.topic for m in McapFile(recorded).messages()})
    recorder.send_signal(how)
    _, errors = recorder.communicate(timeout=PATIENCE)
    assert recorder.returncode == 0, errors
    assert "Traceback" not in errors
    info = describe(tmp_path / "bag")
    topics = {topic.name: topic for topic in info.topics}
    assert info.finished
    assert topics["/late"].count == 100
    assert topics["/latched"].count == 1
    assert topics["/latched"].qos[0].durability == "transient_local"
    assert not {"/left_out", "/push/_action/feedback"} & set(topics)
    assert "is not recorded" not in errors
    texts = [message.data for message in McapFile(recorded).messages() if message.topic == "/late"]
    assert [text[8:].rstrip(b"\0").decode() for text in texts] == [str(i) for i in range(100)]


@pytest.mark.parametrize("name", ["/arm/left", "/arm/_hidden"])
def test_a_recording_of_listed_topics_has_no_others(graph: Graph, tmp_path: Path, name: str) -> None:
    wanted = graph.node.create_publisher(String, name, 10)
    other = graph.node.create_publisher(String, "/other", 10)
    recorder = graph.start("recorder_node", output=tmp_path / "bag", topics="['/arm/*']")
    graph.until(lambda: wanted.get_subscription_count() > 0)
    wanted.publish(String(data="x"))
    other.publish(String(data="x"))
    recorded = tmp_path / "bag" / "bag_0.mcap"
    graph.until(lambda: describe(recorded).message_count > 0)
    recorder.send_signal(signal.SIGINT)
    recorder.communicate(timeout=PATIENCE)
    assert [topic.name for topic in describe(tmp_path / "bag").topics] == [name]


def test_a_publisher_that_offers_less_is_heard_all_the_same(graph: Graph, tmp_path: Path) -> None:
    """The first publisher is reliable; a best-effort one comes later, which a reliable request would keep out."""
    first = graph.node.create_publisher(String, "/said", 10)
    recorder = graph.start("recorder_node", output=tmp_path / "bag", topics="['/said']")
    graph.until(lambda: first.get_subscription_count() > 0)
    second = graph.node.create_publisher(String, "/said", LOOSE)
    graph.until(lambda: second.get_subscription_count() > 0)
    second.publish(String(data="softly"))
    graph.until(lambda: describe(tmp_path / "bag").message_count > 0)
    recorder.send_signal(signal.SIGINT)
    recorder.communicate(timeout=PATIENCE)
    assert describe(tmp_path / "bag").finished


def test_what_comes_before_the_first_word_of_the_clock_is_not_of_the_year_1970(graph: Graph, tmp_path: Path) -> None:
    latched = graph.node.create_publisher(String, "/said", LATCHED)
    latched.publish(String(data="before the simulator ran"))
    time_source = graph.node.create_publisher(Clock, "/clock", 10)
    recorder = graph.start("recorder_node", output=tmp_path / "bag", topics="['/said']", use_sim_time=True)
    told: list[str] = []
    graph.node.create_subscription(
        DiagnosticArray, "/diagnostics", lambda heard: told.extend(one.message for one in heard.status), 10
    )
    graph.until(lambda: latched.get_subscription_count() > 0 and any("waits for /clock" in word for word in told))
    recorded = tmp_path / "bag" / "bag_0.mcap"
    assert describe(recorded).message_count == 0

    def is_written() -> bool:
        time_source.publish(Clock(clock=Time(sec=5)))
        return describe(recorded).message_count > 0

    graph.until(is_written)
    recorder.send_signal(signal.SIGINT)
    recorder.communicate(timeout=PATIENCE)
    assert [message.log_time for message in McapFile(recorded).messages()] == [5_000_000_000]


@pytest.mark.parametrize("run_seconds", [0.6, 0.9, 1.3])
def test_a_recorder_that_is_killed_loses_less_than_a_second(tmp_path: Path, run_seconds: float) -> None:
    result = crash_recorder(tmp_path / "bag", run_seconds)
    assert not result.finished
    assert result.missing == 0
    assert result.lost_seconds <= 1.0
    assert result.metadata_count <= result.recorded <= result.sent


@pytest.mark.parametrize(
    ("name", "parameters", "words"),
    [
        ("recorder_node", {"output": "."}, "expected a new folder"),
        ("player_node", {}, "bag: expected a bag folder"),
        ("player_node", {"bag": "nothing_here"}, "nothing_here: expected a bag folder"),
        ("player_node", {"bag": "x", "rate": "fast"}, "rate: expected float"),
        ("player_node", {"bag": "x", "rate": -1}, "rate: expected 0.001 to 1000"),
        ("player_node", {"bag": "x", "rats": 2.0}, "unknown parameter 'rats': did you mean 'rate'"),
        ("recorder_node", {"topics": "/a"}, "topics: expected a list of texts"),
    ],
)
def test_a_wrong_start_is_one_line_and_exit_code_2(graph: Graph, name: str, parameters: dict, words: str) -> None:
    process = graph.start(name, **parameters)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2
    (line,) = errors.strip().splitlines()
    assert line.startswith(f"{name}: ")
    assert words in line


@pytest.mark.parametrize("name", ["recorder_node", "player_node"])
def test_arguments_that_ros_cannot_read_are_no_traceback(graph: Graph, name: str) -> None:
    process = subprocess.Popen(
        [str(executable("pbrl_bag", name)), "--ros-args", "-p", "rate"], stderr=subprocess.PIPE, text=True
    )
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2
    assert "Traceback" not in errors
    assert errors.splitlines()[-1].startswith(f"{name}: ")


def test_what_is_played_is_byte_for_byte_what_was_recorded(graph: Graph, push_bag: Path) -> None:
    stored: dict[str, list[bytes]] = {}
    types = {}
    for message in McapFile(push_bag / "push_0.mcap").messages():
        stored.setdefault(message.topic, []).append(message.data)
        types[message.topic] = message.type
    heard: dict[str, list[bytes]] = {topic: [] for topic in [*stored, "/clock"]}
    for topic in stored:
        durability = DurabilityPolicy.TRANSIENT_LOCAL if topic in ("/scene", "/grasps") else DurabilityPolicy.VOLATILE
        graph.node.create_subscription(
            message_class(types[topic]), topic, heard[topic].append, QoSProfile(depth=1000, durability=durability),
            raw=True,
        )  # fmt: skip
    graph.node.create_subscription(message_class("rosgraph_msgs/msg/Clock"), "/clock", heard["/clock"].append, 10)
    player = graph.start("player_node", bag=push_bag, rate=4, wait_for=f"[{','.join(stored)}]")
    graph.until(lambda: player.poll() is not None)
    graph.until(lambda: all(len(heard[topic]) >= len(stored[topic]) for topic in stored))
    assert player.returncode == 0
    for topic, messages in stored.items():
        assert [bytes(data) for data in heard[topic]] == messages, topic
    ticks = [message.clock.sec + message.clock.nanosec / 1e9 for message in heard["/clock"]]
    assert ticks == sorted(ticks)
    assert ticks[0] >= 0.0
    assert ticks[-1] <= 3.98


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_player_that_is_stopped_ends_without_a_word_of_python(
    graph: Graph, push_bag: Path, how: signal.Signals
) -> None:
    heard: list = []
    graph.node.create_subscription(message_class("rosgraph_msgs/msg/Clock"), "/clock", heard.append, 10)
    player = graph.start("player_node", bag=push_bag, rate=0.5, loop=True)
    graph.until(lambda: len(heard) > 3)
    player.send_signal(how)
    _, errors = player.communicate(timeout=PATIENCE)
    assert player.returncode == 0
    assert "Traceback" not in errors


@pytest.mark.parametrize(("of", "now"), [("", ""), ("/a", "/fleet/b")], ids=["root", "another namespace"])
def test_what_is_played_and_recorded_again_reads_the_same(
    graph: Graph, push_bag: Path, tmp_path: Path, kit: SimpleNamespace, of: str, now: str
) -> None:
    bag = kit.write(tmp_path / "of", [(of + topic, *rest) for topic, *rest in kit.pushing()])
    recorder = graph.start("recorder_node", now, output=tmp_path / "again", exclude="['/clock', '/rosout']")
    awaited = [f"{of}{topic}" for topic in ("/wrist_ft/left", "/ar_tags/table/pose", "/grasps")]
    player = graph.start("player_node", now, bag=bag, rate="8.0", wait_for=str(awaited))
    graph.until(lambda: player.poll() is not None)
    recorded, topic = tmp_path / "again" / "again_0.mcap", f"{now}/wrist_ft/left"
    graph.until(lambda: len([m for m in McapFile(recorded).messages() if m.topic == topic]) >= 200)
    recorder.send_signal(signal.SIGINT)
    recorder.communicate(timeout=PATIENCE)
    names = {topic.name for topic in describe(tmp_path / "again").topics}
    assert f"{now}/clock" not in names, "patterns are of names as in the root"
    assert all(name.startswith(f"{now}/") for name in names)
    first, again = read_recording(push_bag), read_recording(tmp_path / "again")
    assert repr(again.grasps) == repr(first.grasps)
    assert repr(again.wrenches) == repr(first.wrenches)
    assert repr(again.object_poses) == repr(first.object_poses)


@pytest.mark.parametrize("clock", ["/clock", "/ours/clock"])
def test_a_clock_that_was_recorded_is_the_only_one_that_is_played(
    graph: Graph, tmp_path: Path, kit: SimpleNamespace, clock: str
) -> None:
    messages = [("/ours" + topic, *rest) for topic, *rest in kit.pushing()]
    bag = kit.write(tmp_path / "of", [*messages, (clock, "rosgraph_msgs/msg/Clock", Clock(), 0)])
    override = [Parameter("bag", Parameter.Type.STRING, str(bag))]
    player = PlayerNode(context=graph.context, namespace="/again", parameter_overrides=override)
    assert [out.topic_name for out in player.publishers if "clock" in out.topic_name] == ["/clock"]
    player.destroy_node()
