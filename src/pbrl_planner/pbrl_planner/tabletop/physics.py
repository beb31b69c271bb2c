"""The world model as a forward model of pushes: friction under each item is learned, displacements follow from it.

Beside `LearnedDisplacements`, which has to see every push of every item several times, this needs a handful of pushes
an item, and knows then what pushes do that nobody has tried, of other lengths too (`pbrl_model.pushing`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pbrl_control.planar import Array
from pbrl_model.errors import ModelError
from pbrl_model.pushing import ObservedPush, PushPosterior, learn_pushes
from pbrl_planner.errors import PlannerError
from pbrl_planner.tabletop.desk import Item
from pbrl_planner.tabletop.displacement import Displacements
from pbrl_planner.tabletop.primitives import APPROACH, Push

GROWTH = 1.3
"""Factor by which what was observed of an item has to grow before it is learned from anew: it takes a second."""


class PhysicsDisplacements:
    """Displacements by pushes, by way of the friction under each item.

    Args:
        effector: radius of the ball [m].
        seed: of the inference.
        least: pushes of an item below which nothing is predicted.
    """

    def __init__(self, effector: float, *, seed: int, least: int = 3) -> None:
        self.least = least
        self._effector, self._seed = effector, seed
        self._observed: dict[str, list[tuple[Push, Array]]] = {}
        self._known: dict[str, tuple[int, PushPosterior]] = {}

    def count(self, name: str) -> int:
        """Return how many pushes of an item were observed."""
        return len(self._observed.get(name, ()))

    def update(self, name: str, push: Push, displacement: Array) -> None:
        """Take in what a push did to an item (3,) in its frame before.

        Raises:
            PlannerError: it is not finite.
        """
        value = np.asarray(displacement, dtype=float)
        if value.shape != (3,) or not np.isfinite(value).all():
            raise PlannerError(f"displacement: expected a finite (dx, dy, dtheta), got {displacement}")
        self._observed.setdefault(name, []).append((push, value))

    def posterior(self, item: Item) -> PushPosterior:
        """Return what is known of an item's friction, learned anew where enough was observed since.

        Raises:
            PlannerError: there were too few pushes, or they cannot be learned from.
        """
        seen = self._observed.get(item.name, [])
        if len(seen) < self.least:
            raise PlannerError(
                f"model of {item.name!r}: expected at least {self.least} pushes, got {len(seen)}; push it more often"
            )
        count, known = self._known.get(item.name, (0, None))
        if known is None or len(seen) >= GROWTH * count:
            pushes = [ObservedPush(push.path(item, self._effector, APPROACH), moved) for push, moved in seen]
            try:
                known = learn_pushes(np.random.default_rng(self._seed), item.half, self._effector, pushes)
            except ModelError as error:
                raise PlannerError(f"model of {item.name!r}: {error}") from error
            self._known[item.name] = (len(seen), known)
        return known

    def displacements(self, item: Item, pushes: Sequence[Push]) -> Displacements:
        """See `ForwardModel`.

        Raises:
            PlannerError: there were too few pushes of this item.
        """
        paths = [push.path(item, self._effector, APPROACH) for push in pushes]
        mean, spread = self.posterior(item).predict(paths)
        return Displacements(tuple(pushes), mean, spread)

    def as_dict(self) -> dict[str, list[dict[str, object]]]:
        """Return what was observed as plain data for a file: by item, a list of pushes with what they did."""
        return {
            name: [
                {"primitive": push.primitive, "travel": push.travel, "displacement": moved.tolist()}
                for push, moved in seen
            ]
            for name, seen in self._observed.items()
        }

    @classmethod
    def from_dict(
        cls, data: Mapping[str, Sequence[Mapping[str, object]]], effector: float, *, seed: int
    ) -> PhysicsDisplacements:
        """Return a model from what `as_dict` gave.

        Raises:
            PlannerError: a key is missing or a value makes no sense.
        """
        model = cls(effector, seed=seed)
        for name, rows in data.items():
            for row in rows:
                try:
                    push = Push(str(row["primitive"]), float(str(row["travel"])))
                    model.update(name, push, np.array(row["displacement"], dtype=float))
                except (KeyError, TypeError, ValueError) as error:
                    raise PlannerError(
                        f"model of {name!r}: expected primitive, travel and displacement, got {dict(row)}: {error}"
                    ) from error
        return model
