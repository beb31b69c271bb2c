"""Object-oriented regression (thesis section 5.2.3, "OO-LWR"): one local model a body for each condition of contact.

A condition is the boolean string of all contact predicates of all bodies. Examples and queries of one condition share
a model. **A condition that was never seen has no model**: what is predicted then is what the body does over all
conditions together (a plain LWR of all its examples), which knows no contact and will walk it through a wall until
that wall has been met; `seen` tells where that is so.
"""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbrl_model.baselines.local import BANDWIDTH, NEIGHBOURS, LocalRegressor
from pbrl_model.baselines.per_body import check_bodies, check_some
from pbrl_model.baselines.sectors import ContactSectors
from pbrl_model.errors import ModelError
from pbrl_model.transitions.data import Transitions, body_features, checked_action, concatenate, displaced

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]


class ObjectOrientedRegression:
    """Locally weighted regression by condition of contact.

    Args:
        sectors: the contact predicates.
        neighbours: k of each local model.
        bandwidth: lambda of each local model; None: learned, see `LocalRegressor`.
    """

    def __init__(
        self, sectors: ContactSectors, neighbours: int = NEIGHBOURS, bandwidth: float | None = BANDWIDTH
    ) -> None:
        LocalRegressor(neighbours, bandwidth)
        self._sectors = sectors
        self._options = neighbours, bandwidth
        self._transitions: Transitions | None = None
        self._conditions = np.empty((0, sectors.bodies * sectors.sectors), dtype=bool)
        self._models: dict[bytes, list[LocalRegressor]] = {}
        self._anywhere: list[LocalRegressor] = []

    @property
    def conditions(self) -> int:
        """How many different conditions have been seen."""
        return len(self._models)

    def fit(self, transitions: Transitions) -> Self:
        """Learn from transitions, from nothing; return self.

        Raises:
            ModelError: there are no transitions, or they are of other bodies than the sectors.
        """
        self._transitions, self._models = None, {}
        self._conditions = self._conditions[:0]
        return self.extend(transitions)

    def extend(self, transitions: Transitions) -> Self:
        """Learn from more transitions of the same bodies; only the conditions that they are of are fitted anew."""
        check_some(transitions)
        if transitions.bodies != self._sectors.bodies:
            raise ModelError(f"OO-LWR: expected transitions of {self._sectors.bodies} bodies, got {transitions.bodies}")
        new = self._sectors.conditions(transitions.state)
        known = transitions if self._transitions is None else concatenate([self._transitions, transitions])
        self._transitions, self._conditions = known, np.concatenate([self._conditions, new])
        self._anywhere = self._fitted(known)
        for condition in np.unique(new, axis=0):
            self._models[condition.tobytes()] = self._fitted(known[(self._conditions == condition).all(axis=1)])
        return self

    def seen(self, state: ArrayLike) -> Bools:
        """Return (n,) whether the condition of states (n, K, 6) has a model of its own."""
        conditions = self._sectors.conditions(np.asarray(state, dtype=float))
        return np.array([condition.tobytes() in self._models for condition in conditions], dtype=bool)

    def predict(self, state: ArrayLike, target: ArrayLike, wrench: ArrayLike, duration: ArrayLike) -> Array:
        """Predict the states after actions; see `checked_action` for the arguments.

        Returns:
            (n, K, 6) states of the centres of mass; where the condition was never seen, as if conditions were not told
            apart.

        Raises:
            ModelError: nothing has been learned, or of another number of bodies, or the arguments do not fit.
        """
        before, targets, pushes, seconds = checked_action(state, target, wrench, duration)
        check_bodies(len(self._anywhere), before)
        after = np.empty_like(before)
        kinds, member = np.unique(self._sectors.conditions(before), axis=0, return_inverse=True)
        for number, condition in enumerate(kinds):
            rows = np.flatnonzero(member.ravel() == number)
            models = self._models.get(condition.tobytes(), self._anywhere)
            for index, model in enumerate(models):
                start = before[rows, index]
                own = np.where((targets[rows] == index)[:, None], pushes[rows], 0.0)
                after[rows, index] = displaced(start, model.predict(body_features(start, own, seconds[rows])))
        return after

    def _fitted(self, transitions: Transitions) -> list[LocalRegressor]:
        parts = (transitions.body(index) for index in range(transitions.bodies))
        return [LocalRegressor(*self._options).fit(part.features, part.displacements) for part in parts]
