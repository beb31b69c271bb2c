"""The node over DDS: says nothing before a model is there, alarms while a table is pushed, diagnoses, ends cleanly."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from pbrl_msgs.msg import Mismatches, ObjectModels
from pbrl_msgs.srv import PushObject
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from std_srvs.srv import Trigger

from pbrl_bag import write_recording
from pbrl_bag.playback import load_bag
from pbrl_bag.roles import GRASPS_TOPIC, SCENE_TOPIC
from pbrl_bag.ros.conversions import message_class, profile_from_qos
from pbrl_bag.types import Recording
from pbrl_mismatch.online.diagnosing import Diagnosed
from pbrl_mismatch.online.found import Found
from pbrl_mismatch.online.monitor import MismatchMonitor
from pbrl_mismatch.online.options import MonitorOptions
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.ros import mismatch_node, watcher
from pbrl_mismatch.ros.conversions import mismatches_from_msg, seconds_of, stamp_of
from pbrl_model.posterior import Posterior
from pbrl_model.ros.conversions import models_to_msg
from pbrl_model.ros.heard import Heard, Message, recording_of

PATIENCE = 60.0  # [s]
DRAWS = 20.0 + 0.3 * np.random.default_rng(0).normal(size=(1, 100, 1))
PUSH = {
    "object": "table",
    "contact_point": [-0.6, 0.0],
    "direction": [1.0, 0.0],
    "speed": 0.1,
    "duration": 2.0,
    "expected_bits": 0.5,
}
MODEL = Posterior("table", "free", ("mass",), DRAWS)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class AtHand:
    """A worker that has its verdict ready, with a `push` that would tell more; it is fetched where `lets`."""

    def __init__(self) -> None:
        self.asked: list[tuple[Recording, str, Any]] = []
        self.lets = True
        self.push: dict[str, Any] | None = None
        self._ready: list[Diagnosed] = []

    def start(self, recording: Recording, name: str, options: Any) -> None:
        self.asked.append((recording, name, options))
        verdict = f"{name}: something is left out {len(self.asked)}"
        self._ready.append(Diagnosed(name, {"unknown": True}, verdict, (), self.push))

    def done(self) -> list[Diagnosed]:
        if not self.lets:
            return []
        ready, self._ready = self._ready, []
        return ready

    def forget(self) -> None:
        self._ready.clear()

    stop = forget


class Stream:
    """A watcher whose listener hears a bag, without a graph and without a thread.

    Attributes:
        told: everything that was found, at each change.
    """

    def __init__(self, bag: Path) -> None:
        loaded = load_bag(bag)
        kinds = {name: message_class(topic.type) for name, topic in loaded.topics.items()}
        self._messages = [Message(one.topic, kinds[one.topic], one.data) for one in loaded.messages]
        self._heard = Heard(10**9)
        self.follow, self.fresh = self._heard.follow, self._heard.fresh
        self.told: list[tuple[Found, ...]] = []
        self.watcher = watcher.Watcher(
            MismatchMonitor(MonitorOptions(gather=1.0)),
            self,  # type: ignore[arg-type]
            DiagnoseOptions(),
            lambda entries, _: self.told.append(entries),
            lambda _: None,
            0.02,
        )
        self.watcher.give({"table": MODEL})
        self.follow()

    def recording(self) -> Recording:
        return recording_of(self._heard.kept())

    def play(self, done: Callable[[], Any] = lambda: False) -> None:
        """Let the watcher hear the bag from its beginning, to its end or until something holds."""
        for k, message in enumerate(self._messages):
            self._heard.add(message)
            if k % 40 == 39:
                self.watcher.step()
                if done():
                    return
        self.watcher.step()


class Graph:
    """The node in a thread, and somebody beside it who publishes and listens."""

    def __init__(self, context: Context) -> None:
        override = [Parameter("period", Parameter.Type.DOUBLE, 0.02), Parameter("gather", Parameter.Type.DOUBLE, 1.0)]
        self.node = mismatch_node.MismatchNode(context, parameter_overrides=override)
        self.client = Node("client", context=context)
        self._spinner = SingleThreadedExecutor(context=context)
        self._spinner.add_node(self.node)
        self._mine = SingleThreadedExecutor(context=context)
        self._mine.add_node(self.client)
        self.heard: list[Mismatches] = []
        self.client.create_subscription(Mismatches, "/mismatches", self.heard.append, LATCHED)
        self.models = self.client.create_publisher(ObjectModels, "/object_models", LATCHED)
        self.next_experiment = self.client.create_client(Trigger, "/run_next_experiment")
        self._publishers: dict[str, Publisher] = {}
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            self._spinner.spin()

    def until(self, condition: Callable[[], Any]) -> None:
        """Let the client work until a condition holds."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, "did not happen"
            self._mine.spin_once(timeout_sec=0.005)

    def play(self, bag: Path, begin: float = -math.inf, end: float = math.inf) -> None:
        """Publish what a bag has from `begin` to `end` [s], as fast as it is heard."""
        loaded, heard = load_bag(bag), self.node.listener.count()
        for name, topic in loaded.topics.items():
            if name not in self._publishers:
                profile = profile_from_qos(topic.qos)
                self._publishers[name] = self.client.create_publisher(message_class(topic.type), name, profile)
        self.until(lambda: all(one.get_subscription_count() for one in self._publishers.values()))
        for k, message in enumerate(one for one in loaded.messages if begin <= 1e-9 * one.log_time < end):
            self._publishers[message.topic].publish(message.data)
            if k % 20 == 19:
                self.until(lambda expected=heard + k + 1: self.node.listener.count() >= expected)

    def go_on(self, bag: Path) -> None:
        """Let the streams of a bag go on after its end, each with its last message, 50 times a second."""
        loaded = load_bag(bag)
        streams = {
            one.topic: deserialize_message(one.data, message_class(loaded.topics[one.topic].type))
            for one in loaded.messages
            if one.topic not in (SCENE_TOPIC, GRASPS_TOPIC)
        }

        def tick() -> None:
            for topic, message in streams.items():
                message.header.stamp = stamp_of(seconds_of(message.header.stamp) + 0.02)
                self._publishers[topic].publish(message)

        self.client.create_timer(0.02, tick)

    def close(self) -> None:
        """End both nodes."""
        self._spinner.shutdown()
        self._thread.join()
        self.node.destroy_node()
        self.client.destroy_node()


@pytest.fixture
def at_hand(monkeypatch: pytest.MonkeyPatch) -> AtHand:
    worker = AtHand()
    monkeypatch.setattr(watcher, "DiagnosisWorker", lambda: worker)
    return worker


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch, at_hand: AtHand, domain: int) -> Iterator[Graph]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    graph = Graph(context)
    yield graph
    graph.close()
    rclpy.try_shutdown(context=context)


def test_an_alarm_comes_at_once_and_the_diagnosis_later(
    graph: Graph, at_hand: AtHand, concealed_recording: Callable[..., Recording], tmp_path: Path
) -> None:
    recording = concealed_recording("floor_slope", 1, seconds=9.0)
    graph.models.publish(models_to_msg([MODEL], Time()))
    graph.until(graph.models.get_subscription_count)
    graph.play(write_recording(recording, tmp_path / "bag"))
    graph.until(lambda: graph.heard and graph.heard[-1].mismatches and graph.heard[-1].mismatches[0].diagnosed)
    alarms = [message for message in graph.heard if message.mismatches and not message.mismatches[0].diagnosed]
    assert alarms and alarms[0].mismatches[0].model_class == "free"
    found = mismatches_from_msg(graph.heard[-1])["table"]
    assert 1.5 < found.alarm.time < 9.0 and found.alarm.p_value < 0.01
    assert found.verdict == "table: something is left out 1" and graph.heard[-1].mismatches[0].unknown
    ((given, name, options),) = at_hand.asked
    assert name == "table" and options.baseline == ("free",) and given.grasps[0].start == pytest.approx(1.5, abs=0.01)
    assert given.wrenches["left"].time[-1] >= found.alarm.time


def test_a_push_that_was_asked_for_is_diagnosed_though_the_streams_go_on(
    graph: Graph,
    at_hand: AtHand,
    concealed_recording: Callable[..., Recording],
    held_twice: Callable[..., Recording],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(watcher, "QUIET", 20.0)  # a machine that is busy is not a robot that is quiet
    monkeypatch.setattr(watcher, "LONGEST", math.inf)
    first, second = (concealed_recording("floor_slope", seed, seconds=length) for seed, length in ((1, 9.0), (2, 5.0)))
    bag = write_recording(held_twice(first, second, 12.0), tmp_path / "bag")
    at_hand.push = PUSH

    def pushed(_: PushObject.Request, response: PushObject.Response) -> PushObject.Response:
        response.success = True
        return response

    graph.client.create_service(PushObject, "/push", pushed)
    graph.models.publish(models_to_msg([MODEL], Time()))
    graph.until(graph.models.get_subscription_count)
    graph.play(bag, end=12.0)
    graph.until(lambda: graph.heard and graph.heard[-1].mismatches and graph.heard[-1].mismatches[0].diagnosed)
    graph.until(graph.next_experiment.service_is_ready)
    answer = graph.next_experiment.call_async(Trigger.Request())
    graph.until(answer.done)
    assert answer.result().success and "a new diagnosis of table follows" in answer.result().message
    graph.play(bag, begin=12.0)  # what is heard of the push comes later than that it is done
    graph.go_on(bag)
    graph.until(lambda: len(at_hand.asked) == 2)
    given = at_hand.asked[1][0]
    assert [grasp.end for grasp in given.grasps] == pytest.approx([10.5, 18.5], abs=0.05)
    assert given.wrenches["left"].time[-1] == pytest.approx(19.5, abs=0.1), "with what comes late"


def test_a_push_that_is_not_seen_to_end_is_diagnosed_after_a_while(
    at_hand: AtHand, concealed_recording: Callable[..., Recording], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(watcher, "QUIET", math.inf)
    monkeypatch.setattr(watcher, "LONGEST", math.inf)
    stream = Stream(write_recording(concealed_recording("floor_slope", 1, seconds=9.0), tmp_path / "bag"))
    stream.play(lambda: at_hand.asked)
    stream.watcher.diagnose_again("table", stream.watcher.now)
    stream.watcher.step()
    assert len(at_hand.asked) == 1, "it is still held"
    monkeypatch.setattr(watcher, "LONGEST", 0.0)
    stream.watcher.step()
    stream.watcher.step()
    assert len(at_hand.asked) == 2, "once"


def test_what_was_begun_or_asked_for_on_another_clock_is_not_told(
    at_hand: AtHand,
    concealed_recording: Callable[..., Recording],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(watcher, "QUIET", math.inf)
    stream = Stream(write_recording(concealed_recording("floor_slope", 1, seconds=9.0), tmp_path / "bag"))
    at_hand.lets = False
    stream.play()
    assert len(at_hand.asked) == 1 and stream.told[-1]
    stream.watcher.diagnose_again("table", stream.watcher.now)
    before = len(stream.told)
    stream.play(lambda: len(stream.told) > before and stream.told[-1])
    assert stream.told[before] == () and len(at_hand.asked) == 1
    at_hand.lets = True
    stream.watcher.step()
    assert stream.told[-1][0].diagnosed is None, "the verdict is of the other clock"
    stream.play(lambda: len(at_hand.asked) == 2)
    monkeypatch.setattr(watcher, "QUIET", -1.0)
    stream.watcher.step()
    assert len(at_hand.asked) == 2, "nobody asked on this clock"


@pytest.mark.parametrize("argument", ["false_alarm:=2.0", "keeps:=10.0"])
def test_errors_at_start_are_one_line_and_exit_code_two(argument: str, domain: int) -> None:
    command = [sys.executable, "-m", "pbrl_mismatch.ros.mismatch_node", "--ros-args", "-p", argument]
    alone = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    done = subprocess.run(command, env=os.environ | alone, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1 and done.stderr.startswith("mismatch_node: ")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_without_a_word(number: signal.Signals, domain: int) -> None:
    environment = os.environ | {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    command = [sys.executable, "-c", STARTED]
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None and process.stderr is not None
        assert process.stdout.readline().strip() == "spinning"
        process.send_signal(number)
        assert process.wait(60) == 0
        assert process.stderr.read() == ""


STARTED = """
from pbrl_bag.ros import running
from pbrl_mismatch.ros import mismatch_node
spin = running.spin_until
running.spin_until = lambda node, done: (print("spinning", flush=True), spin(node, done))
mismatch_node.main()
"""
