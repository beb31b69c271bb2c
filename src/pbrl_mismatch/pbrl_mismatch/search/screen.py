"""First guesses of an effect's parameters: draws of its prior whose wrench is like the one that the model lacks.

Along the smoothed motion every draw says what it would add to the baseline's acceleration; the unknown-input smoother
says what is lacking, and how surely. What changes of the baseline's own parameters would explain is taken out of both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.residual import ResidualWrench, accelerations
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.effects.effect import Effect
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.search.hypothesis import Hypothesis, step_sizes

Array = NDArray[np.float64]

STRIDE = 5
"""Steps between the moments that are compared."""
STRETCH = (0.1, 6.0)
"""A draw's strength is changed by at most this much to fit."""


@dataclass(frozen=True)
class Lacking:
    """What a baseline lacks along the motion, in whitened numbers.

    Attributes:
        track: what was recorded.
        baseline: the hypothesis.
        coordinates: (K,) of the baseline.
        residual: of the smoother under it.
    """

    track: Track
    baseline: Hypothesis
    coordinates: Array
    residual: ResidualWrench

    def compared(self, stride: int) -> tuple[Array, Array, Array]:
        """Return rows that are compared, the lacking wrench (n, 3) and its whitening (n, 3, 3)."""
        rows = np.concatenate(
            [np.arange(b, e + 1, stride) for b, e in zip(self.track.begin, self.track.last, strict=True)]
        )
        spread = self.residual.covariance[rows]
        floor = (0.05 * self.residual.size + 0.02) ** 2 * np.diag([1.0, 1.0, self.track.body[0]])
        return rows, self.residual.world[rows], np.linalg.inv(np.linalg.cholesky(spread + floor))


def screen(lacking: Lacking, hypothesis: Hypothesis, effect: Effect, coordinates: Array) -> tuple[Array, Array]:
    """Rank draws by how well they explain what is lacking.

    Args:
        lacking: the residual under the baseline.
        hypothesis: the baseline with the effect.
        effect: that was added.
        coordinates: (n, K) draws; the baseline's own coordinates as they are in the baseline.

    Returns:
        The draws with their strength adapted (n, K), and their misfits (n,), lower is better.
    """
    stride = 1 if effect.remembers else STRIDE
    track = lacking.track
    base = lacking.baseline.rows(lacking.coordinates[None])
    weight = np.array([base[0, COLUMN["mass"]]] * 2 + [base[0, COLUMN["mass"]] * track.body[0]])
    steps = step_sizes(lacking.baseline)
    moved = np.repeat(lacking.coordinates[None], len(steps), 0) + np.diag(steps)
    path = lacking.residual.state
    rows, wanted, whiten = lacking.compared(stride)

    def felt(models: Array) -> Array:
        push = accelerations(track, models, path, stride)[:, : len(rows)] * weight
        return np.einsum("nij,pnj->pni", whiten, np.clip(np.nan_to_num(push), -1e6, 1e6)).reshape(len(models), -1)

    start = felt(base)
    own = (felt(lacking.baseline.rows(moved)) - start) / steps[:, None] * lacking.baseline.spread[:, None]
    target = np.einsum("nij,nj->ni", whiten, wanted).reshape(-1)
    changes = felt(hypothesis.rows(coordinates)) - start
    # What the baseline's parameters could do is taken out, as far as their priors let them.
    inner = np.linalg.inv(own @ own.T + np.eye(len(own)))

    def rest(values: Array) -> Array:
        return values - (values @ own.T) @ inner @ own

    target, changes = rest(target[None])[0], rest(changes)
    power, along = np.sum(changes**2, axis=1) + 1e-9, changes @ target
    out = coordinates.copy()
    stretch = np.ones(len(coordinates))
    columns = hypothesis.columns
    linear = [columns.index(name) for name in effect.linear if name in columns]
    if linear:
        both = all(not hypothesis.parameters[k].positive for k in linear)
        raw = along / power
        stretch = np.sign(raw) * np.clip(np.abs(raw), *STRETCH) if both else np.clip(raw, *STRETCH)
        for k in linear:
            is_log = hypothesis.parameters[k].positive
            out[:, k] = out[:, k] + np.log(np.abs(stretch)) if is_log else out[:, k] * stretch
    misfit = np.sum(target**2) - 2.0 * stretch * along + stretch**2 * power
    outside = np.sum(((out - hypothesis.mean) / hypothesis.spread) ** 2, axis=1)
    return out, misfit + outside
