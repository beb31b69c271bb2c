"""A body that wanders about a room with a left-out wrench of noise, as moments; rows of a table's model."""

from __future__ import annotations

import numpy as np

from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_mismatch.unknown.samples import Samples

MASS = 20.0


def moments(rng: np.random.Generator, count: int, noise: float) -> Samples:
    """Return a body that wanders about a room, and a wrench of noise."""
    time = 0.4 * np.arange(count)
    rates, phases = rng.uniform(0.2, 0.9, (4, 1)), rng.uniform(0, 6, (4, 1))
    x, y, vx, vy = np.sin(rates * time + phases) * [[1.0], [0.8], [0.1], [0.1]]
    return Samples(
        time,
        np.stack([x, y], -1),
        np.sin(0.3 * time),
        np.stack([vx, vy], -1),
        0.1 * np.cos(0.3 * time),
        rng.normal(size=(count, 3)) * 0.1,
        rng.normal(size=(count, 3)) * noise * [1.0, 1.0, 0.4],
        np.tile(noise**2 * np.diag([1.0, 1.0, 0.16]), (count, 1, 1)),
        0.4,
    )


def table_row(**values: float) -> np.ndarray:
    """Return a row of a model of a table of 20 kg."""
    row = neutral_row()
    row[COLUMN["mass"]] = MASS
    for name, value in values.items():
        row[COLUMN[name]] = value
    return row
