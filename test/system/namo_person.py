"""Somebody who sends a goal to the NAMO graph and keeps what is told of it, for tests over DDS."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import groupby
from typing import Any

import numpy as np
from nav_msgs.msg import Odometry
from pbrl_msgs.action import ReachGoal
from pbrl_msgs.msg import NamoStatus
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from visualization_msgs.msg import MarkerArray

from pbrl_bringup.processes import Programs
from pbrl_control.ros.conversions import seconds
from pbrl_control.ros.floor_conversions import odometry_from_msg

LATCHED = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)
SILENCE = 60.0  # [s] without a word from anybody
PATIENCE = 120.0  # [s] of simulated time: however slow the machine is
STOPPING, RESTING = 0.6, 0.4  # [s] of simulated time: until it has to rest, and for which that is looked at
AT_REST = 0.004  # [m] that odometry may wander meanwhile


class Person(Node):
    """Sends a goal, and keeps what is told of it."""

    def __init__(self, context: Context, programs: Programs) -> None:
        super().__init__("person", context=context, enable_rosout=False)
        self.told: list[NamoStatus] = []
        self.feedback: list[NamoStatus] = []
        self.way: list[tuple[float, np.ndarray]] = []
        self.drawn: set[str] = set()
        self._programs = programs
        self._spinner = SingleThreadedExecutor(context=context)
        self._spinner.add_node(self)
        self.client = ActionClient(self, ReachGoal, "/reach_goal")
        self.create_subscription(NamoStatus, "/namo/status", self.told.append, LATCHED)
        self.create_subscription(Odometry, "/odom", lambda message: self.way.append(odometry_from_msg(message)), 10)
        self.create_subscription(MarkerArray, "/markers", self._draw, 50)

    def _draw(self, message: MarkerArray) -> None:
        self.drawn |= {marker.ns for marker in message.markers}

    def states(self) -> list[str]:
        """States in their order, each stay once."""
        return [state for state, _ in groupby(status.state for status in self.told)]

    def story(self) -> list[str]:
        """What was told, each stay in a state once: with its last sentence, and when that was told."""
        stays = [list(stay) for _, stay in groupby(self.told, lambda status: status.state)]
        return [f"{seconds(stay[-1].header.stamp):.1f} s {stay[-1].state}: {stay[-1].sentence}" for stay in stays]

    def until(self, condition: Callable[[], Any], what: str) -> None:
        """Let messages come until a condition holds."""
        begin = self.way[-1][0] if self.way else 0.0
        heard, last = (len(self.told), len(self.way)), time.monotonic()
        while not condition():
            if (len(self.told), len(self.way)) != heard:
                heard, last = (len(self.told), len(self.way)), time.monotonic()
            late = self.way and self.way[-1][0] > begin + PATIENCE
            silent = time.monotonic() > last + SILENCE
            assert not (late or silent), f"{what}: {self.story()}"
            self._spinner.spin_once(timeout_sec=0.05)
            self._programs.check()

    def result(self, future: Any, what: str) -> Any:
        """Wait for an answer and return it."""
        self.until(future.done, what)
        return future.result()

    def rests(self, begin: float) -> None:
        """Let a little simulated time pass, and see that the robot rests soon after a time [s] and from then on."""
        stopped = begin + STOPPING

        def places() -> list[np.ndarray]:
            return [pose[:2] for when, pose in self.way if when > stopped]

        # A machine that is busy hears few poses in that time; then those of a longer one are looked at.
        self.until(lambda: self.way[-1][0] > stopped + RESTING and len(places()) > 5, "the clock stands still")
        assert np.ptp(places(), axis=0).max() < AT_REST

    def enters(self, state: str, since: int = 0) -> None:
        """Wait until a state is told of, among what is told from the `since`-th message on."""
        self.until(lambda: any(each.state == state for each in self.told[since:]), f"no {state}")

    def leave(self) -> None:
        """Leave the graph."""
        self._spinner.shutdown()
        self.client.destroy()
        self.destroy_node()
