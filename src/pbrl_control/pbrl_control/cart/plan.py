"""A plan of the planner's with times: where base and cart are to be when, within limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from pbrl_control.cart.settings import CartLimits
from pbrl_control.cart.tracking_kernel import sample
from pbrl_control.errors import ControlError
from pbrl_control.planar import Array, rotation

MOST_POSES = 100_000
STEP = 0.02  # [s at full speed] between samples of a plan that is given its times here
ROUNDING = 0.16  # [s at full speed] over which a corner of the plan is taken as rounded
LONGEST = 3600.0  # [s at full speed]
SLOWEST = 0.05  # of full speed: ends are left and reached at this, which is below what drives notice


@dataclass(frozen=True)
class CartPlan:
    """Poses at times.

    Attributes:
        times: (n,) [s], from 0, ascending.
        poses: (n, 4) x, y, heading of `base` in the frame of the costmap, articulation [m, rad], angles without jumps.
        reached: (k,) when each of the poses is that it was made from [s]; empty where it was made with its times.

    Raises:
        ControlError: a shape or number is not what it should be.
    """

    times: Array
    poses: Array
    reached: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        times, poses = np.asarray(self.times, dtype=float), _poses(self.poses)
        if times.shape != (len(poses),) or not np.isfinite(times).all():
            raise ControlError(f"plan: expected finite times ({len(poses)},), got shape {times.shape}")
        if times[0] != 0.0 or (np.diff(times) <= 0.0).any():
            raise ControlError("plan: expected times that begin at 0 and ascend")
        object.__setattr__(self, "times", np.ascontiguousarray(times))
        object.__setattr__(self, "poses", np.ascontiguousarray(poses))

    @classmethod
    def timed(
        cls,
        poses: Array | Sequence[Sequence[float]],
        limits: CartLimits,
        share: float = 0.5,
        last: Array | None = None,
    ) -> Self:
        """Give times to a planner's poses (n, 4): as soon as can be within speeds and a share of the accelerations.

        Between poses everything goes on evenly. Where the plan has a corner, what goes round it is as slow as
        rounding it within 0.16 s at full speed takes.

        Args:
            poses: as above.
            limits: of base and articulation.
            share: of the accelerations.
            last: (4,) what base and articulation do at the first pose, in the robot's axes, where they are under way
                [m/s, rad/s]; None: they stand.

        Raises:
            ControlError: the poses are not what they should be, or leave the articulation's range.
        """
        points = _poses(poses)
        low, high = limits.articulation
        if points[:, 3].min() < low - 1e-6 or points[:, 3].max() > high + 1e-6:
            raise ControlError(
                f"plan: expected articulations from {low} to {high} rad, got {points[:, 3].min():.3f} to "
                f"{points[:, 3].max():.3f}; plan with a smaller range"
            )
        steps = np.diff(points, axis=0)
        fastest = np.column_stack((np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2:]))) / limits.speeds
        ends = np.concatenate(([0.0], np.cumsum(fastest.max(axis=1, initial=0.0))))
        if ends[-1] > LONGEST:
            raise ControlError(f"plan: expected at most {LONGEST:g} s of motion, got {ends[-1]:g} s; check its units")
        keep = np.concatenate(([True], np.diff(ends) > 1e-9))
        if keep.sum() < 2:
            return cls(np.zeros(1), points[:1], np.zeros(len(points)))
        samples = np.linspace(0.0, ends[-1], max(int(np.ceil(ends[-1] / STEP)), 1) + 1)
        fine = np.column_stack([np.interp(samples, ends[keep], points[keep, k]) for k in range(4)])
        fine[-1] = points[-1]
        rates = np.zeros(4) if last is None else np.asarray(last, dtype=float)
        along = np.append(rotation(float(fine[0, 2])) @ rates[:2], rates[2:])
        times = _times(samples, fine, share * limits.accelerations, along)
        return cls(times, fine, np.interp(ends, samples, times))

    @property
    def duration(self) -> float:
        """Until its end [s]."""
        return float(self.times[-1])

    def at(self, time: float | Array) -> Array:
        """Return the pose (4,) at a time, or poses (k, 4) at times (k,) [s]; before and after it: its ends."""
        at = np.atleast_1d(np.asarray(time, dtype=float))
        found = np.empty((len(at), 4))
        sample(self.times, self.poses, at, found)
        return found if np.ndim(time) else found[0]

    def rates(self, time: float, ahead: float) -> Array:
        """Return the mean rates (3,) of translation, yaw and articulation from a time on for so long [m/s, rad/s]."""
        a, b = self.at(np.array([time, time + ahead]))
        moved = np.abs(b - a)
        return np.array([math.hypot(moved[0], moved[1]), moved[2], moved[3]]) / ahead

    def nearest(self, pose: Array, begin: float, end: float, scales: Array) -> float:
        """Return the time between two at which the plan is nearest to a pose (4,) [s].

        Args:
            pose: heading within half a turn of the plan's.
            begin: [s].
            end: [s].
            scales: (3,) of translation, heading and articulation that count the same.
        """
        times = np.linspace(max(begin, 0.0), min(end, self.duration), 81)
        off = (self.at(times) - pose) / scales[[0, 0, 1, 2]]
        return float(times[int(np.argmin(np.sum(off**2, axis=1)))])


def _poses(poses: Array | Sequence[Sequence[float]]) -> Array:
    """Return poses (n, 4) with headings that do not jump."""
    try:
        points = np.array(poses, dtype=float)
    except (TypeError, ValueError) as error:
        raise ControlError(f"plan: expected numbers (n, 4), got {type(poses).__name__}") from error
    if points.ndim != 2 or points.shape[1] != 4 or not 1 <= len(points) <= MOST_POSES:
        raise ControlError(f"plan: expected poses (n, 4) with n from 1 to {MOST_POSES}, got shape {points.shape}")
    if not np.isfinite(points).all() or np.abs(points).max() > 1e6:
        raise ControlError("plan: expected finite poses within 1e6 m, got others")
    points[:, 2] = np.unwrap(points[:, 2])
    return points


def _times(samples: Array, poses: Array, accelerations: Array, begin: Array) -> Array:
    """Return when to be at evenly sampled poses, from the rates (4,) that it begins with to rest.

    The pace p = d samples / d time is bounded by what corners and starts take of the accelerations, half for each: by
    a pass forwards and one backwards.
    """
    step = samples[1] - samples[0]
    tangent = np.diff(poses, axis=0) / step
    half = max(round(0.5 * ROUNDING / float(step)), 1)
    # Mean tangents before and behind a sample; at the ends there is nothing to turn.
    padded = np.concatenate((np.repeat(tangent[:1], half, 0), tangent, np.repeat(tangent[-1:], half, 0)))
    sums = np.concatenate((np.zeros((1, 4)), np.cumsum(padded, axis=0)))
    means = (sums[half:] - sums[:-half]) / half
    bend = _three((means[half:] - means[:-half])[: len(poses)]) / (half * step)
    pace = np.minimum(1.0, np.sqrt((0.5 * accelerations / np.maximum(bend, 1e-9)).min(axis=1)))
    push = (0.5 * accelerations / np.maximum(_three(tangent), 1e-9)).min(axis=1)
    pace[0] = min(pace[0], float(begin @ tangent[0]) / max(float(tangent[0] @ tangent[0]), 1e-9))
    pace[-1] = SLOWEST
    pace = np.maximum(pace, SLOWEST)
    for k in range(len(push)):
        pace[k + 1] = min(pace[k + 1], np.sqrt(pace[k] ** 2 + 2.0 * push[k] * step))
    for k in range(len(push) - 1, -1, -1):
        pace[k] = min(pace[k], np.sqrt(pace[k + 1] ** 2 + 2.0 * push[k] * step))
    return np.concatenate(([0.0], np.cumsum(2.0 * step / (pace[1:] + pace[:-1]))))


def _three(rates: Array) -> Array:
    """Return sizes (n, 3) of translation, yaw and articulation of (n, 4)."""
    return np.column_stack((np.hypot(rates[:, 0], rates[:, 1]), np.abs(rates[:, 2:])))
