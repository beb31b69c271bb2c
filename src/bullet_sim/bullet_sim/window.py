"""Bullet's window as a mirror of a world that is simulated without one.

A client with a window takes each order in another thread, and a step of a robot in a furnished room gives dozens:
on two cores without a graphics card it ran at a twentieth of real time. Here the window only hears what is built
and, now and then, where everything is. A run with a window is thus the same run, bit for bit.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

from bullet_sim.errors import SimError
from bullet_sim.quiet import bullet, silenced

PERIOD = 0.04
"""[s] on the wall clock between two views."""

SHARE = 0.2
"""Share of the wall clock that showing may take; views are rarer where drawing is slow."""

BUILDERS = ("create", "load", "changeVisualShape", "remove")
"""Beginnings of the names of Bullet's functions that make what can be seen, or take it away."""


class Window:
    """A second client that shows the bodies of a first.

    Args:
        mode: how to connect; without a window in tests.

    Raises:
        SimError: there is no display, or no window opens.
    """

    def __init__(self, mode: int = bullet.GUI) -> None:
        if mode == bullet.GUI and sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
            # Bullet would end the whole process here.
            raise SimError("Bullet: expected a display for its window, DISPLAY is not set; run without the window")
        with silenced():
            self._connection = bullet.connect(mode)
        if self._connection < 0:
            raise SimError("Bullet: expected a window to open, got no connection; run without the window")
        self._call("resetSimulation")
        for panel in (bullet.COV_ENABLE_GUI, bullet.COV_ENABLE_SHADOWS):
            self._call("configureDebugVisualizer", panel, 0)
        self._poses: dict[int, Any] = {}
        self._joints: dict[int, list[int]] = {}
        self._due = 0.0

    def _call(self, name: str, *arguments: Any, **options: Any) -> Any:
        return getattr(bullet, name)(*arguments, physicsClientId=self._connection, **options)

    def built_too(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Give a builder function of the first client that builds here too; bodies get the same numbers."""

        def build(*arguments: Any, **options: Any) -> Any:
            made = function(*arguments, **options)
            self._call(name, *arguments, **options)
            return made

        return build

    def look_at(self, target: Sequence[float], distance: float, heading: float, pitch: float) -> None:
        """Aim the camera.

        Args:
            target: (3,) [m] what it looks at, in `world`.
            distance: from there [m].
            heading: direction [rad] in which it looks, seen from above.
            pitch: how far it looks up [rad].
        """
        yaw = math.degrees(heading) - 90.0
        self._call("resetDebugVisualizerCamera", distance, yaw, math.degrees(pitch), list(target))

    def follow(self, api: Any) -> None:
        """Show the bodies of the first client, whose functions are `api`, if it is time for a view."""
        began = time.monotonic()
        if began < self._due or not bullet.isConnected(self._connection):  # its user may have closed the window
            return
        self.show(api)
        self._due = began + max(PERIOD, (time.monotonic() - began) / SHARE)

    def show(self, api: Any) -> None:
        """Show the bodies of the first client as they are."""
        for body in map(api.getBodyUniqueId, range(api.getNumBodies())):
            if body not in self._joints:
                kinds = [api.getJointInfo(body, joint)[2] for joint in range(api.getNumJoints(body))]
                self._joints[body] = [joint for joint, kind in enumerate(kinds) if kind != bullet.JOINT_FIXED]
            joints = self._joints[body]
            angles = [state[0] for state in api.getJointStates(body, joints)] if joints else []
            pose = (*api.getBasePositionAndOrientation(body), angles)
            if self._poses.get(body) != pose:
                self._poses[body] = pose
                self._move(body, *pose)

    def _move(self, body: int, position: Any, quaternion: Any, angles: list[float]) -> None:
        self._call("resetBasePositionAndOrientation", body, position, quaternion)
        if angles:
            self._call("resetJointStatesMultiDof", body, self._joints[body], [[angle] for angle in angles])

    def close(self) -> None:
        """Close the window."""
        with silenced():
            if bullet.isConnected(self._connection):
                bullet.disconnect(self._connection)
