"""Letting go of whatever is held: rest, open, back the grippers off. What is held is what the grippers say."""

from __future__ import annotations

from pbrl_control.kinematics import SIDES
from pbrl_control.percept import Percept
from pbrl_control.push import GripperAnswer, GripperRequest, Phase
from pbrl_control.types import PlanarTwist, gripper_frame
from pbrl_namo.executive.settings import ReleaseSettings
from pbrl_namo.executive.step import Step, rest, still_held
from pbrl_namo.executive.table import Event


class Release:
    """Opens every gripper that holds something.

    Args:
        settings: patience.
        sides: grippers that back off although they hold nothing by now: those of the grasp that was tried.
    """

    def __init__(self, settings: ReleaseSettings, sides: tuple[str, ...] = ()) -> None:
        self._settings = settings
        self._sides = set(sides)
        self._since: float | None = None
        self._asked: float | None = None
        self._opened: float | None = None
        self._refusal = ""

    def step(self, now: float, percept: Percept) -> Step:
        """See `Part.step`."""
        self._since = now if self._since is None else self._since
        if percept.grips:
            self._opened = None
            return self._open(now, percept)
        self._opened = now if self._opened is None else self._opened
        return self._back_off(now)

    def answer(self, answer: GripperAnswer) -> None:
        """See `Part.answer`."""
        if answer.action == "release" and not answer.success:
            self._refusal = f": {answer.side} says {' '.join(answer.message.split())!r}"

    def drop(self) -> None:
        """See `Part.drop`."""

    def _open(self, now: float, percept: Percept) -> Step:
        assert self._since is not None
        settings, held = self._settings, still_held(percept)
        self._sides |= percept.grips.keys()
        if now - self._since > settings.settle + settings.timeout:
            return Step(
                f"release: expected open grippers within {settings.timeout:.0f} s, got {held}{self._refusal}; "
                "open them by hand",
                Event.STUCK,
            )
        if now - self._since < settings.settle:
            return Step(f"at rest: {held}", None, Phase.RELEASE, rest(percept))
        if self._asked is not None and now - self._asked < settings.again:
            return Step(f"opening: {held}", None, Phase.RELEASE, rest(percept))
        self._asked = now
        requests = tuple(GripperRequest("release", side, grip.object) for side, grip in sorted(percept.grips.items()))
        return Step(f"opening: {held}", None, Phase.RELEASE, rest(percept), requests)

    def _back_off(self, now: float) -> Step:
        assert self._opened is not None
        settings = self._settings
        if not self._sides or now - self._opened >= settings.retreat / settings.speed:
            return Step("grippers are open", Event.RELEASED)
        back = PlanarTwist(vx=-settings.speed)
        frames = {gripper_frame(side): back for side in SIDES if side in self._sides}
        return Step("backing off", None, Phase.RETREAT, frames)
