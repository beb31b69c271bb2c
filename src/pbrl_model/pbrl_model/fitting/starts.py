"""The mode finder: thousands of draws from the prior in a few kernel calls, the best distinct ones polished.

An open-loop likelihood is a needle: over long windows almost every start is lost. So the search begins with short
windows, in which every model is nearly right, and grows them as the fit improves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_model.errors import ModelError
from pbrl_model.fitting.guesses import guesses
from pbrl_model.fitting.likelihood import WindowedLikelihood
from pbrl_model.fitting.polish import Modes, polish
from pbrl_model.fitting.target import Target
from pbrl_model.sensing.motion import Motion
from pbrl_model.sensing.windows import shooting_windows
from pbrl_model.symmetry import wheel_features

Array = NDArray[np.float64]

FIRST_NOISE = (0.0, np.log(2.0), np.log(4.0))
"""Delay, ln sigma and ln drag while draws are compared: generous, for none of them is right yet."""
AGAIN = 8
"""Iterations of a climb that starts near its end."""
SCALE_DRAWS = 400
DISTINCT = 0.15
"""Positions nearer than this share of the prior's spread in every feature are one."""


@dataclass(frozen=True)
class SearchPlan:
    """How wide and how long to search.

    Attributes:
        draws: from the prior.
        keep: starts kept after each stage.
        lengths: windows' lengths of the stages before the last [s]; the last stage is the target's own windows.
        iterations: of the polish in each stage.
    """

    draws: int = 600
    keep: tuple[int, ...] = (20, 10, 5)
    lengths: tuple[float, ...] = (0.5, 1.0)
    iterations: tuple[int, ...] = (6, 8, 20)

    def __post_init__(self) -> None:
        if not len(self.keep) == len(self.iterations) == len(self.lengths) + 1:
            raise ModelError(f"search: expected {len(self.lengths) + 1} stages' `keep` and `iterations`, got {self}")


def distinct(features: Array, value: Array, spread: Array, count: int) -> NDArray[np.int64]:
    """Return the rows of the best positions that differ from one another.

    Args:
        features: (n, K) of the positions, see `wheel_features`: four descriptions of one wheel are one.
        value: (n,) log densities.
        spread: (K,) scale of each feature.
        count: at most so many.
    """
    kept: list[int] = []
    for row in np.argsort(-value, kind="stable"):
        if not np.isfinite(value[row]) or len(kept) == count:
            break
        scaled = np.abs(features[kept] - features[row]) / spread
        if not kept or np.all(np.any(scaled > DISTINCT, axis=1)):
            kept.append(int(row))
    return np.array(kept, dtype=np.int64)


def find_modes(rng: np.random.Generator, target: Target, motions: Sequence[Motion], plan: SearchPlan) -> Modes:
    """Search the prior's whole support for modes of the target.

    Args:
        rng: source of randomness.
        target: log density over its final windows.
        motions: that the windows were cut from, to cut shorter ones and to guess from; may be none where no stage has
            shorter windows.
        plan: effort.

    Returns:
        Distinct modes, best first.

    Raises:
        ModelError: no draw has a finite density.
    """
    names, body = target.names, target.likelihood.body
    draws = target.prior.sample(rng, plan.draws)
    apart = _apart(target, draws)

    def best(found: Array, value: Array, count: int) -> NDArray[np.int64]:
        return distinct(wheel_features(found[:, : len(names)], names), value, apart, count)

    physics = draws
    if motions:
        informed = guesses(names, motions, body.com, target.prior.sample(rng, max(plan.draws // 20, 8)))
        physics = np.concatenate([draws, _inside(target, informed)])
    position = np.concatenate([physics, np.tile(FIRST_NOISE, (len(physics), 1))], -1)
    shorter = [shooting_windows(motions, length) for length in plan.lengths]
    with_drag = target.likelihood.with_drag
    stages = [*(target.over(WindowedLikelihood(body, windows, with_drag=with_drag)) for windows in shorter), target]
    rows = best(position, stages[0].full_log_density(position, rounds=1), plan.keep[0])
    if len(rows) == 0:
        raise ModelError("search: expected a draw of the prior with finite density, got none; check the priors")
    position = position[rows]
    for stage, keep, iterations in zip(stages, plan.keep, plan.iterations, strict=True):
        modes = polish(stage, position[:keep], iterations=iterations)
        modes = modes.take(best(modes.point.position, modes.point.log_density, keep))
        position = modes.point.position
    return modes


def climb_again(rng: np.random.Generator, target: Target, modes: Modes) -> Modes:
    """Climb from modes of a target to those of another that is nearly the same, and merge what has become one."""
    apart = _apart(target, target.prior.sample(rng, SCALE_DRAWS))
    found = polish(target, modes.point.position, iterations=AGAIN)
    features = wheel_features(found.point.position[:, : len(target.names)], target.names)
    return found.take(distinct(features, found.point.log_density, apart, len(features)))


def _apart(target: Target, draws: Array) -> Array:
    """Return the prior's spread in the features that tell wheels apart (K,)."""
    return np.maximum(wheel_features(draws, target.names).std(axis=0), 1e-9)


def _inside(target: Target, physics: Array) -> Array:
    """Bring guesses into the prior's support, angles excepted."""
    lower, upper = target.prior.bounds
    periodic = target.prior.periodic
    return np.clip(physics, np.where(periodic, -np.inf, lower), np.where(periodic, np.inf, upper))
