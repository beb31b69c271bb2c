"""Nodes that are given hostile messages: their own callbacks are called, as their executor would, without a network.

What escapes from a callback ends a node, so nothing may: not even an error of ours.
"""

# rclpy has no types of its own.
# mypy: disable-error-code="no-untyped-call,attr-defined"

from __future__ import annotations

import json
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
import rclpy
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.serialization import deserialize_message, serialize_message

from bullet_sim.messages import to_messages
from bullet_sim.scene import load_scene, with_tags
from krang_sim.session import KrangSession
from pbrl_bag.errors import BagError
from pbrl_bringup.errors import BringupError
from pbrl_bringup.fuzz.message_mutations import mutate_message
from pbrl_bringup.fuzz.push_seed import mismatches, models, push
from pbrl_bringup.graph import free_domain
from pbrl_bringup.view.live import LiveGraph
from pbrl_model.online.live import LiveRecording
from pbrl_model.ros.heard import Heard, Message
from pr2_cart_sim.scene import load_office
from pr2_cart_sim.session import Pr2Session
from tabletop_sim.scene import load_desk
from tabletop_sim.session import DeskSession

MOMENT = 0.3
"""Of a simulator, whose messages hostile ones are made from [s]."""
OWN_SERVICES = ("/describe_", "/get_", "/list_", "/set_", "/learn")
"""Services of rclpy itself, and one that takes minutes whatever it is asked."""

Sent = list[tuple[Any, Any]]
"""Subscriptions or services, and what they are given."""


def _node(package: str, module: str, name: str) -> Callable[[threading.Event], Any]:
    def make(stop: threading.Event) -> Any:
        kind = getattr(import_module(f"{package}.ros.{module}"), name)
        return kind(stop) if package.endswith("_sim") else kind()

    return make


NODES: Mapping[str, tuple[str, Callable[[threading.Event], Any]]] = {
    "body_controller_node": ("krang", _node("pbrl_control", "body_controller_node", "BodyControllerNode")),
    "push_node": ("krang", _node("pbrl_control", "push_node", "PushNode")),
    "namo_node": ("krang", _node("pbrl_namo", "namo_node", "NamoNode")),
    "tag_detector_node": ("krang", _node("pbrl_model", "tag_detector_node", "TagDetectorNode")),
    "costmap_node": ("pr2", _node("pbrl_planner", "costmap_node", "CostmapNode")),
    "lattice_planner_node": ("pr2", _node("pbrl_planner", "lattice_planner_node", "LatticePlannerNode")),
    "cart_controller_node": ("pr2", _node("pbrl_planner", "cart_controller_node", "CartControllerNode")),
    "cart_navigator_node": ("pr2", _node("pbrl_planner", "cart_navigator_node", "CartNavigatorNode")),
    "tabletop_node": ("tabletop", _node("pbrl_planner", "tabletop_node", "TabletopNode")),
    "krang sim_node": ("krang", _node("krang_sim", "sim_node", "SimNode")),
    "pr2 sim_node": ("pr2", _node("pr2_cart_sim", "sim_node", "SimNode")),
    "tabletop sim_node": ("tabletop", _node("tabletop_sim", "sim_node", "SimNode")),
}


@cache
def heard_of(robot: str) -> Mapping[str, Sequence[Any]]:
    """Return what a robot's simulator says in its first moment, by topic, with what learners say beside it."""
    found: dict[str, list[Any]] = {"/object_models": [models()], "/mismatches": [mismatches()]}
    if robot == "krang":
        scene = load_scene("locked_caster")
        sessions: list[Any] = [KrangSession(scene, seed=0), KrangSession(with_tags(scene, "rendered"), seed=0)]
    elif robot == "pr2":
        sessions = [Pr2Session(load_office("cart_room"), seed=0)]
    else:
        sessions = [DeskSession(load_desk("desk"), seed=0)]
    for session in sessions:
        while session.time < MOMENT:
            for observation in session.step():
                for topic, message in to_messages(observation):
                    found.setdefault(topic, []).append(message)
        session.close()
    return {topic: messages[:1] + messages[-3:] for topic, messages in found.items()}


class NodeSubject:
    """A node and the messages of the robot that it belongs to.

    Args:
        name: among `NODES`.
    """

    def __init__(self, name: str) -> None:
        robot, make = NODES[name]
        self._known = heard_of(robot)
        self._domain = free_domain()
        rclpy.init(domain_id=self._domain.__enter__())
        self._stop = threading.Event()
        self._node = make(self._stop)
        for logger in (self._node.get_name(), f"{self._node.get_name()}_listener"):
            set_logger_level(logger, LoggingSeverity.FATAL)
        for topic, messages in self._known.items():  # the node knows its robot before anything hostile comes
            for subscription in list(self._node.subscriptions):
                if subscription.topic_name == topic and isinstance(messages[-1], subscription.msg_type):
                    subscription.callback(messages[-1])

    def make(self, rng: np.random.Generator) -> Sent:
        """Draw one to four messages, and now and then a request."""
        sent = [self._message(rng) for _ in range(int(rng.integers(1, 5)))]
        services = [each for each in self._node.services if not any(word in each.srv_name for word in OWN_SERVICES)]
        if services and rng.random() < 0.1:
            service = services[rng.integers(len(services))]
            sent.append((service, mutate_message(service.srv_type.Request(), rng)))
        return sent

    def _message(self, rng: np.random.Generator) -> tuple[Any, Any]:
        subscriptions = [each for each in self._node.subscriptions if each.topic_name != "/parameter_events"]
        subscription = subscriptions[rng.integers(len(subscriptions))]
        kind = subscription.msg_type
        known = [each for each in self._known.get(subscription.topic_name, ()) if isinstance(each, kind)]
        message = known[rng.integers(len(known))] if known else kind()
        if rng.random() < 0.85:
            message = mutate_message(message, rng)
        return subscription, deserialize_message(serialize_message(message), kind)

    def read(self, sent: Sent) -> None:
        """Give it what was drawn, and let its timers tick."""
        try:
            for to, message in sent:
                if hasattr(to, "srv_type"):
                    to.callback(message, to.srv_type.Response())
                else:
                    to.callback(message)
            for timer in list(self._node.timers):
                timer.callback()
            session = getattr(self._node, "session", None)
            if session is not None:
                session.step()
        except BringupError:
            raise
        except Exception as error:
            if type(error).__module__.endswith(".errors"):
                raise RuntimeError(f"ends the node: {type(error).__name__}: {error}") from error
            raise

    def close(self) -> None:
        """End at once: threads of a planner would be waited for otherwise."""
        os._exit(0)


class ListenerSubject:
    """What learners and the viewer hear: raw bytes and messages of the topics of a recording."""

    def __init__(self) -> None:
        self._known = push()
        self._begin()

    def _begin(self) -> None:
        self._heard, self._live, self._page = Heard(10_000_000), LiveRecording(), LiveGraph("fuzz")
        self._heard.follow()

    def make(self, rng: np.random.Generator) -> list[tuple[str, Any, bytes]]:
        """Draw a stretch of the recording with some messages mutated, one in ten as bytes."""
        if rng.random() < 0.05:
            self._begin()
        start, sent = int(rng.integers(len(self._known))), []
        for topic, _, message, _ in self._known[start : start + 8]:
            draw = rng.random()
            mutated = mutate_message(message, rng) if draw < 0.5 else message
            try:
                data = bytearray(serialize_message(mutated))
            except RuntimeError:  # nobody could have sent that
                data = bytearray(serialize_message(message))
            if draw > 0.9:
                for _ in range(3):
                    data[rng.integers(4, len(data))] ^= 1 << int(rng.integers(8))
                data = data[: rng.integers(len(data)) + 1] if draw > 0.97 else data
            sent.append((topic, type(message), bytes(data)))
        return sent

    def read(self, sent: list[tuple[str, Any, bytes]]) -> None:
        """Hear it as the learners' listener, their growing recording, and the viewer do."""
        refused: BagError | None = None
        for topic, kind, data in sent:
            self._heard.add(Message(topic, kind, data))
        for each in self._heard.fresh():
            try:
                message = each.decoded()
                self._live.add(each.topic, message)
            except BagError as error:
                refused = error
                continue
            try:
                if self._page.wants(each.topic):
                    self._page.hear(each.topic, message)
            except BagError as error:
                refused = error
        for use in (self._live.recording, self._told):
            try:
                use()
            except BagError as error:
                refused = error
        self._live.forget(self._live.now - 3.0)
        if refused is not None:
            raise refused

    def _told(self) -> None:
        json.dumps([self._page.data(), self._page.detail(0.0, 5.0, 500)], allow_nan=False)
