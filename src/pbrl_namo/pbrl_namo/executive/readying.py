"""Getting ready to drive: grippers out of furniture, arms up, the waist where the robot's outline is known."""

from __future__ import annotations

import numpy as np

from pbrl_control.errors import ControlError
from pbrl_control.kinematics import ARM_JOINTS, SIDES
from pbrl_control.navigation import KRANG_STOWED, MotionChecker
from pbrl_control.percept import Percept
from pbrl_control.push import Phase
from pbrl_control.settings import ControllerSettings
from pbrl_control.types import PlanarTwist
from pbrl_namo.executive.settings import ExecutiveSettings
from pbrl_namo.executive.step import STILL, BasePart, Step, still_held
from pbrl_namo.executive.table import Event
from pbrl_namo.executive.view import RoomView

NEAR = 0.02  # [m] from furniture, seen from above, at which a gripper is among it
MOST = 12  # times that the base backs off
SHARES = (1.0, 2.0 / 3.0, 1.0 / 3.0)  # of the wanted way back that will do where there is no more room
ARMS = "arms"  # commanded to rest: arms without a task go to their stowed posture


class GetReady(BasePart):
    """Backs off until grippers are clear of furniture, then stows both arms.

    Args:
        view: of robot and room.
        controller: where arms are stowed.
        settings: patience and tolerances, those of a fetch.
    """

    def __init__(self, view: RoomView, controller: ControllerSettings, settings: ExecutiveSettings) -> None:
        self._view, self._settings = view, settings.fetch
        self._stowed = np.array(controller.stowed)
        self._backing: tuple[float, float] | None = None  # until when [s], how fast [m/s]
        self._backed_off = 0
        self._stowing: float | None = None

    def step(self, now: float, percept: Percept) -> Step:
        """See `Part.step`."""
        held = still_held(percept)
        if held:
            return Step(held, Event.STILL_HELD)
        if self._backing is not None:
            return self._back_off(now)
        blocked = self._body_fault()
        if blocked:
            return Step(blocked, Event.BLOCKED)
        if self._view.where.pose(now) is None:
            raise ControlError(f"get ready: {self._view.where.fault(now)}; is its source running?")
        if self._stowing is None and self._low_grippers(now):
            self._backed_off += 1
            way, blocked = self._room_behind(now)
            if blocked:
                return Step(blocked, Event.BLOCKED)
            self._backing = (now + way / self._settings.back_off_speed, self._settings.back_off_speed)
            return self._back_off(now)
        return self._stow(now)

    def _back_off(self, now: float) -> Step:
        assert self._backing is not None
        until, speed = self._backing
        if now >= until:
            self._backing = None
            return Step("backed off", None, Phase.RETREAT, {"base": STILL})
        return Step("backing off: grippers are among furniture", None, Phase.RETREAT, {"base": PlanarTwist(vx=-speed)})

    def _stow(self, now: float) -> Step:
        joint, off = self._unstowed()
        most = 0.5 * self._settings.stow_tolerance if self._stowing is not None else self._settings.stow_tolerance
        if off <= most:
            return Step("arms are stowed", Event.READY)
        self._stowing = now if self._stowing is None else self._stowing
        if now - self._stowing > self._settings.stow_timeout:
            return Step(
                f"stow: expected the arms within {self._settings.stow_tolerance} rad of their stowed posture in "
                f"{self._settings.stow_timeout:.0f} s, got {joint} {off:.2f} rad off; is it blocked?",
                Event.BLOCKED,
            )
        return Step(f"stowing: {joint} has {off:.2f} rad to go", None, Phase.STOW, {ARMS: STILL})

    def _unstowed(self) -> tuple[str, float]:
        """Return the joint that is furthest from where it is stowed, and by how much [rad]."""
        posture = self._view.where.posture()
        if posture is None:
            raise ControlError("get ready: expected joint positions, got none; is the robot on?")
        signs = zip(SIDES, (1.0, -1.0), strict=True)
        off = {side: np.abs(posture.arm(side) - sign * self._stowed) for side, sign in signs}
        side = max(SIDES, key=lambda each: float(off[each].max()))
        return ARM_JOINTS[side][int(off[side].argmax())], float(off[side].max())

    def _body_fault(self) -> str:
        """Return which of waist and torso stands where the robot's outline is not known; empty where none does."""
        posture, settings = self._view.where.posture(), self._settings
        if posture is None:
            return ""
        for joint, wanted, angle in (
            ("waist", settings.waist, posture.waist),
            ("torso", settings.torso, posture.torso),
        ):
            if abs(angle - wanted) > settings.body_tolerance:
                return (
                    f"{joint}: expected within {settings.body_tolerance} rad of {wanted}, where the room that the "
                    f"robot takes is known, got {angle:.3f}; move it there first"
                )
        return ""

    def _low_grippers(self, now: float) -> list[str]:
        """Return which grippers are over or in something that they would hit as they are stowed."""
        around, headroom = self._view.around, self._settings.headroom
        return [
            side
            for side, tip in self._view.where.tips(now).items()
            if any(tip[2] < around.height(name) + headroom for name in around.beside(tip[:2], NEAR))
        ]

    def _room_behind(self, now: float) -> tuple[float, str]:
        """Return how far the base may back off [m], or why it must not."""
        settings, pose = self._settings, self._view.where.pose(now)
        if self._backed_off > MOST or pose is None:
            return 0.0, (
                f"back off: expected grippers clear of furniture after {MOST} times {settings.back_off} m, they are "
                "not; move the arms by hand"
            )
        ahead = np.array([np.cos(pose[2]), np.sin(pose[2])])
        checker = MotionChecker(self._view.around.floor(), KRANG_STOWED, 0.0)
        fault = ""
        for share in SHARES:
            way = share * settings.back_off
            fault = checker.drive_fault(pose[:2], pose[:2] - way * ahead, float(pose[2]))
            if not fault or checker.pose_fault(pose):  # where it already touches, backing off is no worse
                return way, ""
        return 0.0, (
            f"back off: expected {SHARES[-1] * settings.back_off:.2f} m of free floor behind the robot to draw its "
            f"grippers out, got {fault}; make room"
        )
