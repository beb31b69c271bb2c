"""A push is made, a mismatch named with several explanations; the next experiment is made, and the odds change."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
import yaml
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point, Vector3
from pbrl_msgs.msg import Mismatches, ObjectModels
from pbrl_msgs.srv import PushObject
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger

from pbrl_bringup.graph import Graph, free_domain, running_graph
from pbrl_mismatch.online.found import Found
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.ros.conversions import mismatches_from_msg
from pbrl_model.posterior import Posterior
from pbrl_model.ros.conversions import models_to_msg

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PATIENCE, ASKED_AGAIN = 120.0, 5.0  # [s]
GROUP = ("viscous_drag", "ground_friction", "floor_slope")
MASS = 20.0


class User:
    """Somebody at a terminal in the graph's domain."""

    def __init__(self, domain: int, check: Callable[[], None]) -> None:
        self._check = check
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = Node("user", context=self._context, enable_rosout=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.heard: list[Mismatches] = []
        self.node.create_subscription(Mismatches, "/mismatches", self.heard.append, LATCHED)
        self.ages: dict[str, str] = {}
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._hear_diagnostics, 10)
        self.models = self.node.create_publisher(ObjectModels, "/object_models", LATCHED)

    def _hear_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "mismatch":
                self.ages = {each.key: each.value for each in status.values}

    def has_heard(self, topic: str) -> bool:
        """Tell whether the watch has heard of a topic."""
        return self.ages.get(f"{topic} age [s]", "never heard") != "never heard"

    def until(self, condition: Callable[[], Any]) -> None:
        deadline = time.monotonic() + PATIENCE
        while not condition():
            self._check()
            assert time.monotonic() < deadline, "did not happen"
            self._executor.spin_once(timeout_sec=0.02)

    def call(self, kind: Any, service: str, request: Any) -> Any:
        client = self.node.create_client(kind, service)
        self.until(client.service_is_ready)
        future = client.call_async(request)
        self.until(future.done)
        return future.result()

    def refused(self, kind: Any, service: str, request: Any) -> Any:
        """Ask until a refusal comes: one that is given at once is lost where we are found too late."""
        client = self.node.create_client(kind, service)
        self.until(client.service_is_ready)
        answers, asked = [], -math.inf

        def answered() -> bool:
            nonlocal asked
            if time.monotonic() > asked + ASKED_AGAIN:
                asked = time.monotonic()
                answers.append(client.call_async(request))
            return any(each.done() for each in answers)

        self.until(answered)
        return next(each.result() for each in answers if each.done())

    def diagnosed(self) -> list[Found]:
        """Return what each message said of the table once there was a diagnosis."""
        entries = [mismatches_from_msg(message).get("table") for message in self.heard]
        return [entry for entry in entries if entry is not None and entry.diagnosed is not None]

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)


@pytest.fixture
def user(tmp_path: Path, nothing_left: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[User]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    table = {"kind": "plain_table", "size": [0.7, 1.2], "nominal_mass": MASS, "pose": [0.0, 0.0, 0.4]}
    outline = [[-3, -3], [3, -3], [3, 3], [-3, 3]]
    concealed = {"viscous_drag": {"table": {"damping": 25.0}}}
    scene = {"name": "next", "room": {"outline": outline}, "bodies": {"table": table}, "concealed": concealed}
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(scene))
    without = [name for name in DiagnoseOptions().effects if name not in GROUP]
    nodes = {
        "hand": {
            "package": "krang_sim",
            "executable": "hand_node",
            "parameters": {"scene": str(tmp_path / "scene.yaml"), "rate": 0.0, "seed": 1},
        },
        "mismatch": {
            "package": "pbrl_mismatch",
            "executable": "mismatch_node",
            "parameters": {"without": without, "gather": 60.0, "seed": 0},
        },
    }
    graph = Graph.model_validate({"description": "a hand and a watch", "nodes": nodes})
    with free_domain() as domain, running_graph(graph, tmp_path / "logs", domain) as programs:
        one = User(domain, programs.check)
        yield one
        one.close()


def test_the_next_experiment_is_run_and_the_odds_change(user: User) -> None:
    draws = MASS + 0.2 * np.random.default_rng(0).normal(size=(1, 100, 1))
    user.models.publish(models_to_msg([Posterior("table", "free", ("mass",), draws)], Time()))
    user.until(user.models.get_subscription_count)
    nothing_yet = user.refused(Trigger, "/run_next_experiment", Trigger.Request())
    assert not nothing_yet.success and "nothing is to be told apart" in nothing_yet.message
    streams = ("/wrist_ft/left", "/ar_tags/table/pose", "/ar_tags/left_gripper/pose", "/grasps", "/scene")
    user.until(lambda: all(user.node.count_subscribers(topic) for topic in streams))
    # A push as fast as possible is over in a moment: who is found late does not hear it.
    user.until(lambda: user.has_heard("/scene") and user.has_heard("/grasps"))

    nowhere = PushObject.Request(object="chair", direction=Vector3(x=1.0), speed=0.1, duration=2.0)
    refused = user.refused(PushObject, "/push", nowhere)
    assert not refused.success and "chair" in refused.message
    first = PushObject.Request(
        object="table", contact_point=Point(x=-0.35), direction=Vector3(x=1.0, y=0.4), speed=0.06, duration=4.0
    )
    assert user.call(PushObject, "/push", first).success
    user.until(user.diagnosed)
    before = user.diagnosed()[-1]
    odds = probabilities(before)
    assert odds["viscous_drag"] < 0.99 and sum(odds[name] for name in GROUP) > 0.99

    done = user.call(Trigger, "/run_next_experiment", Trigger.Request())
    assert done.success and '"object": "table"' in done.message and "expected_bits" in done.message
    user.until(lambda: user.diagnosed()[-1].diagnosed != before.diagnosed)
    after = user.diagnosed()[-1]
    assert [effect["effect"] for effect in after.report["effects"]] == ["viscous_drag"]
    assert probabilities(after)["viscous_drag"] > max(0.95, odds["viscous_drag"])
    assert after.alarm.time >= before.alarm.time


def probabilities(found: Found) -> dict[str, float]:
    """Return the probability of each effect's likeliest hypothesis: it may stand in a set of two as well."""
    odds: dict[str, float] = {}
    for each in (*found.report["effects"], *found.report["alternatives"]):
        odds[each["effect"]] = max(odds.get(each["effect"], 0.0), each["probability"])
    return odds
