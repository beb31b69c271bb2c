"""A simulator that waits for controllers: who has spoken is not waited for any longer, whatever the links do."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest
import rclpy
from std_msgs.msg import Float64MultiArray

from bullet_sim.errors import SimError
from bullet_sim.faults import Faults
from bullet_sim.ros.paced import PacedSimulator

LATE = {"links": {"/commands": {"late": 0.1}}}


class Still:
    """A session in which nothing happens but what it is told."""

    time = 0.0

    def step(self) -> list[object]:
        return []

    def close(self) -> None: ...


class Simulator(PacedSimulator):
    """One whose controller answers as soon as it is waited for."""

    def __init__(self, faults: Faults) -> None:
        super().__init__("sim", threading.Event())
        self.session, self.obeyed, self.waits = Still(), list[float](), 0
        self.declare_pace()
        self.start(self.session, {}, faults, 0)
        self.listen(Float64MultiArray, "commands", self.obey)

    def obey(self, message: Float64MultiArray) -> None:
        if message.data[0] < 0.0:
            raise SimError("expected a speed above zero")
        self.obeyed.append(message.data[0])

    def hear(self, value: float) -> None:
        (callback,) = (each.callback for each in self.subscriptions if each.topic_name == "/commands")
        callback(Float64MultiArray(data=[value]))

    def _listen(self, patience: float) -> None:
        self.waits += 1
        self.hear(2.0)


@pytest.fixture
def context(domain: int) -> Iterator[None]:
    rclpy.init(domain_id=domain)
    yield
    rclpy.try_shutdown()


@pytest.mark.parametrize("faults", [{}, LATE], ids=["sound", "late"])
@pytest.mark.parametrize("first", [1.0, -1.0], ids=["obeyed", "refused"])
def test_a_controller_that_answers_is_waited_for_once(context: None, faults: dict[str, object], first: float) -> None:
    sim = Simulator(Faults.model_validate(faults))
    sim.hear(first)
    sim.session.time = 0.05
    sim._await_command()
    assert (sim.waits, sim._last_command) == (1, 0.05)
    sim.session.time = 0.06
    sim._await_command()
    assert sim.waits == 1, "it spoke a moment ago"
    sim.session.time = 1.0
    sim._carry()
    assert sim.obeyed == ([1.0] if first > 0.0 else []) + [2.0]
    assert sim._heard == 2, "each is counted once, when it comes"
    sim.destroy_node()
