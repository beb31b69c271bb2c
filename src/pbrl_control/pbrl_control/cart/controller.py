"""The local controller (thesis 4.5.5): a plan in, 20 times a second what base and cart are to do. Pure; time is given.

A goal moves along the plan, and base and cart follow it. The goal goes slower where something is near, where the robot
lags, and where the laser is late; it stops before what is in the way. It never goes round: that is the planner's.
"""

from __future__ import annotations

import math

import numpy as np

from pbrl_control.cart.arms import arm_rates, hand_twists
from pbrl_control.cart.body import CartBody
from pbrl_control.cart.guard import SHARES, Ahead, Guard, Verdict, check_costs
from pbrl_control.cart.percept import CartCommand, CartPercept, Cause, DriveStatus
from pbrl_control.cart.plan import CartPlan
from pbrl_control.cart.settings import CartSettings
from pbrl_control.cart.tracking import REMEMBERED, CommandHistory, RateLimits, feedback, room_beside, to_base, to_world
from pbrl_control.cart.watch import grip_fault, stale_fault
from pbrl_control.errors import ControlError
from pbrl_control.planar import Array, rotation, wrap

LONGEST_PERIOD = 0.1  # [s] that a command is reckoned to have lasted at most
SHORTEST_PERIOD = 1e-3
COMFORT = 0.5  # of the braking limits, with which it stops before what it sees in time
QUICKEST = 4.0  # [1/s] at which the goal's pace grows at most
CREEPING = 0.05  # pace below which there is no progress
ROUNDING = 1e-6  # of a pace
USUAL_AGE = 0.02  # [s] of poses and joints at 50 Hz: a link is lost when the next would have come
STILL = 0.02  # [m/s, rad/s] standing
WINDOW = 0.5  # [s] of the plan about the goal in which it is looked for after a stop, and where a plan is joined


class CartController:
    """Drives one plan; make a new one for a new plan.

    Args:
        plan: to follow.
        body: outlines of robot and cart.
        settings: limits, gains, margins, patience.
        last: (4,) what is commanded now, where a plan replaces another on the way; None: the robot stands.

    Raises:
        ControlError: `last` is not what it should be.
    """

    def __init__(
        self, plan: CartPlan, body: CartBody, settings: CartSettings | None = None, last: Array | None = None
    ) -> None:
        self.settings = settings or CartSettings()
        self._plan, self._body = plan, body
        self._guard = Guard(body, self.settings)
        self._history = CommandHistory(self.settings.delay)
        self._last = np.zeros(4) if last is None else np.array(last, dtype=float)
        if self._last.shape != (4,) or not np.isfinite(self._last).all():
            raise ControlError(f"controller: expected the last command as 4 finite numbers, got {last}")
        self._limits = RateLimits(self.settings.limits)
        self._extra = np.zeros(4)
        self._joins = bool(np.abs(self._last).max() > STILL)
        self._time, self._pace, self._arms_share = 0.0, 1.0 if self._joins else 0.0, 1.0
        self._standing = False
        self._now: float | None = None
        self._trouble: float | None = None
        self._ended: tuple[DriveStatus, Cause, str] | None = None

    def step(self, now: float, percept: CartPercept) -> CartCommand:
        """Return what to do from now on.

        Args:
            now: [s], in the clock of the percept's stamps.
            percept: the latest of every stream.

        Raises:
            ControlError: the costmap is none, or `now` is not finite.
        """
        if not math.isfinite(now):
            raise ControlError(f"controller: expected a finite time, got {now}")
        check_costs(percept.costs)
        if self._now is None:
            self._history.add(now - REMEMBERED, self._last)
        dt = self.settings.period if self._now is None else min(max(now - self._now, 0.0), LONGEST_PERIOD)
        self._now = now
        if self._ended:
            return self._halt(now, dt, percept, *self._ended)
        fault = grip_fault(percept, self.settings)
        if fault:
            return self._end(now, dt, percept, DriveStatus.FAILED, Cause.GRIP, fault)
        cause, fault = stale_fault(percept, now, self.settings)
        if cause:
            return self._wait(now, dt, percept, DriveStatus.WAITING, cause, fault)
        return self._drive(now, dt, percept, self._where(now, percept))

    def _where(self, now: float, percept: CartPercept) -> Array:
        """Return where base and cart are when the next command arrives (4,), heading beside the goal's."""
        assert percept.pose is not None and percept.articulation is not None, "checked before"
        base = self._history.base(now, percept.pose_time, np.asarray(percept.pose, dtype=float))
        angle = self._history.articulation(now, percept.articulation_time, float(percept.articulation))
        heading = float(self._plan.at(self._time)[2])
        return np.array([base[0], base[1], heading + wrap(base[2] - heading), angle])

    def _drive(self, now: float, dt: float, percept: CartPercept, here: Array) -> CartCommand:
        settings, plan = self.settings, self._plan
        if self._standing or self._joins:
            self._time = plan.nearest(here, self._time - WINDOW, self._time + WINDOW, self._limits.speeds)
            self._standing = self._joins = False
        goal = plan.at(self._time)
        error = goal - here
        off = math.hypot(error[0], error[1]), float(np.abs(error[2:]).max())
        if off[0] > settings.off_path or off[1] > settings.off_angle:
            words = (
                f"plan: expected within {settings.off_path:g} m and {settings.off_angle:g} rad of it, "
                f"is {off[0]:.3f} m and {off[1]:.3f} rad away"
            )
            return self._end(now, dt, percept, DriveStatus.REPLAN, Cause.OFF_PLAN, words, here)
        ahead = self._guard.ahead(plan, self._time, percept.costs)
        speeds, oldest = self._speeds(now, percept)
        here_rates = np.maximum(plan.rates(self._time, settings.period), 1e-9)
        pace, cause = self._wished_pace(off, ahead, speeds, oldest, here_rates)
        pace = self._changed_pace(pace, here_rates, dt)
        step = max(dt, SHORTEST_PERIOD)
        towards = min(self._time + pace * step, plan.duration)
        planned = (plan.at(towards) - goal) / step
        extra = feedback(error, self._extra, settings.frequency, step)
        room = room_beside(planned, extra, speeds)
        planned, towards = room * planned, self._time + room * (towards - self._time)
        heading = here[2] + 0.5 * self._last[2] * step
        wish = to_base(planned + extra, heading)
        rates, share, verdict = self._free(wish, speeds, dt, here, percept)
        self._extra = to_world(rates, heading) - share * planned
        self._time += share * (towards - self._time)
        self._pace = share * pace
        if verdict is not Verdict.FREE or share < 1.0:
            cause = Cause.FOOTPRINT if verdict is Verdict.TOUCHING else Cause.OBSTACLE
        status, cause, reason = self._judged(now, off, rates, cause, ahead, percept)
        return self._command(now, dt, percept, rates, status, cause, reason, goal, error, ahead.clearance)

    def _speeds(self, now: float, percept: CartPercept) -> tuple[Array, Cause]:
        """Return the greatest speeds (3,) from which it stands in time if no more comes of the oldest stream; which."""
        settings = self.settings
        late = {cause: now - time - (0.0 if cause is Cause.SCAN else USUAL_AGE) for cause, _, time in percept.streams}
        cause = max(late, key=late.__getitem__)
        left = settings.stop_within - late[cause] - settings.period - settings.delay
        return np.minimum(self._limits.speeds, self._limits.brakings * max(left, 0.0)), cause

    def _wished_pace(
        self, off: tuple[float, float], ahead: Ahead, speeds: Array, oldest: Cause, rates: Array
    ) -> tuple[float, Cause]:
        """Return the share of the plan's speed that the goal may have, and why it is not all of it."""
        settings = self.settings
        found = [(1.0, Cause.NONE)]
        # At the limit itself rounding must not look like an old scan.
        found.append((float((speeds / rates).min()) + ROUNDING, oldest))
        lag = max(off[0] / settings.slow_error, off[1] / settings.slow_angle)
        found.append((1.5 - 0.5 * lag, Cause.LAG))
        found.append((self._arms_share, Cause.ARMS))
        if ahead.clearance < settings.near:
            share = (ahead.clearance - settings.margin) / max(settings.near - settings.margin, 1e-9)
            found.append((settings.near_share + (1.0 - settings.near_share) * max(share, 0.0), Cause.NEAR))
        if math.isfinite(ahead.free):
            most = np.maximum(ahead.rates, rates) / (COMFORT * self._limits.brakings)
            found.append((math.sqrt(2.0 * max(ahead.stop, 0.0) / max(float(most.max()), 1e-3)), Cause.OBSTACLE))
        pace, cause = min(found, key=lambda each: each[0])
        return min(max(pace, 0.0), 1.0), cause

    def _changed_pace(self, wished: float, rates: Array, dt: float) -> float:
        """Return the goal's pace, which changes as fast as base and cart can, given the plan's rates (3,) here."""
        limits = self._limits
        up = min(COMFORT / max(float((rates / limits.accelerations).max()), 1e-3), QUICKEST)
        down = 1.0 / max(float((rates / limits.brakings).max()), 1e-3)
        return min(max(wished, self._pace - down * dt), self._pace + up * dt)

    def _free(
        self, wish: Array, speeds: Array, dt: float, here: Array, percept: CartPercept
    ) -> tuple[Array, float, Verdict]:
        """Return the greatest share of a wish that leads into nothing, as a command (4,), that share, and a verdict.

        Where not even braking helps, it brakes.
        """
        for share in SHARES:
            rates = self._limits.nearest(share * wish, self._last, speeds, dt, here[3])
            verdict = self._guard.verdict(here, self._swung(rates, percept.articulation_rate), percept.costs)
            if verdict is Verdict.FREE:
                return rates, share, verdict
            if verdict is Verdict.TOUCHING:
                break
        return self._limits.nearest(np.zeros(4), self._last, speeds, dt, here[3]), 0.0, verdict

    def _swung(self, rates: Array, seen: float) -> Array:
        """Return rates (4,) with the articulation rate that is seen [rad/s] where the cart swings faster than told."""
        most = self.settings.limits.articulation_rate
        if not abs(seen) > abs(rates[3]) or not math.isfinite(seen):
            return rates
        return np.array([*rates[:3], min(max(seen, -most), most)])

    def _judged(
        self, now: float, off: tuple[float, float], rates: Array, cause: Cause, ahead: Ahead, percept: CartPercept
    ) -> tuple[DriveStatus, Cause, str]:
        """Return what to call this tick: there, under way, blocked, or without patience."""
        settings = self.settings
        at_end = self._time >= self._plan.duration
        if at_end and off[0] <= settings.tolerance and off[1] <= settings.angle_tolerance:
            if np.abs(rates).max() <= STILL:
                self._ended = DriveStatus.ARRIVED, Cause.NONE, ""
                return self._ended
            self._trouble = None
            return DriveStatus.MOVING, Cause.NONE, ""
        if not at_end and self._pace > CREEPING:
            self._trouble = None
            return DriveStatus.MOVING, cause, _words(cause, ahead)
        if at_end and cause is Cause.NONE:
            cause = Cause.STALLED
        reason = _words(cause, ahead) or "base and cart: expected to follow, hardly move"
        self._trouble = now if self._trouble is None else self._trouble
        if now - self._trouble > settings.patience:
            self._ended = DriveStatus.REPLAN, cause, f"{reason}, for more than {settings.patience:g} s"
            return self._ended
        blocked = cause in (Cause.OBSTACLE, Cause.FOOTPRINT)
        return (DriveStatus.BLOCKED if blocked else DriveStatus.MOVING), cause, reason

    def _wait(
        self, now: float, dt: float, percept: CartPercept, status: DriveStatus, cause: Cause, reason: str
    ) -> CartCommand:
        """Stand; give up when it lasts too long."""
        self._trouble = now if self._trouble is None else self._trouble
        if now - self._trouble > self.settings.patience:
            words = f"{reason}, for more than {self.settings.patience:g} s"
            return self._end(now, dt, percept, DriveStatus.REPLAN, cause, words)
        return self._halt(now, dt, percept, status, cause, reason)

    def _end(
        self,
        now: float,
        dt: float,
        percept: CartPercept,
        status: DriveStatus,
        cause: Cause,
        reason: str,
        here: Array | None = None,
    ) -> CartCommand:
        self._ended = status, cause, reason
        return self._halt(now, dt, percept, status, cause, reason, here)

    def _halt(
        self,
        now: float,
        dt: float,
        percept: CartPercept,
        status: DriveStatus,
        cause: Cause,
        reason: str,
        here: Array | None = None,
    ) -> CartCommand:
        """Brake as hard as allowed, whatever the plan says."""
        self._standing, self._pace, self._extra = True, 0.0, np.zeros(4)
        rates = self._limits.nearest(np.zeros(4), self._last, self._limits.speeds, dt, 0.0)
        goal = self._plan.at(self._time)
        error = np.full(4, math.nan) if here is None else goal - here
        return self._command(now, dt, percept, rates, status, cause, reason, goal, error, math.nan)

    def _command(
        self,
        now: float,
        dt: float,
        percept: CartPercept,
        rates: Array,
        status: DriveStatus,
        cause: Cause,
        reason: str,
        goal: Array,
        error: Array,
        clearance: float,
    ) -> CartCommand:
        joints = None
        if percept.arms is not None:
            rates, joints = self._arms(percept, rates)
        self._last = rates
        self._history.add(now, rates)
        return CartCommand(
            rates[:3].copy(), float(rates[3]), status, cause, reason, goal, error, clearance, self._pace, joints
        )

    def _arms(self, percept: CartPercept, rates: Array) -> tuple[Array, Array]:
        """Return the rates with the articulation that the arms' limits leave, and the joints' rates (2, 7)."""
        assert percept.arms is not None, "checked before"
        if self._body.hands is None:
            raise ControlError("body: expected hands where joint rates are wanted, got none; give shoulders and hands")
        settings, grip = self.settings, np.array(self._body.grip)
        offset = np.asarray(percept.grip_offset, dtype=float)
        angle = percept.articulation
        angle = float(angle) if angle is not None and math.isfinite(angle) else 0.0
        back = -settings.grip_gain * offset if np.isfinite(offset).all() else np.zeros(2)
        if self._standing:
            back = np.zeros(2)
        here = grip + (offset if np.isfinite(offset).all() else 0.0)
        hands = here + np.asarray(self._body.hands) @ rotation(angle).T
        twists = hand_twists(np.array([*back, rates[3]]), here, hands)
        found = arm_rates(percept.arms, twists, settings.arms)
        self._arms_share = found.scale
        return np.array([*rates[:3], found.scale * rates[3]]), found.rates


def _words(cause: Cause, ahead: Ahead) -> str:
    """Return a cause with what is known about it."""
    if cause is Cause.NEAR:
        return f"{cause}: {ahead.clearance:.2f} m"
    if cause is Cause.OBSTACLE and math.isfinite(ahead.free):
        return f"{cause}: {ahead.free:.2f} s ahead on the plan"
    return str(cause)
