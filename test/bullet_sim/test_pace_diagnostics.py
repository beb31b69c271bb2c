"""A simulator's diagnostics: the pace since the last time, and a warning where it is slower than it was asked to be."""

from __future__ import annotations

import time
from collections.abc import Iterator
from types import SimpleNamespace

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.context import Context
from rclpy.node import Node

from bullet_sim.ros.diagnostics import PaceDiagnostics


@pytest.fixture
def node(domain: int) -> Iterator[Node]:
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    made = Node("sim", context=context, enable_rosout=False)
    yield made
    made.destroy_node()
    rclpy.try_shutdown(context=context)


@pytest.mark.parametrize(
    ("rate", "simulated", "level"),
    [
        (1.0, 2.0, DiagnosticStatus.OK),
        (1.0, 1.0, DiagnosticStatus.WARN),
        (0.5, 1.0, DiagnosticStatus.OK),
        (0.0, 0.1, DiagnosticStatus.OK),  # as fast as possible: whatever that is
    ],
)
def test_the_pace_of_two_seconds(node: Node, rate: float, simulated: float, level: bytes) -> None:
    run = SimpleNamespace(time=10.0, commands=5)
    begin = time.monotonic()
    told = PaceDiagnostics(node, lambda: run.time, rate, lambda: run.commands)
    told.status(begin)
    run.time, run.commands = 10.0 + simulated, 205
    status = told.status(begin + 2.0)
    values = {each.key: each.value for each in status.values}
    assert (status.name, status.level) == ("sim", level)
    assert float(values["pace"]) == pytest.approx(simulated / 2.0)
    assert values["commands rate [Hz]"] == "100.0"
    assert (f"{rate:g} are asked for" in status.message) == (level == DiagnosticStatus.WARN)
