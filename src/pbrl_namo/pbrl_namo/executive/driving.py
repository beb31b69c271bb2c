"""The last way: to the goal, along a planned path, with an eye on what moves into it."""

from __future__ import annotations

from pbrl_control.navigation import KRANG_STOWED, BasePath, MotionChecker, PathTracker, TrackStatus
from pbrl_control.percept import Percept
from pbrl_control.push import Phase
from pbrl_control.settings import BaseSettings
from pbrl_control.types import PlanarTwist
from pbrl_namo.executive.settings import ExecutiveSettings
from pbrl_namo.executive.step import BasePart, Step, still_held
from pbrl_namo.executive.table import Event
from pbrl_namo.executive.view import RoomView


class DriveToGoal(BasePart):
    """Follows one way.

    Args:
        way: to the goal.
        view: of robot and room.
        limits: of the base.
        settings: patience and tolerances.
    """

    def __init__(self, way: BasePath, view: RoomView, limits: BaseSettings, settings: ExecutiveSettings) -> None:
        self._view, self._settings = view, settings
        self._floor = view.around.floor()
        self._tracker = PathTracker(way, limits, settings.tracker, MotionChecker(self._floor, KRANG_STOWED))
        self._since: float | None = None

    def step(self, now: float, percept: Percept) -> Step:
        """See `Part.step`."""
        self._since = now if self._since is None else self._since
        held = still_held(percept)
        if held:
            return Step(held, Event.STILL_HELD)
        if now - self._since > self._settings.drive_timeout:
            return Step(
                f"drive: expected to arrive within {self._settings.drive_timeout:.0f} s, did not", Event.WAY_LOST
            )
        floor = self._view.around.floor()
        if floor is not self._floor:
            self._floor = floor
            self._tracker.update_map(MotionChecker(floor, KRANG_STOWED))
        here = self._view.where.pose(now)
        command = self._tracker.step(now, here)
        if command.status == TrackStatus.ARRIVED:
            return Step("at the goal", Event.ARRIVED)
        if command.status == TrackStatus.FAILED:
            if command.struck and here is not None:
                self._view.around.struck.add(floor, KRANG_STOWED, here, command.struck)
            return Step(f"drive: {self._view.where.fault(now) or command.reason}", Event.WAY_LOST)
        twist = PlanarTwist(vx=command.v, omega=command.omega)
        return Step(command.reason or "on the way to the goal", None, Phase.DRIVE, {"base": twist})
