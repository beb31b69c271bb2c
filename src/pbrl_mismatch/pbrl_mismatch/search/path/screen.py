"""First guesses of an effect's parameters: draws of its prior whose motion is like the one that the model lacks.

Along the path every draw says what it would add to the poses. What changes of the ground's own parameters would explain
is taken out of both, as far as their priors let them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.effects.effect import Effect
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.search.hypothesis import Hypothesis
from pbrl_mismatch.search.path.ground import Ground

Array = NDArray[np.float64]

STRETCH = (0.02, 10.0)
"""A strength whose sign is known is solved for within these bounds, in units of its prior's centre."""


def screen(ground: Ground, hypothesis: Hypothesis, effect: Effect, coordinates: Array) -> tuple[Array, Array]:
    """Rank draws by how well they explain what is lacking.

    What an effect's wrench is proportional to is not drawn but solved for, given the rest of each draw (variable
    projection, Golub and Pereyra 1973).

    Args:
        ground: what lacks it.
        hypothesis: the ground with the effect.
        effect: that was added.
        coordinates: (n, K) draws; the ground's own coordinates as they are in the ground.

    Returns:
        The draws with their strengths adapted (n, K), and their misfits (n,), lower is better.
    """
    look = ground.fine if effect.remembers else ground.first
    own = look.slope
    inner = np.linalg.inv(own @ own.T + np.eye(len(own)))

    def rest(values: Array) -> Array:
        return values - (values @ own.T) @ inner @ own

    target = rest(look.still[None])[0]
    columns = hypothesis.columns
    linear = [columns.index(name) for name in effect.linear if name in columns]
    out = coordinates.copy()
    if not linear:
        changes = rest(look.still - look.residual(hypothesis.rows(coordinates)))
        misfit = np.sum((target - changes) ** 2, axis=1)
    else:
        parts = np.stack(
            [rest(look.still - look.residual(_alone(hypothesis, coordinates, linear, k))) for k in linear], 1
        )
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
