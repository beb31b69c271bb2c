"""The node: learns when asked, publishes with samples, answers errors in one line, and hears while it fits."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import WrenchStamped
from pbrl_msgs.msg import ObjectModels
from pbrl_msgs.srv import LearnModel
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile

from pbrl_bag.types import Recording
from pbrl_model.errors import ModelError
from pbrl_model.parameters import free_columns
from pbrl_model.posterior import Posterior
from pbrl_model.ros import model_node
from pbrl_model.ros.conversions import models_from_msg

PATIENCE = 20.0  # [s]
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
RECORDING = Recording(Path("heard"), {}, {}, {}, {}, ())


class Graph:
    """The node in a thread, and a client beside it."""

    def __init__(self, context: Context):
        override = [Parameter("max_draws", Parameter.Type.INTEGER, 50)]
        self.node = model_node.ModelNode(context, parameter_overrides=override)
        self.client = Node("client", context=context)
        self._spinner = SingleThreadedExecutor(context=context)
        self._spinner.add_node(self.node)
        self._mine = SingleThreadedExecutor(context=context)
        self._mine.add_node(self.client)
        self._learn = self.client.create_client(LearnModel, "/learn")
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

    def ask(self, **fields: Any) -> Any:
        """Call the service; return the future."""
        self.until(self._learn.service_is_ready)
        return self._learn.call_async(LearnModel.Request(**fields))

    def learn(self, **fields: Any) -> LearnModel.Response:
        """Call the service and wait for the answer."""
        future = self.ask(**fields)
        self.until(future.done)
        return future.result()

    def close(self) -> None:
        """End both nodes."""
        self._spinner.shutdown()
        self._thread.join()
        self.node.destroy_node()
        self.client.destroy_node()


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch, domain: int) -> Iterator[Graph]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    graph = Graph(context)
    yield graph
    graph.close()
    rclpy.try_shutdown(context=context)


def posterior(name: str) -> Posterior:
    names = free_columns("wheel")
    return Posterior(name, "wheel", names, np.random.default_rng(0).uniform(0.1, 0.5, (2, 100, len(names))))


def fake_fit(seen: list[Any]) -> Callable[[Recording, Any], Any]:
    """A fit that remembers its options and has its answer ready."""

    def fit(recording: Recording, options: Any) -> Any:
        seen.append(options)
        found = {name: SimpleNamespace(posterior=posterior(name)) for name in options.objects or ("table",)}
        return SimpleNamespace(objects=found)

    return fit


def test_learned_models_are_answered_and_latched(graph: Graph, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Any] = []
    monkeypatch.setattr(model_node, "fit_recording", fake_fit(seen))
    monkeypatch.setattr(graph.node.listener, "recording", lambda: RECORDING)
    answer = graph.learn(objects=["desk"], seed=5)
    assert answer.success and [model.object for model in answer.models.models] == ["desk"]
    assert (seen[0].model_class, seen[0].seed, tuple(seen[0].objects)) == ("wheel+ground", 5, ("desk",))
    again = graph.learn(objects=["table"], seed=5)
    assert [model.object for model in again.models.models] == ["table"]
    heard: list[ObjectModels] = []
    graph.client.create_subscription(ObjectModels, "/object_models", heard.append, LATCHED)
    graph.until(lambda: heard)
    models = models_from_msg(heard[-1])
    assert set(models) == {"desk", "table"}
    assert all(model.draws.shape == (1, 50, 6) for model in models.values())
    assert heard[-1].header.stamp == Time()


def test_errors_are_the_answers_message_in_one_line(graph: Graph, monkeypatch: pytest.MonkeyPatch) -> None:
    nothing = graph.learn()
    assert not nothing.success and "got no message" in nothing.message and "\n" not in nothing.message
    missing = graph.learn(recording="no/such/bag")
    assert not missing.success and "no/such/bag" in missing.message and "\n" not in missing.message
    monkeypatch.setattr(graph.node.listener, "recording", lambda: RECORDING)
    wrong = graph.learn(model_class="weel")
    assert not wrong.success and "'weel'" in wrong.message

    def fails(recording: Recording, options: Any) -> Any:
        raise ModelError("table: expected\n motion")

    monkeypatch.setattr(model_node, "fit_recording", fails)
    assert graph.learn().message == "table: expected motion"

    def breaks(recording: Recording, options: Any) -> Any:
        raise ZeroDivisionError("of ours")

    monkeypatch.setattr(model_node, "fit_recording", breaks)
    assert graph.learn().message == "internal error: ZeroDivisionError: of ours"


def test_hears_while_it_fits(graph: Graph, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, enough = threading.Event(), threading.Event()

    def slow(recording: Recording, options: Any) -> Any:
        begun.set()
        assert enough.wait(PATIENCE)
        return fake_fit([])(recording, options)

    monkeypatch.setattr(model_node, "fit_recording", slow)
    monkeypatch.setattr(graph.node.listener, "recording", lambda: RECORDING)
    wrist = graph.client.create_publisher(WrenchStamped, "/wrist_ft/left", 10)
    graph.until(wrist.get_subscription_count)
    future = graph.ask()
    graph.until(begun.is_set)
    before = graph.node.listener.count()
    wrist.publish(WrenchStamped())
    graph.until(lambda: graph.node.listener.count() > before)
    assert not future.done()
    enough.set()
    graph.until(future.done)
    assert future.result().success


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_fit(graph: Graph, monkeypatch: pytest.MonkeyPatch, number: signal.Signals) -> None:
    monkeypatch.setattr(model_node, "fit_recording", lambda *_: os.kill(os.getpid(), number) or pytest.fail("went on"))
    monkeypatch.setattr(graph.node.listener, "recording", lambda: RECORDING)
    with pytest.raises(KeyboardInterrupt):
        graph.node._learn(LearnModel.Request(), LearnModel.Response())


@pytest.mark.parametrize(
    "argument", ["priors:=no/such/priors.yaml", "max_draws:=0", "max_draws:=many", "max_drows:=10"]
)
def test_errors_at_start_are_one_line_and_exit_code_two(argument: str, domain: int) -> None:
    command = [sys.executable, "-m", "pbrl_model.ros.model_node", "--ros-args", "-p", argument]
    alone = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    done = subprocess.run(command, env=os.environ | alone, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1 and done.stderr.startswith("model_node: ")
