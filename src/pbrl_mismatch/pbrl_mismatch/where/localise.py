"""Where a model and a recording part: when, in which frame, at what speed, on which part of the floor, in which hold.

It is asked of the wrench that the model lacks, before and beside any law of an effect: it is told of what has no name
as well, and of a name it says what the name has to account for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import Recording
from pbrl_mismatch.activity import Interval, intervals
from pbrl_mismatch.data.residual import residual_wrench
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.unknown.samples import Samples, apart, samples_of
from pbrl_mismatch.where.axes import FRAMES, PARTS, axes_of
from pbrl_mismatch.where.contacts import Contact, contacts_of
from pbrl_mismatch.where.floor import FloorRegion, floor_region
from pbrl_mismatch.where.partition import Partition, Stretch, partition

Array = NDArray[np.float64]

SURE = 0.95
"""A frame is told where it is so probable among the three."""
SHOWN = 6
"""Stretches in sentences."""
STRAIGHT = 20.0
"""A force within this of the motion is along or against it [deg]."""
WHOSE = {"world": "the floor", "body": "the body", "velocity": "the motion"}
VARIED, FELT = 0.5, 2.0
"""A power of the speed that is known no better than to the first is not told, nor one below so many deviations."""


@dataclass(frozen=True)
class Power:
    """The power of the speed that a wrench goes with: 0, it is no stronger; 1, proportional."""

    mean: float
    sd: float


@dataclass(frozen=True)
class Hold:
    """One hold of the object: begin and end [s], and the share of it in which the wrench is there."""

    begin: float
    end: float
    share_there: float


@dataclass(frozen=True)
class Localisation:
    """Where a wrench that a model lacks was.

    Attributes:
        found: its stretches.
        when: of each stretch the (start, end) in which the object was held [s].
        power: of the speed; None: the speed hardly varied while it was there.
        floor: the region that it goes by; None: it does not, or is all over.
        holds: in order.
        contacts: what that is known was within touch while it was there.
    """

    found: Partition
    when: tuple[tuple[Interval, ...], ...]
    power: Power | None
    floor: FloorRegion | None
    holds: tuple[Hold, ...]
    contacts: tuple[Contact, ...] = ()

    @property
    def there(self) -> list[tuple[Stretch, tuple[Interval, ...]]]:
        """Return the stretches with a wrench, and when they are."""
        return [(each, when) for each, when in zip(self.found.stretches, self.when, strict=True) if each.there and when]

    def to_report(self) -> dict[str, Any]:
        """Return a JSON-able form."""
        floor = self.floor
        return {
            "when": [list(each) for _, when in self.there for each in when],
            "changes": [{"time": each.time, "sd": each.sd} for each in self.found.changes],
            "stretches": [_stretch_report(stretch, when) for stretch, when in self.there],
            "speed_power": None if self.power is None else {"mean": self.power.mean, "sd": self.power.sd},
            "floor": None
            if floor is None
            else {
                "shape": np.round(floor.shape, 4).tolist(),
                "border_sd": floor.border_sd,
                "share_there": floor.share_there,
                "passes": floor.passes,
            },
            "holds": [asdict(each) for each in self.holds],
            "contacts": [asdict(each) for each in self.contacts],
            "sentences": sentences_of(self),
        }


def localise(track: Track, row: Array, recording: Recording | None = None) -> Localisation:
    """Say where the wrench that a model lacks was.

    Args:
        track: what was recorded.
        row: (WIDTH,) of the model.
        recording: with what else is known to be about; None: nothing is.

    Raises:
        MismatchError: the recording is too short.
    """
    every = samples_of(track, residual_wrench(track, row))
    samples = every.take(apart(track))
    found = partition(samples)
    # Which stretch a moment of the track is in.
    which = np.searchsorted([each.time for each in found.changes], track.clock)
    when = tuple(intervals(track, which == k) for k in range(len(found.stretches)))
    there = np.array([each.there for each in found.stretches])[which]
    holds = [
        Hold(float(track.clock[b]), float(track.clock[e]) + track.dt, float(there[b : e + 1].mean()))
        for b, e in zip(track.begin, track.last, strict=True)
    ]
    return Localisation(
        found,
        when,
        _power(samples, found),
        floor_region(samples, found),
        tuple(holds),
        () if recording is None else contacts_of(recording, track, there),
    )


def _power(samples: Samples, found: Partition) -> Power | None:
    """Return the power of the speed by which a wrench is larger or smaller within its stretches, or None.

    To first order about a stretch's mean speed u, a wrench w that goes with the n-th power of the speed v is
    w (1 + n (v - u) / u): least squares in n.
    """
    axes, speed = {frame: axes_of(samples, frame) for frame in FRAMES}, np.hypot(*samples.velocity.T)
    noise = samples.covariance + found.left_over**2 * np.diag(samples.scale**2)
    precision = pull = misfit = 0.0
    count = 0
    for each in found.stretches:
        rows = np.arange(each.first, each.end)
        usual = float(speed[rows].mean())
        if not each.there or usual <= 0.0:
            continue
        whole = axes[each.frame][rows] @ each.mean
        slope = whole * ((speed[rows] - usual) / usual)[:, None]
        weighed = np.linalg.solve(noise[rows], slope[..., None])[..., 0]
        rest = samples.wrench[rows] - whole
        precision += float(np.sum(weighed * slope))
        pull += float(np.sum(weighed * rest))
        misfit += float(np.sum(np.linalg.solve(noise[rows], rest[..., None])[..., 0] * rest))
        count += 3 * len(rows)
    if precision <= 0.0:
        return None
    mean = pull / precision
    wider = max((misfit - mean * pull) / count, 1.0)
    sd = math.sqrt(wider / precision)
    return Power(mean, sd) if sd < VARIED else None


def _stretch_report(stretch: Stretch, when: Sequence[Interval]) -> dict[str, Any]:
    return {
        "when": [list(each) for each in when],
        "frame": stretch.frame if _sure(stretch) else None,
        "frames": dict(stretch.frames),
        "wrench": {
            name: {"mean": float(mean), "sd": float(sd), "unit": unit}
            for name, mean, sd, unit in zip(
                PARTS[stretch.frame], stretch.mean, stretch.sd, ("N", "N", "N m"), strict=True
            )
        },
    }


def _sure(stretch: Stretch) -> bool:
    return stretch.frames[stretch.frame] >= SURE


def sentences_of(where: Localisation) -> list[str]:
    """Return it in sentences, the most important first."""
    if not where.there:
        return ["at no moment does the wrench that the model lacks stand out by itself: it is small, and everywhere"]
    held = sum(each.end - each.begin for each in where.holds)
    lasts = sum(end - start for _, when in where.there for start, end in when)
    told = [f"the wrench that the model lacks stands out for {lasts:.0f} s of the {held:.0f} s of holding"]
    weighty = sorted(where.there, key=lambda each: -_impulse(*each))[:SHOWN]
    told += [_stretch_sentence(where, *each) for each in sorted(weighty, key=lambda each: each[0].first)]
    if len(where.there) > SHOWN:
        told.append(f"and in {len(where.there) - SHOWN} more stretches, which are weaker or shorter")
    if where.power is not None:
        told.append(_power_sentence(where.power))
    if where.floor is not None:
        told.append(_floor_sentence(where.floor))
    return told


def _impulse(stretch: Stretch, when: Sequence[Interval]) -> float:
    """Return how large a stretch's force is times how long it lasts [N s]."""
    return float(np.hypot(*stretch.mean[:2])) * sum(end - start for start, end in when)


def _stretch_sentence(where: Localisation, stretch: Stretch, when: Sequence[Interval]) -> str:
    """Return a stretch as a person would say it, with how surely its ends are known."""
    k = [each.first for each in where.found.stretches].index(stretch.first)
    begun = where.found.changes[k - 1] if k > 0 else None
    ended = where.found.changes[k] if k < len(where.found.changes) else None
    start = f"{when[0][0]:.1f}" if begun is None else f"{begun.time:.1f} ± {begun.sd:.1f}"
    end = f"{when[-1][1]:.1f}" if ended is None else f"{ended.time:.1f} ± {ended.sd:.1f}"
    x, y, moment = stretch.mean
    size, angle = math.hypot(x, y), math.degrees(math.atan2(y, x))
    side = "left" if y >= 0.0 else "right"
    if stretch.frame == "velocity":
        way = _by_motion(abs(angle), side)
    elif stretch.frame == "body":
        way = f"{abs(angle):.0f} degrees to the {side} of the body's x axis"
    else:
        way = f"towards {angle:.0f} degrees from the world's x axis"
    turns = f"{moment:.2g} N m {'with the turn' if stretch.frame == 'velocity' else 'about its centre'}"
    names = [stretch.frame, *(name for name in FRAMES if name != stretch.frame and stretch.frames[name] > 1.0 - SURE)]
    kept = " or ".join(WHOSE[name] for name in names) + ("" if _sure(stretch) else ", which is not told apart")
    return f"from {start} to {end} s: {size:.2g} N {way} and {turns}, fixed to {kept}"


def _by_motion(angle: float, side: str) -> str:
    """Return the direction of a force that is turned from the motion by an angle [deg]."""
    if angle > 180.0 - STRAIGHT:
        return "against the motion"
    return "along the motion" if angle < STRAIGHT else f"{angle:.0f} degrees to the {side} of the motion"


def _power_sentence(power: Power) -> str:
    told = f"(power of the speed {power.mean:.1f} ± {power.sd:.1f})"
    if abs(power.mean) < FELT * power.sd:
        return f"it is no stronger and no weaker at a higher speed {told}"
    return f"it is {'stronger' if power.mean > 0.0 else 'weaker'} at a higher speed {told}"


def _floor_sentence(floor: FloorRegion) -> str:
    (left, low), (right, high) = floor.shape.min(axis=0), floor.shape.max(axis=0)
    told = (
        f"it is there where the body's middle is within x {left:.2f} to {right:.2f} m, y {low:.2f} to {high:.2f} m "
        f"(border ± {floor.border_sd:.2f} m)"
    )
    return told if floor.passes > 1 else f"{told}; the body was there once, so that it may as well be the time"
