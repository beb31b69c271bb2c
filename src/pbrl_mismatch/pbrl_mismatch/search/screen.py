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

STRIDE = 8
"""Steps between the moments that are compared."""
STRETCH = (0.02, 10.0)
"""A strength whose sign is known is solved for within these bounds, in units of its prior's centre."""


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

    What an effect's wrench is proportional to is not drawn but solved for, given the rest of each draw (variable
    projection, Golub and Pereyra 1973).

    Args:
        lacking: the residual under the baseline.
        hypothesis: the baseline with the effect.
        effect: that was added.
        coordinates: (n, K) draws; the baseline's own coordinates as they are in the baseline.

    Returns:
        The draws with their strengths adapted (n, K), and their misfits (n,), lower is better.
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
    # What the baseline's parameters could do is taken out, as far as their priors let them.
    inner = np.linalg.inv(own @ own.T + np.eye(len(own)))

    def rest(values: Array) -> Array:
        return values - (values @ own.T) @ inner @ own

    target = rest(target[None])[0]
    columns = hypothesis.columns
    linear = [columns.index(name) for name in effect.linear if name in columns]
    out = coordinates.copy()
    if not linear:
        changes = rest(felt(hypothesis.rows(coordinates)) - start)
        misfit = np.sum((target - changes) ** 2, axis=1)
    else:
        parts = np.stack([rest(felt(_alone(hypothesis, coordinates, linear, k)) - start) for k in linear], 1)
        strength = _strengths(parts, target, np.array([hypothesis.parameters[k].positive for k in linear]))
        misfit = np.sum((target - np.einsum("nl,nlt->nt", strength, parts)) ** 2, axis=1)
        for index, k in enumerate(linear):
            parameter = hypothesis.parameters[k]
            size = strength[:, index]
            out[:, k] = parameter.mean + np.log(size) if parameter.positive else parameter.spread * size
    outside = np.sum(((out - hypothesis.mean) / hypothesis.spread) ** 2, axis=1)
    return out, misfit + outside


def _alone(hypothesis: Hypothesis, coordinates: Array, linear: list[int], one: int) -> Array:
    """Return parameter rows of draws in which one strength has its unit, the prior's own, and the others are off."""
    rows = hypothesis.rows(coordinates)
    for k in linear:
        parameter = hypothesis.parameters[k]
        unit = parameter.centre if parameter.positive else parameter.spread
        rows[:, COLUMN[parameter.column]] = unit if k == one else 0.0
    return rows


def _strengths(parts: Array, target: Array, positive: NDArray[np.bool_]) -> Array:
    """Return how much of each part (n, L, T) explains a target (T,), in units (n, L); some only within `STRETCH`."""
    matrix = parts @ np.swapaxes(parts, -1, -2)
    along = parts @ target
    # A prior of one unit about none, or about one where the sign is known, keeps what is not seen small.
    centre = positive.astype(float)
    found = np.linalg.solve(matrix + np.eye(len(positive)), (along + centre)[..., None])[..., 0]
    return np.where(positive, np.clip(found, *STRETCH), found)
