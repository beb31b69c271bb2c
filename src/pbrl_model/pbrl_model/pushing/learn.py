"""Learn how a box on a table gives way to pushes, from few of them: the world model's answer to displacement tables.

    known = learn_pushes(rng, half, ball, [ObservedPush(path, moved), ...])
    mean, spread = known.predict(paths)

A table of displacements (thesis 3.1.2) says nothing of a push that was not tried. Where the box's friction acts and how
far it reaches is the same for all pushes, so that one tells of the others.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_model.errors import ModelError
from pbrl_model.inference.infer import Inference, InferenceOptions, infer
from pbrl_model.pushing.kernel import push_many
from pbrl_model.rollout import KERNEL_LOCK

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

NAMES = ("centre_x", "centre_y", "log_radius", "contact_friction", "log_scale")
NOISE = (0.002, 0.002, 0.02)
"""Spread of a displacement at scale 1 [m, m, rad]: what cameras see badly and tables are uneven."""
CENTRE_SD = 0.2
"""Of the prior of where friction acts, as a share of half of each side."""
RADIUS_SD = 0.4
"""Of the prior of the logarithm of the radius, about that of even pressure."""
SCALE_SD = 1.0
EVEN = 0.95
"""Radius of the ellipsoid that fits even pressure best over the radius of gyration (0.93 to 0.97, by the sides)."""
MOST_FRICTION = 1.0


@dataclass(frozen=True)
class ObservedPush:
    """One push and what it did.

    Attributes:
        path: (2, 2) where the ball's middle began and ended, in the box's frame as it was before [m].
        moved: (3,) how the box's frame moved, in itself as it was before [m, m, rad].
    """

    path: Array
    moved: Array


class PushProblem:
    """The posterior of a box's friction, given pushes; see `inference.problem.Problem`."""

    def __init__(self, half: Array, ball: float, pushes: Sequence[ObservedPush]) -> None:
        """Take in what was observed.

        Args:
            half: (2,) half of the box's sides [m].
            ball: radius of the ball [m].
            pushes: at least one.

        Raises:
            ModelError: there is none, or one is not finite.
        """
        self._half, self._ball = np.asarray(half, dtype=float), float(ball)
        self._paths = _paths([push.path for push in pushes])
        self._moved = np.array([push.moved for push in pushes], dtype=float).reshape(-1, 3)
        if not len(pushes) or not np.isfinite(self._moved).all():
            raise ModelError(f"pushes: expected at least one, all finite, got {len(pushes)}")
        even = EVEN * float(np.hypot(*(2.0 * self._half))) / math.sqrt(12.0)
        self._middle = np.array([0.0, 0.0, math.log(even), 0.0, 0.0])
        self._sd = np.array([*(CENTRE_SD * self._half), RADIUS_SD, 1.0, SCALE_SD])
        wide = 4.0 * self._sd
        self._bounds = np.array([self._middle - wide, self._middle + wide])
        self._bounds[:, 3] = 0.0, MOST_FRICTION

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return NAMES

    @property
    def bounds(self) -> Array:
        """(2, 5) ends of the prior's support."""
        return self._bounds

    @property
    def periodic(self) -> Flags:
        """(5,) none is."""
        return np.zeros(len(NAMES), dtype=bool)

    @property
    def noise_column(self) -> int | None:
        """The last: ln s."""
        return len(NAMES) - 1

    def sample_prior(self, rng: np.random.Generator, n: int) -> Array:
        """Draw (n, 5)."""
        theta = np.empty((0, len(NAMES)))
        while len(theta) < n:
            drawn = self._middle + self._sd * rng.normal(size=(n, len(NAMES)))
            drawn[:, 3] = rng.uniform(0.0, MOST_FRICTION, n)
            inside = ((drawn >= self._bounds[0]) & (drawn <= self._bounds[1])).all(axis=1)
            theta = np.concatenate((theta, drawn[inside]))
        return theta[:n]

    def log_prior(self, theta: Array) -> Array:
        """Return (P,) log densities, those of the cut tails left out of the norm (1 in 10 000)."""
        away = (theta - self._middle) / self._sd
        away[:, 3] = 0.0
        norm = np.log(self._sd * math.sqrt(2.0 * math.pi))
        norm[3] = math.log(MOST_FRICTION)
        inside = ((theta >= self._bounds[0]) & (theta <= self._bounds[1])).all(axis=1)
        return np.where(inside, -0.5 * (away**2).sum(axis=1) - norm.sum(), -np.inf)

    def log_likelihood(self, theta: Array) -> Array:
        """Return (P,)."""
        residuals = self.residuals(theta)
        count, scale = residuals.shape[1], theta[:, 4]
        norm = len(self._moved) * np.log(NOISE).sum() + 0.5 * count * math.log(2.0 * math.pi)
        return np.asarray(-0.5 * (residuals**2).sum(axis=1) * np.exp(-2.0 * scale) - count * scale - norm)

    def residuals(self, theta: Array, share: float = 1.0) -> Array:
        """Return (P, 3 pushes): over the noise at scale 1, of a share of the pushes."""
        count = max(round(share * len(self._moved)), 1)
        moved = predicted(theta, self._half, self._ball, self._paths[:count])
        return np.asarray(((self._moved[:count] - moved) / NOISE).reshape(len(theta), -1))

    def images(self, theta: Array) -> Array:
        """Return (1, P, 5): there is no other description."""
        return np.asarray(theta)[None]


@dataclass(frozen=True)
class PushPosterior:
    """What is known of a box after some pushes.

    Attributes:
        half: (2,) half of its sides [m].
        ball: radius of the ball [m].
        draws: (n, 5) of `NAMES`, of equal weight.
        inference: how they were found.
    """

    half: Array
    ball: float
    draws: Array
    inference: Inference

    def predict(self, paths: Sequence[Array], count: int = 200) -> tuple[Array, Array]:
        """Return mean and standard deviation (p, 3) of the displacements by pushes along paths (2, 2) in its frame."""
        rows = self.draws[:count]
        moved = predicted(rows, self.half, self.ball, _paths(paths))
        noise = np.mean(np.exp(2.0 * rows[:, 4])) * np.array(NOISE) ** 2
        return moved.mean(axis=0), np.sqrt(moved.var(axis=0) + noise)


def predicted(theta: Array, half: Array, ball: float, paths: Array) -> Array:
    """Return displacements (P, p, 3) of a box by pushes along paths (p, 4), for rows (P, 5) of `NAMES`."""
    rows = np.column_stack((theta[:, :2], np.exp(theta[:, 2]), theta[:, 3]))
    out = np.empty((len(rows), len(paths), 3))
    with KERNEL_LOCK:
        push_many(rows, np.ascontiguousarray(half), ball, paths, out)
    return out


def learn_pushes(
    rng: np.random.Generator,
    half: Array,
    ball: float,
    pushes: Sequence[ObservedPush],
    options: InferenceOptions | None = None,
) -> PushPosterior:
    """Find the posterior of a box's friction from pushes.

    Args:
        rng: source of randomness.
        half: (2,) half of the box's sides [m].
        ball: radius of the ball [m].
        pushes: that were observed.
        options: of the inference; None: modest ones.

    Raises:
        ModelError: there is no push, or one is not finite.
    """
    problem = PushProblem(half, ball, pushes)
    found = infer(rng, problem, options or InferenceOptions.modest())
    return PushPosterior(np.asarray(half, dtype=float), float(ball), found.draws, found)


def _paths(paths: Sequence[Array]) -> Array:
    """Return paths (p, 4) in one array.

    Raises:
        ModelError: one is not (2, 2), or not finite.
    """
    rows = [np.asarray(path, dtype=float) for path in paths]
    for row in rows:
        if row.shape != (2, 2) or not np.isfinite(row).all():
            raise ModelError(f"push: expected a finite path (2, 2), got {row.tolist()}")
    return np.array(rows).reshape(-1, 4)
