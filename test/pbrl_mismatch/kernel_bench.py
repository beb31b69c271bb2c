"""A table on a known push, for the kernel alone."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from pushed_table import FEET, GYRATION, MASS, TABLE, Array

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.data.simulation import poses
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.kernels.columns import COLUMN, neutral_row

DT = 0.01
"""Of a step [s]."""


def pushed(force: float, steps: int = 200) -> Array:
    """Return a steady push along x."""
    return np.tile([force, 0.0, 0.0], (steps, 1))


def moving(speed: float, omega: float = 0.0) -> Array:
    """Return a state that goes along x and turns."""
    return np.array([0.0, 0.0, 0.0, speed, 0.0, omega])


def speeds(path: Array) -> Array:
    """Return how fast poses (T, 3) go from each to the next."""
    return np.diff(path, axis=0) / DT


@dataclass(frozen=True)
class Bench:
    """A table of 20 kg on a known push, for the kernel alone: a pose at every step.

    Attributes:
        wrench: (T, 3) at the nominal centre of mass in world axes [N, N, N m].
        start: (6,) state.
        dt: [s].
        heading: (T,) recorded heading, which only sensors' faults look at [rad]; None: zero.
    """

    wrench: Array
    start: Array = field(default_factory=lambda: np.zeros(6))
    dt: float = DT
    heading: Array | None = None

    def cuts(self) -> Cuts:
        count = len(self.wrench)
        seen = np.tile(self.start, (count, 1)).astype(float)
        if self.heading is not None:
            seen[:, 2] = self.heading
        track = Track(
            object="table",
            motions=(),
            felt=np.ascontiguousarray(self.wrench, dtype=float),
            mount=np.column_stack([np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)), self.dt * np.arange(count)]),
            seen=seen,
            clock=self.dt * np.arange(count),
            begin=np.array([0]),
            last=np.array([count - 1]),
            pivot=self.start[None, :3].astype(float),
            body=np.array([GYRATION**2, 0.0, 0.0, self.dt]),
            outline=TABLE,
            feet=FEET,
            nominal_mass=MASS,
        )
        place = np.arange(count + 1, dtype=float)[None]
        shape = (1, count + 1, 3)
        span = np.array([[0, count, 0, count - 1]])
        told, root = self.start[None].astype(float), np.zeros((1, 6, 6))
        return Cuts(track, span, track.pivot, place, told, root, np.zeros(shape), np.ones(shape), np.zeros(1))

    def run(self, **values: float) -> Array:
        """Return poses (T + 1, 3) of a table whose columns have these values, all others off."""
        row = neutral_row()
        row[COLUMN["mass"]] = MASS
        for name, value in values.items():
            row[COLUMN[name]] = value
        return poses(row[None], self.cuts())[0, 0]
