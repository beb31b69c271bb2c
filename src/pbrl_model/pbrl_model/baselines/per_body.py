"""One pose-invariant regressor a body: from transitions to displacements in the body's frame and back (equation 20).

Every body has a model of its own, which knows the body's velocity, the wrench on it (zero where another is pushed) and
the duration, and nothing of where the body is or of the others (thesis section 5.2.2).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbrl_model.errors import ModelError
from pbrl_model.transitions.data import Transitions, body_features, checked_action, displaced

Array = NDArray[np.float64]


class Regressor(Protocol):
    """A function R^7 -> R^6 learned from examples."""

    def fit(self, features: Array, outputs: Array) -> Self:
        """Learn from features (n, 7) and outputs (n, 6), n >= 1."""
        ...

    def predict(self, features: Array) -> Array:
        """Return outputs (m, 6) for features (m, 7)."""
        ...


class PerBodyRegression:
    """A regressor for each body, trained on all transitions.

    Args:
        regressor: makes an untrained one.
    """

    def __init__(self, regressor: Callable[[], Regressor]) -> None:
        self._regressor = regressor
        self._models: list[Regressor] = []

    @property
    def models(self) -> list[Regressor]:
        """The trained regressors, one a body."""
        return self._models

    def fit(self, transitions: Transitions) -> Self:
        """Learn from transitions, from nothing; return self.

        Raises:
            ModelError: there are no transitions.
        """
        check_some(transitions)
        parts = (transitions.body(index) for index in range(transitions.bodies))
        self._models = [self._regressor().fit(part.features, part.displacements) for part in parts]
        return self

    def predict(self, state: ArrayLike, target: ArrayLike, wrench: ArrayLike, duration: ArrayLike) -> Array:
        """Predict the states after actions; see `checked_action` for the arguments.

        Returns:
            (n, K, 6) states of the centres of mass.

        Raises:
            ModelError: nothing has been learned, or of another number of bodies, or the arguments do not fit.
        """
        before, targets, pushes, seconds = checked_action(state, target, wrench, duration)
        check_bodies(len(self._models), before)
        after = np.empty_like(before)
        for index, model in enumerate(self._models):
            own = np.where((targets == index)[:, None], pushes, 0.0)
            outputs = model.predict(body_features(before[:, index], own, seconds))
            after[:, index] = displaced(before[:, index], outputs)
        return after


def check_some(transitions: Transitions) -> None:
    """Raise `ModelError` where there is nothing to learn from."""
    if not len(transitions):
        raise ModelError("baseline: expected at least one transition to learn from, got none")


def check_bodies(learned: int, state: Array) -> None:
    """Raise `ModelError` where a model of some bodies is asked about another number of them."""
    if not learned:
        raise ModelError("baseline: expected a fitted model, got one that has learned nothing; call fit first")
    if state.shape[1] != learned:
        raise ModelError(f"baseline: expected states of the {learned} bodies learned, got {state.shape[1]}")
