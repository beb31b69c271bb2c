"""The node over DDS: says nothing before a model is there, alarms while a table is pushed, diagnoses, ends cleanly."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from pbrl_msgs.srv import PushObject
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger
from watched import PUSH, AtHand, Graph

from pbrl_bag import write_recording
from pbrl_bag.types import Recording
from pbrl_mismatch.ros import watcher
from pbrl_mismatch.ros.conversions import mismatches_from_msg


def test_an_alarm_comes_at_once_and_the_diagnosis_later(
    graph: Graph, at_hand: AtHand, concealed_recording: Callable[..., Recording], tmp_path: Path
) -> None:
    recording = concealed_recording("floor_slope", 1, seconds=9.0)
    graph.diagnosed(write_recording(recording, tmp_path / "bag"))
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
    graph.diagnosed(bag, end=12.0)
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


@pytest.fixture
def nobody(graph: Graph) -> Iterator[None]:
    """Somebody who offers /push and never answers."""
    node = Node("pusher", context=graph.client.context)
    node.create_service(PushObject, "/push", lambda _, response: response)
    yield
    node.destroy_node()


def asked(graph: Graph, at_hand: AtHand, bag: Path) -> Future:
    """Ask for the next experiment once a diagnosis has named one."""
    at_hand.push = PUSH
    graph.diagnosed(bag)
    graph.until(graph.next_experiment.service_is_ready)
    return graph.next_experiment.call_async(Trigger.Request())


@pytest.mark.usefixtures("nobody")
def test_the_node_goes_on_while_a_push_is_made(
    graph: Graph, at_hand: AtHand, concealed_recording: Callable[..., Recording], tmp_path: Path
) -> None:
    bag = write_recording(concealed_recording("floor_slope", 1, seconds=9.0), tmp_path / "bag")
    answer, told = asked(graph, at_hand, bag), []
    graph.client.create_subscription(DiagnosticArray, "/diagnostics", told.append, 10)
    graph.until(lambda: len(told) >= 4)
    assert not answer.done()


@pytest.mark.usefixtures("nobody")
@pytest.mark.parametrize("graph", [{"patience": 1.0}], indirect=True)
def test_a_push_that_does_not_end_is_given_up(
    graph: Graph, at_hand: AtHand, concealed_recording: Callable[..., Recording], tmp_path: Path
) -> None:
    bag = write_recording(concealed_recording("floor_slope", 1, seconds=9.0), tmp_path / "bag")
    answer = asked(graph, at_hand, bag)
    graph.until(answer.done)
    assert not answer.result().success and "table has not ended within 1 s" in answer.result().message
    again = graph.next_experiment.call_async(Trigger.Request())
    graph.until(again.done)
    assert again.result() == answer.result(), "who asks again is answered, too"


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
