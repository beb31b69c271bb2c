"""A mismatch node in a graph, or its watch without one, and a diagnosis that is ready at once."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from pbrl_msgs.msg import Mismatches, ObjectModels
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from std_srvs.srv import Trigger

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
from pbrl_mismatch.ros.conversions import seconds_of, stamp_of
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
        self.follow, self.fresh, self.newest = self._heard.follow, self._heard.fresh, self._heard.newest
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

    def recording(self, since: float = -math.inf) -> Recording:
        return recording_of(self._heard.kept(), since)

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
    """The node in a thread, with more parameters where they are named; somebody beside it publishes and listens."""

    def __init__(self, context: Context, **more: float) -> None:
        chosen = {"period": 0.02, "gather": 1.0, **more}
        override = [Parameter(name, Parameter.Type.DOUBLE, value) for name, value in chosen.items()]
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

    def diagnosed(self, bag: Path, end: float = math.inf) -> None:
        """Give the node a model, play a bag until `end` [s] and wait for the diagnosis."""
        self.models.publish(models_to_msg([MODEL], Time()))
        self.until(self.models.get_subscription_count)
        self.play(bag, end=end)
        self.until(lambda: self.heard and self.heard[-1].mismatches and self.heard[-1].mismatches[0].diagnosed)

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
