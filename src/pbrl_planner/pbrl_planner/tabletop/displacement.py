"""Displacement models: how far each push moves each item, and how surely (thesis 3.1.2, equations 8 to 10).

A model is a table: one normal distribution of the displacement in the item's frame, a push and a coordinate. Printed
equation (9) weighs the old mean with n, which does not give a mean; here it is n - 1 (Welford 1962).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy import stats

from pbrl_control.planar import Array
from pbrl_planner.errors import PlannerError
from pbrl_planner.tabletop.desk import Item
from pbrl_planner.tabletop.primitives import Push

PRIOR_COUNT = 4
"""Pushes that what is known of all others' spread counts for, beside those of one kind."""
LEAST = 3
"""Pushes from which a spread can be told at all with some use."""


@dataclass(frozen=True)
class Displacements:
    """What the pushes do to one item: what the planner needs of any model.

    Attributes:
        pushes: p of them.
        mean: (p, 3) in the item's frame before the push [m, m, rad].
        spread: (p, 3) standard deviation of what is predicted, of the mean's own doubt too.
    """

    pushes: tuple[Push, ...]
    mean: Array
    spread: Array

    def __post_init__(self) -> None:
        shape = (len(self.pushes), 3)
        for name in ("mean", "spread"):
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape != shape or not np.isfinite(value).all():
                raise PlannerError(f"displacements: expected finite {name} {shape}, got shape {value.shape}")
        if (np.asarray(self.spread) < 0.0).any():
            raise PlannerError("displacements: expected spreads of at least zero")


class ForwardModel(Protocol):
    """Predicts what pushes do: learned from pushes, or by a physics engine."""

    def displacements(self, item: Item, pushes: Sequence[Push]) -> Displacements:
        """Return what these pushes do to an item.

        Raises:
            PlannerError: it cannot say, and why.
        """
        ...

    def update(self, name: str, push: Push, displacement: Array) -> None:
        """Take in what a push did to an item (3,) in its frame before."""
        ...


class PushStatistics:
    """Mean and spread of the displacements by one push, kept while they are observed.

    Attributes:
        count: pushes so far.
        mean: (3,) of them, equation (9).
    """

    def __init__(self) -> None:
        self.count = 0
        self.mean: Array = np.zeros(3)
        self._squares: Array = np.zeros(3)

    def update(self, displacement: Array) -> None:
        """Take in one more displacement (3,) in the item's frame (UPDATEDISTR of figure 1).

        Raises:
            PlannerError: it is not finite.
        """
        value = np.asarray(displacement, dtype=float)
        if value.shape != (3,) or not np.isfinite(value).all():
            raise PlannerError(f"displacement: expected a finite (dx, dy, dtheta), got {displacement}")
        self.count += 1
        before = value - self.mean
        self.mean = self.mean + before / self.count
        self._squares = self._squares + before * (value - self.mean)

    @property
    def variance(self) -> Array:
        """Of the displacements (3,): equation (10), with n - 1 below so that it is not too small for few."""
        if self.count < 2:
            return np.full(3, np.inf)
        return np.asarray(self._squares / (self.count - 1))

    @property
    def error(self) -> Array:
        """Standard deviation of the mean itself (3,): what more pushes make smaller."""
        return np.asarray(np.sqrt(self.variance / max(self.count, 1)))

    @property
    def spread(self) -> Array:
        """Standard deviation of the next displacement (3,), the mean's doubt in it."""
        return np.asarray(np.sqrt(self.variance * (1.0 + 1.0 / max(self.count, 1))))

    def interval(self, share: float = 0.95, prior: Array | None = None) -> Array:
        """Return the range (2, 3) in which the next displacement lies with a probability: Student's t.

        Args:
            share: the probability.
            prior: (3,) variance that such pushes have as a rule; it counts as `PRIOR_COUNT` pushes, so that few which
                were by luck all alike are not taken for certain (Smyth 2004). None: there is none.

        Raises:
            PlannerError: there were fewer than two pushes, or the share is no probability.
        """
        if not 0.0 < share < 1.0 or self.count < 2:
            raise PlannerError(f"interval: expected a share in (0, 1) and two pushes, got {share} and {self.count}")
        freedom, variance = self.count - 1, self.variance
        if prior is not None:
            variance = (PRIOR_COUNT * prior + freedom * variance) / (PRIOR_COUNT + freedom)
            freedom += PRIOR_COUNT
        half = stats.t.ppf(0.5 + share / 2.0, freedom) * np.sqrt(variance * (1.0 + 1.0 / self.count))
        return np.array([self.mean - half, self.mean + half])


class LearnedDisplacements:
    """Displacement models of all items: the thesis's forward model."""

    def __init__(self, least: int = LEAST, floor: Sequence[float] = (0.001, 0.001, 0.005)) -> None:
        """Begin without any knowledge.

        Args:
            least: pushes below which nothing is predicted.
            floor: (3,) least spread that is believed: few pushes may by luck be all alike [m, m, rad].
        """
        self._least, self._floor = least, np.asarray(floor, dtype=float)
        self._statistics: dict[tuple[str, Push], PushStatistics] = {}

    def of(self, name: str, push: Push) -> PushStatistics:
        """Return what is known of one push of one item; empty statistics where nothing is."""
        return self._statistics.setdefault((name, push), PushStatistics())

    def interval(self, name: str, push: Push, share: float = 0.95) -> Array:
        """Return the range (2, 3) in which the next displacement by a push lies with a probability.

        Raises:
            PlannerError: the push was made fewer than twice, or the share is no probability.
        """
        known = [each.variance for _, _, each in self.known() if each.count >= 2]
        return self.of(name, push).interval(share, np.mean(known, axis=0) if known else None)

    def update(self, name: str, push: Push, displacement: Array) -> None:
        """Take in what a push did to an item (3,)."""
        self.of(name, push).update(displacement)

    def known(self) -> Iterator[tuple[str, Push, PushStatistics]]:
        """Go through everything that was observed."""
        return ((name, push, each) for (name, push), each in self._statistics.items() if each.count)

    def displacements(self, item: Item, pushes: Sequence[Push]) -> Displacements:
        """See `ForwardModel`.

        Raises:
            PlannerError: a push was observed too seldom; the first such is named.
        """
        found = [self.of(item.name, push) for push in pushes]
        for push, each in zip(pushes, found, strict=True):
            if each.count < self._least:
                raise PlannerError(
                    f"model of {item.name!r}: expected {self._least} pushes {push.primitive} by {push.travel:g} m, "
                    f"got {each.count}; push it more often, or plan without that push"
                )
        mean = np.array([each.mean for each in found])
        return Displacements(tuple(pushes), mean, np.array([np.maximum(each.spread, self._floor) for each in found]))

    def as_dict(self) -> dict[str, list[dict[str, object]]]:
        """Return it as plain data for a file: by item, a list of pushes with what they did."""
        found: dict[str, list[dict[str, object]]] = {}
        for name, push, each in self.known():
            found.setdefault(name, []).append(
                {
                    "primitive": push.primitive,
                    "travel": push.travel,
                    "count": each.count,
                    "mean": each.mean.tolist(),
                    "variance": each.variance.tolist() if each.count > 1 else None,
                }
            )
        return found

    @classmethod
    def from_dict(cls, data: Mapping[str, Sequence[Mapping[str, object]]]) -> LearnedDisplacements:
        """Return a model from what `as_dict` gave.

        Raises:
            PlannerError: a key is missing or a value makes no sense.
        """
        model = cls()
        for name, rows in data.items():
            for row in rows:
                try:
                    each = PushStatistics()
                    each.count = int(str(row["count"]))
                    each.mean = np.array(row["mean"], dtype=float)
                    variance = row["variance"]
                    each._squares = np.zeros(3) if variance is None else np.array(variance, float) * (each.count - 1)
                    push = Push(str(row["primitive"]), float(str(row["travel"])))
                except (KeyError, TypeError, ValueError, OverflowError) as error:
                    raise PlannerError(
                        f"model of {name!r}: expected primitive, travel, count, mean and variance, "
                        f"got {dict(row)}: {error}"
                    ) from error
                model._statistics[(name, push)] = each
        return model
