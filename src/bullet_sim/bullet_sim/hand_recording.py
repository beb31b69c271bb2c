"""What a hand's push left behind: streams as a recording has them, and the truth for whoever scores."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bullet_sim.errors import SimError
from bullet_sim.sensors import WristReading

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HandPath:
    """Velocities that are asked of a hand, linear between knots.

    Attributes:
        time: (n,) of the knots [s], from zero on.
        twist: (n, 3) speed [m/s] along two axes and turning [rad/s].
        axes: "world": along x and y of `world`; "hand": along the approach and to its left.
    """

    time: Array
    twist: Array
    axes: Literal["world", "hand"] = "world"

    def __post_init__(self) -> None:
        object.__setattr__(self, "time", np.asarray(self.time, dtype=float))
        object.__setattr__(self, "twist", np.asarray(self.twist, dtype=float))
        if self.time.ndim != 1 or len(self.time) < 2 or self.twist.shape != (len(self.time), 3):
            raise SimError(
                f"hand path: expected at least two knots with three velocities each, got times of shape "
                f"{self.time.shape} and velocities of shape {self.twist.shape}"
            )
        if not (np.isfinite(self.time).all() and np.isfinite(self.twist).all()):
            raise SimError("hand path: expected finite times and velocities, got some that are not")
        if self.time[0] != 0 or np.any(np.diff(self.time) <= 0):
            raise SimError(f"hand path: expected times that rise from zero, got {self.time[:4].tolist()}...")
        if self.axes not in ("world", "hand"):
            raise SimError(f"hand path: axes: expected 'world' or 'hand', got {self.axes!r}")

    @property
    def duration(self) -> float:
        """How long it takes [s]."""
        return float(self.time[-1])

    def at(self, time: float, yaw: float) -> tuple[float, float, float]:
        """Give what is asked at a time [s]: speeds [m/s] along `world` axes and turning [rad/s]; nothing at the end.

        Args:
            time: since the grasp [s].
            yaw: of the hand [rad].
        """
        if time >= self.duration:
            return 0.0, 0.0, 0.0
        number = int(np.searchsorted(self.time, time, side="right")) - 1
        share = (time - self.time[number]) / (self.time[number + 1] - self.time[number])
        vx, vy, spin = ((1 - share) * self.twist[number] + share * self.twist[number + 1]).tolist()
        if self.axes == "hand":
            cos, sin = float(np.cos(yaw)), float(np.sin(yaw))
            vx, vy = cos * vx - sin * vy, sin * vx + cos * vy
        return vx, vy, spin


@dataclass(frozen=True)
class Limits:
    """What a hand that watches itself does not go beyond.

    Attributes:
        speed: of the body that it holds [m/s].
        spin: of that body's turning [rad/s].
        slipped: way of edges in the hand, of all grasps [m].
        force: (3,) of the wrist sensor, its axes [N].
        torque: (3,) likewise [N m].
    """

    speed: float
    spin: float
    slipped: float
    force: Array
    torque: Array

    def passed(self, body: str, twist: Array, slipped: float, reading: WristReading) -> str:
        """Say which limit is passed, or nothing.

        Args:
            body: name of what is held.
            twist: (3,) its speed [m/s] and turning [rad/s].
            slipped: way of edges in the hand so far [m].
            reading: of the wrist sensor.
        """
        speed, spin = math.hypot(twist[0], twist[1]), abs(float(twist[2]))
        if speed > self.speed or spin > self.spin:
            return f"{body} swings, {speed:.2f} m/s and {spin:.2f} rad/s"
        if slipped > self.slipped:
            return f"{body} slips by {1000.0 * slipped:.0f} mm in the hand"
        loaded = np.any(np.abs(reading.force) > self.force) or np.any(np.abs(reading.torque) > self.torque)
        return "the wrist sensor is at its end" if loaded else ""


@dataclass(frozen=True)
class HandPush:
    """One grasp and what is done in it.

    Attributes:
        body: name of the body.
        contact: (x, y) [m] of its outline where the hand takes it, body's frame; the nearest place of the outline.
        path: of the hand.
    """

    body: str
    contact: tuple[float, float]
    path: HandPath


@dataclass(frozen=True)
class WrenchTrack:
    """Readings of a force-torque sensor, in its own axes: what gripper and world exert on it.

    Attributes:
        time: (n,) stamps, at which they also arrive [s].
        force: (n, 3) [N].
        torque: (n, 3) [N m].
    """

    time: Array
    force: Array
    torque: Array


@dataclass(frozen=True)
class TagTrack:
    """Readings of one tag, in `world`.

    Attributes:
        time: (n,) stamps [s].
        arrival: (n,) when they are heard [s].
        position: (n, 3) [m].
        quaternion: (n, 4) x y z w.
    """

    time: Array
    arrival: Array
    position: Array
    quaternion: Array


@dataclass(frozen=True)
class GraspChange:
    """From `time` [s] on the gripper holds `body` at `contact` (3,) [m] of its frame, or, with None, nothing."""

    time: float
    body: str | None
    contact: Array


@dataclass(frozen=True)
class BodyTrack:
    """Where a body really was, for scoring only.

    Attributes:
        time: (n,) [s].
        pose: (n, 3) x, y, theta of the tag frame in `world`.
        twist: (n, 3) velocity of the tag frame's origin [m/s] in `world` axes, and turning [rad/s].
    """

    time: Array
    pose: Array
    twist: Array


@dataclass(frozen=True)
class Activity:
    """When an effect acted and how hard, for scoring only.

    Attributes:
        effect: its name.
        target: what it is about.
        unit: of `strength`.
        time: (n,) [s].
        acting: (n,) whether it made a difference.
        strength: (n,) how hard it acted.
    """

    effect: str
    target: str
    unit: str
    time: Array
    acting: NDArray[np.bool_]
    strength: Array

    def intervals(self) -> Array:
        """Give when it acted, (k, 2) [s], each from the first sample that says so to the last."""
        edges = np.diff(np.concatenate([[0], self.acting.astype(int), [0]]))
        starts, ends = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0) - 1
        return np.stack([self.time[starts], self.time[ends]], -1)

    def share(self, start: float, end: float) -> float:
        """Give the share of the samples from `start` to `end` [s] in which it acted; NaN where there are none."""
        inside = (self.time >= start) & (self.time <= end)
        return float(self.acting[inside].mean()) if inside.any() else float("nan")


@dataclass(frozen=True)
class HandRecording:
    """A push by a hand.

    Attributes:
        side: name of the gripper; its tag is `<side>_gripper`.
        wrench: of its sensor.
        tags: of bodies and gripper.
        grasps: who held what.
        seconds: simulated time [s].
        status: "done", or a sentence on what went wrong.
        bodies: where known bodies really were, for scoring only.
        pushed: (n, 5) force (2) [N], torque [N m] on the body, and where (2) [m], all in `world`; at the times of
            `bodies`; for scoring only.
        activities: of what was concealed, by key as `tether.table_a`; for scoring only.
        slipped: way [m] the plates slid over the edges, all grasps together.
    """

    side: str
    wrench: WrenchTrack
    tags: Mapping[str, TagTrack]
    grasps: tuple[GraspChange, ...]
    seconds: float
    status: str
    bodies: Mapping[str, BodyTrack]
    pushed: Array
    activities: Mapping[str, Activity]
    slipped: float
