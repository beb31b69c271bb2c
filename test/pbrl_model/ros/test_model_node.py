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
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TransformStamped, WrenchStamped
from nav_msgs.msg import Odometry
from pbrl_msgs.msg import ObjectModels
from pbrl_msgs.srv import LearnModel
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from pbrl_bag.types import Recording
from pbrl_model.arviz_bridge import save_posterior
from pbrl_model.errors import ModelError
from pbrl_model.fitting.fit import FitOptions
from pbrl_model.model_file import LearnedEffect, SavedModel, Shape, learned, save_model
from pbrl_model.online.memory import Learned
from pbrl_model.online.state import Stored, save
from pbrl_model.parameters import free_columns
from pbrl_model.posterior import Posterior
from pbrl_model.ros import model_node
from pbrl_model.ros.conversions import models_from_msg

PATIENCE = 20.0  # [s]
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
RECORDING = Recording(Path("heard"), {}, {}, {}, {}, ())


class Graph:
    """The node in a thread, and a client beside it."""

    def __init__(self, context: Context, **texts: list[str] | str):
        override = [Parameter("max_draws", Parameter.Type.INTEGER, 50)]
        override += [Parameter(name, value=value) for name, value in texts.items()]
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
def made(monkeypatch: pytest.MonkeyPatch, domain: int) -> Iterator[Callable[..., Graph]]:
    """Makes graphs, one after the other, of a node with parameters."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    graphs: list[Graph] = []

    def make(**texts: list[str] | str) -> Graph:
        for each in graphs:
            each.close()
        graphs[:] = [Graph(context, **texts)]
        return graphs[0]

    yield make
    for each in graphs:
        each.close()
    rclpy.try_shutdown(context=context)


@pytest.fixture
def graph(made: Callable[..., Graph]) -> Graph:
    return made()


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


def heard_by(graph: Graph) -> list[ObjectModels]:
    """What is latched, and what comes."""
    heard: list[ObjectModels] = []
    graph.client.create_subscription(ObjectModels, "/object_models", heard.append, LATCHED)
    graph.until(lambda: heard)
    return heard


def repaired(folder: Path, name: str, end: float = 9.5) -> str:
    """File of a model with a cord, which no model of ours has."""
    square = ((-0.4, -0.4), (0.4, -0.4), (0.4, 0.4), (-0.4, 0.4))
    cord = LearnedEffect(effect="tether", parameters={"tether_stiffness": learned("N/m", np.full(80, 60.0), 60.0)})
    own = {"mass": learned("kg", np.full(80, 21.0), 21.0), "mu_ground": learned("1", np.full(80, 0.03), 0.03)}
    shape = Shape(footprint=square, feet=square, com=(0.0, 0.0), inertia_per_mass=0.1)
    path = folder / f"model_{name}.json"
    save_model(SavedModel(object=name, shape=shape, parameters=own, effects=(cord,), clock=(2.0, end)), path)
    return str(path)


def test_what_files_say_is_latched_until_more_is_learned(
    made: Callable[..., Graph], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    save_posterior(posterior("desk"), tmp_path / "posterior_desk.nc")
    graph = made(models=[repaired(tmp_path, "table"), str(tmp_path / "posterior_desk.nc")])
    heard = heard_by(graph)
    models = models_from_msg(heard[0])
    assert set(models) == {"desk", "table"}
    assert models["table"].names == ("mass", "mu_ground") and "tether" in models["table"].notes[-1]
    assert np.array_equal(models["table"].flat, np.tile([21.0, 0.03], (50, 1)))
    assert heard[0].header.stamp == Time(sec=9, nanosec=500_000_000)
    monkeypatch.setattr(model_node, "fit_recording", fake_fit([]))
    monkeypatch.setattr(graph.node.listener, "recording", lambda: RECORDING)
    assert graph.learn(objects=["table"]).success
    graph.until(lambda: models_from_msg(heard[-1])["table"].model_class == "wheel")
    newer = models_from_msg(heard[-1])
    assert not newer["table"].notes, "what has been learned is told without what the file said"
    assert np.array_equal(newer["desk"].draws, models["desk"].draws)


def test_a_file_of_no_time_that_is_is_told_all_the_same(made: Callable[..., Graph], tmp_path: Path) -> None:
    (heard,) = heard_by(made(models=[repaired(tmp_path, "table", 1e15)]))
    assert heard.header.stamp.sec == 2**31 - 1


def test_what_the_node_learned_itself_goes_before_a_file(
    made: Callable[..., Graph], make_recording: Callable[..., Recording], tmp_path: Path
) -> None:
    geometry = make_recording(0, seconds=2.0).bodies["table"]
    (tmp_path / "state").mkdir()
    save(tmp_path / "state", Stored(Learned(geometry, True), posterior("table"), FitOptions()))
    graph = made(models=[repaired(tmp_path, "table"), repaired(tmp_path, "desk")], state=str(tmp_path / "state"))
    models = models_from_msg(heard_by(graph)[-1])
    assert models["table"].model_class == "wheel" and models["desk"].names == ("mass", "mu_ground")


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


@pytest.mark.parametrize("kind", [PoseStamped, PoseWithCovarianceStamped, Odometry, TransformStamped])
def test_a_model_is_drawn_where_its_object_was_seen_whatever_tells_of_it(graph: Graph, kind: type) -> None:
    graph.node._changed({"table": posterior("table")}, 1.0)
    message, quarter = kind(), np.sqrt(0.5)
    message.header.frame_id, message.header.stamp.sec = "world", 7
    if kind is TransformStamped:
        message.transform.translation.x, turn = 30.0, message.transform.rotation
    else:
        pose = message.pose if kind is PoseStamped else message.pose.pose
        pose.position.x, turn = 30.0, pose.orientation
    turn.z, turn.w = quarter, quarter
    tag = graph.client.create_publisher(kind, "/ar_tags/table/pose", 10)
    drawn: list[MarkerArray] = []
    graph.client.create_subscription(MarkerArray, "/object_models/markers", drawn.append, 10)
    graph.until(tag.get_subscription_count)
    tag.publish(message)
    graph.until(lambda: drawn)
    points = drawn[-1].markers[0]
    assert points.header.stamp.sec == 7
    assert 29.0 < np.mean([point.x for point in points.points]) < 30.0  # a quarter turn: +y of the table is -x


def test_what_is_no_pose_is_not_drawn(graph: Graph) -> None:
    graph.node._changed({"table": posterior("table")}, 1.0)
    tag = graph.client.create_publisher(TFMessage, "/ar_tags/table/pose", 10)
    graph.until(tag.get_subscription_count)
    tag.publish(TFMessage(transforms=[TransformStamped()]))
    graph.until(lambda: graph.node.listener.last("/ar_tags/table/pose") is not None)
    graph.node._draw()  # goes on
    assert graph.learn().message


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
    "argument",
    [
        "priors:=no/such/priors.yaml",
        "models:=[no/such/model_table.json]",
        "models:=no/list.json",
        "max_draws:=0",
        "max_draws:=many",
        "max_drows:=10",
    ],
)
def test_errors_at_start_are_one_line_and_exit_code_two(argument: str, domain: int) -> None:
    command = [sys.executable, "-m", "pbrl_model.ros.model_node", "--ros-args", "-p", argument]
    alone = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    done = subprocess.run(command, env=os.environ | alone, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1 and done.stderr.startswith("model_node: ")
