"""What a simulator tells of itself on `/diagnostics`, once a second of the wall clock: its pace, who commands it."""

from __future__ import annotations

import time
from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

PERIOD = 1.0
"""Between two messages [s] of a steady clock."""
SLOW = 0.9
"""Of the pace that was asked for; below, a user should know."""


class PaceDiagnostics:
    """Tells how fast simulated time goes.

    Args:
        node: the simulator.
        simulated: returns the simulated time [s].
        rate: simulated seconds a second that were asked for; 0: as fast as possible.
        commands: returns how many commands have been heard.
    """

    def __init__(self, node: Node, simulated: Callable[[], float], rate: float, commands: Callable[[], int]) -> None:
        self._node, self._simulated, self._rate, self._commands = node, simulated, rate, commands
        self._last = (time.monotonic(), simulated(), commands())
        self._out = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        node.create_timer(PERIOD, self._tell, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def status(self, now: float) -> DiagnosticStatus:
        """Return the status at a time of the steady clock [s]: since it was asked last."""
        before, self._last = self._last, (now, self._simulated(), self._commands())
        spent = max(now - before[0], 1e-9)
        pace, commands = (self._last[1] - before[1]) / spent, (self._last[2] - before[2]) / spent
        slow = self._rate > 0.0 and pace < SLOW * self._rate
        words = f"{pace:.2f} simulated seconds a second" + (f", {self._rate:g} are asked for" if slow else "")
        values = {"simulated time [s]": f"{self._last[1]:.2f}", "pace": f"{pace:.3f}", "asked": f"{self._rate:g}"}
        values["commands rate [Hz]"] = f"{commands:.1f}"
        return DiagnosticStatus(
            level=DiagnosticStatus.WARN if slow else DiagnosticStatus.OK,
            name=self._node.get_fully_qualified_name().lstrip("/"),
            message=words,
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )

    def keep_up(self) -> None:
        """Tell, if it is time to: for a callback that keeps the node's executor, and with it the timer, waiting."""
        if time.monotonic() - self._last[0] >= PERIOD:
            self._tell()

    def _tell(self) -> None:
        message = DiagnosticArray(status=[self.status(time.monotonic())])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._out.publish(message)
