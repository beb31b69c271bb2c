"""Physical features that a left-out wrench may be a combination of, in named frames and units.

The force of the hand is none of them: in slow motion whatever resists is all but minus that force, which explains
everything and says nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.unknown.samples import Samples

Array = NDArray[np.float64]

STILL = 0.01
"""A speed that counts as rest [m/s]; divided by the radius of gyration for turning."""
BORDERS = (0.2, 0.35, 0.5, 0.65, 0.8)
"""Quantiles of places and times at which something may begin."""
SLOWEST, FASTEST, FINEST = 0.1, 1.0, 0.015
"""Rhythms that are tried [Hz], half a turn over the recording apart; faster ones the smoother does not follow."""


@dataclass(frozen=True)
class Feature:
    """One feature with k coefficients: the wrench is `values` times them.

    Attributes:
        name: unique.
        says: how to say it after a force, e.g. "against the direction of motion".
        frame: "world", "body", "velocity".
        unit: of the coefficients.
        parts: (k,) names of the coefficients.
        values: (N, 3, k) [N, N, N m] for each unit of a coefficient.
    """

    name: str
    says: str
    frame: str
    unit: str
    parts: tuple[str, ...]
    values: Array

    def take(self, rows: NDArray[np.int64]) -> Feature:
        """Return it at some of the moments."""
        return replace(self, values=self.values[rows])


def features_of(samples: Samples) -> tuple[Feature, ...]:
    """Return all features at the samples."""
    return (*steady(samples), *_inertial(samples), *_placed(samples), *_timed(samples))


def steady(samples: Samples) -> tuple[Feature, ...]:
    """Return what is constant in a frame, or resists, all the time."""
    return (*_constant(samples), *_resisting(samples))


def _force(*columns: Array) -> Array:
    """Return (N, 3, k) of forces (N, 2) without a moment."""
    return np.stack([np.column_stack([column, np.zeros(len(column))]) for column in columns], -1)


def _moment(column: Array) -> Array:
    """Return (N, 3, 1) of a moment (N,)."""
    return np.stack([np.zeros_like(column), np.zeros_like(column), column], -1)[..., None]


def _axes(samples: Samples) -> tuple[Array, Array]:
    c, s = np.cos(samples.heading), np.sin(samples.heading)
    return np.stack([c, s], -1), np.stack([-s, c], -1)


def along_motion(samples: Samples) -> Array:
    """Return (N, 2) the direction of motion, shorter than one near rest."""
    speed = np.sqrt(np.sum(samples.velocity**2, axis=1) + STILL**2)
    return samples.velocity / speed[:, None]


def _constant(samples: Samples) -> Iterator[Feature]:
    one = np.ones(len(samples))
    x, y = np.outer(one, [1.0, 0.0]), np.outer(one, [0.0, 1.0])
    yield Feature("constant in world", "in a fixed direction of the floor", "world", "N", ("x", "y"), _force(x, y))
    ahead, left = _axes(samples)
    yield Feature(
        "constant in body", "in a fixed direction of the body", "body", "N", ("ahead", "left"), _force(ahead, left)
    )
    yield Feature("constant moment", "turning it always the same way", "body", "N m", ("moment",), _moment(one))


def _resisting(samples: Samples) -> Iterator[Feature]:
    way = along_motion(samples)
    v, speed = samples.velocity, np.hypot(*samples.velocity.T)
    turn = samples.spin / np.sqrt(samples.spin**2 + (STILL / samples.gyration) ** 2)
    says = "against the direction of motion"
    yield Feature("dry resistance", says, "velocity", "N", ("against",), _force(-way))
    yield Feature("viscous resistance", f"{says}, growing with speed", "velocity", "N s/m", ("against",), _force(-v))
    yield Feature(
        "quadratic resistance",
        f"{says}, growing with the square of speed",
        "velocity",
        "N s^2/m^2",
        ("against",),
        _force(-v * speed[:, None]),
    )
    side = np.stack([-way[:, 1], way[:, 0]], -1)
    yield Feature(
        "across the motion", "across the direction of motion, to its left", "velocity", "N", ("left",), _force(side)
    )
    yield Feature("dry turning resistance", "against turning", "body", "N m", ("against",), _moment(-turn))
    yield Feature(
        "viscous turning resistance",
        "against turning, growing with its rate",
        "body",
        "N m s/rad",
        ("against",),
        _moment(-samples.spin),
    )


def _inertial(samples: Samples) -> Iterator[Feature]:
    a = samples.acceleration
    yield Feature("added mass", "against acceleration", "velocity", "kg", ("mass",), _force(-a[:, :2]))
    yield Feature("added inertia", "against angular acceleration", "body", "kg m^2", ("inertia",), _moment(-a[:, 2]))


def _placed(samples: Samples) -> Iterator[Feature]:
    middle = samples.place.mean(axis=0)
    yield Feature(
        "spring to a place",
        f"towards a place, growing with distance from ({middle[0]:.2f}, {middle[1]:.2f}) m",
        "world",
        "N/m",
        ("stiffness",),
        _force(middle - samples.place),
    )
    way = along_motion(samples)
    for axis, letter in enumerate("xy"):
        values = samples.place[:, axis]
        for border in np.unique(np.quantile(values, BORDERS).round(3)):
            beyond = (values > border).astype(float)
            if 0.1 < beyond.mean() < 0.9:
                yield Feature(
                    f"resistance where {letter} > {border:.2f} m",
                    f"against the direction of motion where {letter} > {border:.2f} m",
                    "world",
                    "N",
                    ("against",),
                    _force(-way * beyond[:, None]),
                )


def _timed(samples: Samples) -> Iterator[Feature]:
    one = np.ones(len(samples))
    x, y = np.outer(one, [1.0, 0.0]), np.outer(one, [0.0, 1.0])
    for moment in np.quantile(samples.time, BORDERS):
        after = (samples.time > moment).astype(float)[:, None]
        yield Feature(
            f"constant after {moment:.1f} s",
            f"in a fixed direction of the floor after {moment:.1f} s",
            "world",
            "N",
            ("x", "y"),
            _force(after * x, after * y),
        )
    step = max(0.5 / max(float(np.ptp(samples.time)), 1.0), FINEST)
    for frequency in np.arange(SLOWEST, FASTEST, step):
        wave = 2.0 * np.pi * frequency * samples.time
        c, s = np.cos(wave)[:, None], np.sin(wave)[:, None]
        yield Feature(
            f"rhythm of {frequency:.2f} Hz",
            f"in a rhythm of {frequency:.2f} Hz",
            "world",
            "N",
            ("x sin", "y sin", "x cos", "y cos"),
            _force(s * x, s * y, c * x, c * y),
        )
