"""Rooms, tables and a kinematic base: shared by the tests of navigation and grasping."""

from __future__ import annotations

import math

import numpy as np
from shapely import Point

from pbrl_control.navigation import KRANG_STOWED, BasePath, FloorMap, MotionChecker, PathTracker, TrackCommand
from pbrl_control.navigation.tracker import TrackStatus
from pbrl_control.percept import BodyShape

TABLE = BodyShape(np.array([[-0.375, -0.75], [0.375, -0.75], [0.375, 0.75], [-0.375, 0.75]]), 0.7775)
ROOM = np.array([[-3.0, -3.0], [3.0, -3.0], [3.0, 3.0], [-3.0, 3.0]])
OVER = (TrackStatus.ARRIVED, TrackStatus.FAILED)


def box(x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def wrapped(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)


def table_room(pose: np.ndarray, room: np.ndarray = ROOM) -> FloorMap:
    return FloorMap.of_scene(room, {"table": TABLE}, {"table": pose})


def base_pose_off_the_table(floor: FloorMap, distance: float, rng: np.random.Generator) -> np.ndarray:
    """Draw a free base pose (3,) whose axle is `distance` [m] from the table's outline."""
    table, checker = floor.obstacles["table"], MotionChecker(floor, KRANG_STOWED, 0.0)
    while True:
        ring = table.buffer(distance).exterior
        x, y = ring.interpolate(rng.uniform(), normalized=True).coords[0]
        pose = np.array([x, y, rng.uniform(-math.pi, math.pi)])
        if not checker.pose_fault(pose):
            assert abs(table.distance(Point(x, y)) - distance) < 1e-2
            return pose


class Unicycle:
    """A base that does exactly what it is told, integrated along arcs.

    Attributes:
        pose: (3,) now.
        trace: of (time, pose, command).
    """

    def __init__(self, pose: np.ndarray, dt: float = 0.02) -> None:
        self.pose, self.dt, self.time = np.array(pose, dtype=float), dt, 0.0
        self.trace: list[tuple[float, np.ndarray, TrackCommand]] = []

    def move(self, command: TrackCommand) -> None:
        self.trace.append((self.time, self.pose.copy(), command))
        middle = self.pose[2] + command.omega * self.dt / 2.0
        self.pose += self.dt * np.array([command.v * math.cos(middle), command.v * math.sin(middle), command.omega])
        self.time += self.dt

    def follow(self, tracker: PathTracker, most: float = 120.0) -> TrackCommand:
        while True:
            command = tracker.step(self.time, self.pose)
            if command.status in OVER:
                return command
            assert self.time < most, "the tracker neither arrives nor gives up"
            self.move(command)

    def error(self, path: BasePath) -> tuple[float, float]:
        """Return distance [m] and heading error [rad] from the path's goal."""
        away = self.pose - path.goal
        return float(np.hypot(*away[:2])), abs(wrapped(away[2]))
