"""What ends a trajectory early: unexpected force, stall, time-out, a tag that is lost (thesis 6.4). Time is given."""

from __future__ import annotations

import math
from collections.abc import Mapping

from pbrl_control.errors import ControlError
from pbrl_control.percept import Tag
from pbrl_control.trajectories.trajectory_plan import AbortLimits

Forces = Mapping[str, float]


class AbortMonitor:
    """Watches one trajectory; each check raises a ControlError that says why it has to end.

    Args:
        limits: what is too much.
        force: [N] at any grip that is too much.
        expected: largest force [N] that the model expects at any grip; None: there is no model.
        timeout: [s] from the first moment on.
    """

    def __init__(self, limits: AbortLimits, force: float, expected: float | None, timeout: float) -> None:
        self.force = force
        self._limits = limits
        self._expected = expected
        self._timeout = timeout
        self._over_since: float | None = None
        self._progress = (-math.inf, -math.inf)  # when, how far

    def check_time(self, elapsed: float, share: float) -> None:
        """Refuse to go on after the time-out: elapsed [s], and the share of the way that is done."""
        if elapsed > self._timeout:
            raise ControlError(
                f"time-out: expected the end within {self._timeout:.1f} s, got {100 * share:.0f} % of the way by then"
            )

    def check_tag(self, now: float, tag: Tag | None, since: float) -> None:
        """Refuse a tag that is not there, not finite, or of another time than now; `since` [s]: when it was started."""
        age = self._limits.tag_age
        if tag is None:
            if now - since > age:
                raise ControlError(f"lost tag: expected one of the object within {age:.1f} s, got none")
            return
        if not tag.finite():
            raise ControlError("tag of the object: expected finite numbers, got NaN or infinity")
        if now - tag.time > age:
            raise ControlError(f"lost tag: the object was last seen {now - tag.time:.1f} s ago; is its tag covered?")
        if tag.time - now > age:
            raise ControlError(f"tag of the object: expected the clock of now, got one {tag.time - now:.1f} s ahead")

    def check_force(self, now: float, forces: Forces) -> None:
        """Refuse forces [N], by gripper, that are above the limit for longer than the time allowed."""
        for side, force in forces.items():
            if not math.isfinite(force):
                raise ControlError(f"force at {side}: expected a finite number, got {force}")
        if not forces or max(forces.values()) <= self.force:
            self._over_since = None
            return
        if self._over_since is None:
            self._over_since = now
        if now - self._over_since >= self._limits.force_time:
            side = max(forces, key=lambda name: forces[name])
            raise ControlError(
                f"unexpected force at {side}: {forces[side]:.0f} N, expected {self._wish()}; learn the model again"
            )

    def check_progress(self, now: float, done: float, note: str) -> None:
        """Refuse to stand still: `done` [s] of the trajectory so far; `note` may say why that is."""
        when, how_far = self._progress
        if done - how_far >= self._limits.stall_progress:
            self._progress = (now, done)
        elif now - when > self._limits.stall_time:
            because = f"; {note}" if note else "; something unknown holds it, or the robot cannot follow"
            raise ControlError(f"stall: commanded for {now - when:.1f} s without progress{because}")

    def _wish(self) -> str:
        if self._expected is None:
            return f"at most {self.force:.0f} N (no model)"
        return f"{self._expected:.0f} N and at most {self.force:.0f} N"
