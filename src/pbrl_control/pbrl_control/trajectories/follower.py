"""Follows an object trajectory: the seen pose in, the object's twist out. A pure state machine, time is given.

The command is the setpoint's twist, seen from where the object is, plus a share of the error; with a model it is
projected onto what the constraints allow. The setpoint waits when the object is behind, and a tag is compared
with the setpoint of the moment at which it was seen, so that a late camera does not look like a slow object.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from pbrl_control.constraints.classes import DEFAULTS, ConstraintSettings, Freedom, ModelClass
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.constraints.twist import achievable_twist
from pbrl_control.constraints.wrench import expected_grip_wrench
from pbrl_control.errors import ControlError
from pbrl_control.percept import Tag, object_planar
from pbrl_control.planar import Array, compose, inverse, turn
from pbrl_control.trajectories.achievable import achievable_trajectory, peak_grip_force
from pbrl_control.trajectories.monitor import AbortMonitor, Forces
from pbrl_control.trajectories.trajectory import Trajectory
from pbrl_control.trajectories.trajectory_plan import AbortLimits, FollowSettings
from pbrl_control.types import PlanarTwist

MEMORY = 200  # ticks for which it is remembered where the setpoint was
PACE_TIME = 0.2  # [s] in which the setpoint's pace goes from standing to full, and back
LONGEST_TICK = 0.1  # [s] that the setpoint goes on in one: after missed ticks it does not leap
FORESEEN = 0.02  # [m] and [rad] that the end may lie off the wanted one before it is worth a word


class FollowState(StrEnum):
    """Where a trajectory is."""

    WAITING = "waiting"
    FOLLOWING = "following"
    SETTLING = "settling"
    DONE = "done"
    ABORTED = "aborted"


@dataclass(frozen=True)
class FollowCommand:
    """What the follower wants now.

    Attributes:
        state: where the trajectory is.
        twist: of the object's origin in its axes; zero unless following or settling.
        status: a sentence; of an aborted trajectory, why.
        progress: share of the trajectory's time that is done, 0..1.
        error: (3,) way from the seen pose to the setpoint, smoothed, in the object's axes [m, rad].
        refused: what the constraints took from the wanted twist.
    """

    state: FollowState
    twist: PlanarTwist
    status: str
    progress: float
    error: Array = field(default_factory=lambda: np.zeros(3))
    refused: PlanarTwist = field(default_factory=PlanarTwist)

    @property
    def finished(self) -> bool:
        """Whether the trajectory has ended, well or not."""
        return self.state in (FollowState.DONE, FollowState.ABORTED)

    @property
    def final_error(self) -> tuple[float, float]:
        """Distance [m] and turn [rad] from where the object is to the setpoint: of a finished one, its last pose."""
        return float(np.hypot(*self.error[:2])), abs(float(self.error[2]))


class TrajectoryFollower:
    """Follows one trajectory.

    With a model, the trajectory that is followed is what the constraints make of the wanted one, and the forces
    that it takes are known beforehand.

    Args:
        trajectory: where the object is to be when.
        settings: gains.
        limits: what ends it early.
        model: the object's physics; None: nothing is known.
        contacts: (2,) where each gripper holds it, in the object's frame [m]; none: `limits.force` judges forces.
        constraint: what counts as a constraint.

    Attributes:
        trajectory: the one that is followed.
        expected_force: largest at any grip [N]; None without a model or without grips.
        detour: (3,) way from the wanted last pose to that of the trajectory that is followed [m, rad], its axes.

    Raises:
        ControlError: the model needs more than it has been given, or is not physical.
    """

    def __init__(
        self,
        trajectory: Trajectory,
        settings: FollowSettings | None = None,
        limits: AbortLimits | None = None,
        model: ObjectModel | None = None,
        contacts: Mapping[str, Array] | None = None,
        constraint: ConstraintSettings = DEFAULTS,
    ) -> None:
        self.settings, limits = settings or FollowSettings(), limits or AbortLimits()
        self._model, self._constraint = model, constraint
        self._contacts = dict(contacts or {})
        self.trajectory: Trajectory = trajectory
        self.expected_force: float | None = None
        self.detour = np.zeros(3)
        if model is not None:
            self.trajectory = achievable_trajectory(trajectory, model, constraint)
            wanted = trajectory.at(trajectory.duration).pose
            self.detour = compose(inverse(wanted), self.trajectory.at(trajectory.duration + 1.0).pose)
            if contacts:
                points = np.array([contacts[side] for side in sorted(contacts)])
                self.expected_force = peak_grip_force(self.trajectory, model, points, constraint)
        self._monitor = self._watch(limits)
        self.state = FollowState.WAITING
        self._reason = ""
        self._start = self._last = self._since = math.nan
        self._done = 0.0  # [s] of the trajectory
        self._pace = 0.0
        self._history: deque[tuple[float, float]] = deque(maxlen=MEMORY)
        self._seen: tuple[float, Array] | None = None  # time and pose of the last tag
        self._error = np.zeros(3)
        self._twist = np.zeros(3)
        self._summed = np.zeros(3)  # what feedback has added up
        self._refusal = ""

    @property
    def force_limit(self) -> float:
        """Horizontal force at any grip that ends the trajectory [N]."""
        return self._monitor.force

    @property
    def progress(self) -> float:
        """Share of the trajectory's time that is done, 0..1."""
        return min(self._done / self.trajectory.duration, 1.0) if self.trajectory.duration > 0.0 else 1.0

    def expected_wrenches(self) -> dict[str, Array]:
        """Return the wrench (3,) that each grip is expected to apply now: fx, fy [N], tau [N m] at its contact.

        Object axes. Empty without a model or grips.
        """
        if self._model is None or not self._contacts or self._seen is None:
            return {}
        sides = sorted(self._contacts)
        points = np.array([self._contacts[side] for side in sides])
        point = self.trajectory.at(self._done)
        moving = self._pace if self.state == FollowState.FOLLOWING else 0.0
        wrenches = expected_grip_wrench(
            self._model, self._seen[1], moving * point.twist, moving * point.rate, points, self._constraint
        )
        return dict(zip(sides, wrenches, strict=True))

    def tick(self, now: float, tag: Tag | None, forces: Forces | None = None, share: float = 1.0) -> FollowCommand:
        """Return what to do at `now` [s]; never raises for what it is told.

        Args:
            now: [s] on the clock of the tag.
            tag: latest of the object; None while none was seen.
            forces: horizontal force at each grip [N], bias removed.
            share: of the last command that the body could do, 0 to 1: feedback is not summed up for what it could not.
        """
        if self.state in (FollowState.DONE, FollowState.ABORTED):
            return self._rest(self._reason)
        if not math.isfinite(now):
            return self._abort(f"time: expected a finite number, got {now}")
        if math.isnan(self._start):
            self._start = self._last = self._since = now
        if now < self._last:
            return self._abort(f"time: expected it to go on, got {self._last - now:.3f} s back; was the clock set?")
        dt, self._last = min(now - self._last, LONGEST_TICK), now
        try:
            return self._step(now, dt, tag, forces or {}, share)
        except ControlError as error:
            return self._abort(str(error))

    def _step(self, now: float, dt: float, tag: Tag | None, forces: Forces, share: float) -> FollowCommand:
        self._monitor.check_tag(now, tag, self._start)
        self._monitor.check_force(now, forces)
        self._monitor.check_time(now - self._start, self.progress)
        if tag is None:
            return self._rest("waiting for a tag of the object")
        if self.state == FollowState.WAITING:
            self._refuse_static(tag)
            self._enter(FollowState.FOLLOWING, now)
        self._history.append((now, self._done))
        self._see(tag)
        if self.state == FollowState.FOLLOWING:
            self._advance(now, dt)
        elif self._arrived(now):
            return self._finish()
        return self._command(dt, min(max(share, 0.0), 1.0))

    def _watch(self, limits: AbortLimits) -> AbortMonitor:
        force = limits.force
        if self.expected_force is not None:
            force = max(limits.force_ratio * self.expected_force, limits.force_floor)
        timeout = limits.time_ratio * self.trajectory.duration + limits.stall_time + self.settings.settle_timeout
        return AbortMonitor(limits, force, self.expected_force, timeout)

    def _refuse_static(self, tag: Tag) -> None:
        if self._model is not None:
            freedom = Freedom.of(self._model, object_planar(tag), self._constraint)
            if freedom.model_class == ModelClass.STATIC:
                raise ControlError(f"static object: {freedom.reason}")

    def _see(self, tag: Tag) -> None:
        """Blend in the error of a tag that is new, against the setpoint of its own time."""
        if self._seen is not None and tag.time <= self._seen[0]:
            return
        pose = object_planar(tag)
        times, done = np.array(self._history).T
        then = self.trajectory.at(float(np.interp(tag.time, times, done)))
        fresh = compose(inverse(pose), then.pose)
        share = 1.0
        if self._seen is not None:
            share = 1.0 - math.exp(-(tag.time - self._seen[0]) / self.settings.smoothing)
        self._error = self._error + share * (fresh - self._error)
        self._seen = (tag.time, pose)

    def _advance(self, now: float, dt: float) -> None:
        """Let the setpoint go on: at full pace while the object keeps up, not at all when it is a slack behind."""
        settings = self.settings
        behind = max(float(np.hypot(*self._error[:2])) / settings.slack, abs(self._error[2]) / settings.yaw_slack)
        wish = min(max(2.0 * (1.0 - behind), 0.0), 1.0)
        change = dt / PACE_TIME
        self._pace = min(max(wish, self._pace - change), self._pace + change)
        self._done = min(self._done + self._pace * dt, self.trajectory.duration)
        if self._done >= self.trajectory.duration:
            self._enter(FollowState.SETTLING, now)
        else:
            self._monitor.check_progress(now, self._done, self._refusal)

    def _arrived(self, now: float) -> bool:
        settings, (distance, yaw) = self.settings, self._off()
        waited = now - self._since
        near = distance <= settings.tolerance and yaw <= settings.yaw_tolerance
        return waited >= settings.settle_timeout or (near and waited >= settings.settle)

    def _finish(self) -> FollowCommand:
        self.state, self._reason = FollowState.DONE, f"done: {self._where_it_is()}{self._foreseen()}"
        return self._rest(self._reason)

    def _command(self, dt: float, share: float) -> FollowCommand:
        self._summed = self._bounded(self._summed + share * self.settings.integral * dt * self._error)
        wanted = self._wanted()
        refused = PlanarTwist()
        self._refusal = ""
        if self._model is not None and self._seen is not None:
            part = achievable_twist(self._model, PlanarTwist(*map(float, wanted)), self._seen[1], self._constraint)
            wanted, refused, self._refusal = part.twist.array(), part.refused, part.status
        self._slew(wanted, dt)
        if not np.isfinite(self._twist).all():
            raise ControlError(f"command: expected a finite twist, got {self._twist.tolist()}")
        said = f"{100 * self.progress:.0f} % of the way, {self._where_it_is()}"
        status = f"{said}; {self._refusal}" if self._refusal else said
        twist = PlanarTwist(*map(float, self._twist))
        return FollowCommand(self.state, twist, status, self.progress, self._error.copy(), refused)

    def _wanted(self) -> Array:
        """Return the setpoint's twist seen from the object, and feedback, each part of that within its own bound."""
        point, settings = self.trajectory.at(self._done), self.settings
        ahead = self._pace * turn(point.twist, self._error[2]) if self.state == FollowState.FOLLOWING else np.zeros(3)
        return ahead + self._bounded(settings.gain * self._error) + self._summed

    def _bounded(self, feedback: Array) -> Array:
        """Return a feedback (3,) of the same direction, no faster than feedback may be."""
        settings, speed = self.settings, float(np.hypot(feedback[0], feedback[1]))
        line = min(settings.feedback_speed / speed, 1.0) if speed > 0.0 else 1.0
        yaw_rate = min(max(float(feedback[2]), -settings.feedback_yaw_rate), settings.feedback_yaw_rate)
        return np.array([line * feedback[0], line * feedback[1], yaw_rate])

    def _slew(self, wanted: Array, dt: float) -> None:
        """Change the command as fast as allowed, straight towards the wanted one: between two allowed twists."""
        change = wanted - self._twist
        line = float(np.hypot(change[0], change[1])) / self.settings.acceleration
        needed = max(line, abs(float(change[2])) / self.settings.yaw_acceleration)
        self._twist = self._twist + change * (min(dt / needed, 1.0) if needed > 0.0 else 1.0)

    def _off(self) -> tuple[float, float]:
        return float(np.hypot(*self._error[:2])), abs(float(self._error[2]))

    def _where_it_is(self) -> str:
        distance, yaw = self._off()
        return f"{distance:.3f} m and {math.degrees(yaw):.1f} deg off"

    def _foreseen(self) -> str:
        if max(float(np.hypot(*self.detour[:2])), abs(self.detour[2])) < FORESEEN:
            return ""
        away, yaw = float(np.hypot(*self.detour[:2])), math.degrees(abs(self.detour[2]))
        return f"; its constraints let it end {away:.2f} m and {yaw:.0f} deg from where it was wanted"

    def _enter(self, state: FollowState, now: float) -> None:
        self.state, self._since = state, now

    def _abort(self, reason: str) -> FollowCommand:
        self.state, self._reason = FollowState.ABORTED, reason
        return self._rest(reason)

    def _rest(self, status: str) -> FollowCommand:
        self._twist = np.zeros(3)
        return FollowCommand(self.state, PlanarTwist(), status, self.progress, self._error.copy())
