"""How well a learned model predicts transitions: the three learners of thesis figures 24 and 26, and their score.

Scored is R^2 of the displacement in the frame of the body at the transition's start (equation 20), the mean over the
six outputs, each against its own variance: a state after that is near the state before earns nothing, and no output
hides behind another of larger numbers.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import BodyGeometry
from pbrl_bringup.experiments.household import HouseholdObject, gather
from pbrl_model.baselines.linear import LinearRegressor
from pbrl_model.baselines.local import LocalRegressor
from pbrl_model.transitions.data import BodyTransitions, displaced, displacements, observed
from pbrl_model.transitions.model import LearnOptions, TransitionPosterior, learn_body

Array = NDArray[np.float64]

TEST_SAMPLES = 200
METHODS = ("PBR", "LWR", "LR")
COLOURS = {"PBR": "#1f6fb4", "LWR": "#d9822b", "LR": "#8a8a8a"}
NOISE_UNIT = 0.01  # [m] the thesis's noise is a bare number; its lengths are taken to be centimetres

Predict = Callable[[BodyTransitions], Array]
"""From transitions, whose ends are not looked at, to the states (n, 6) at their ends."""


def r_squared(test: BodyTransitions, end: Array) -> float:
    """Return the mean over the six outputs of R^2 of predicted ends (n, 6)."""
    true, predicted = test.displacements, displacements(test.start, end)
    error = true - predicted
    error[:, 2] -= 2.0 * np.pi * np.round(error[:, 2] / (2.0 * np.pi))
    spread = ((true - true.mean(axis=0)) ** 2).sum(axis=0)
    return float(np.mean(1.0 - (error**2).sum(axis=0) / spread))


def learn_linear(data: BodyTransitions) -> Predict:
    """Learn a linear regression."""
    model = LinearRegressor().fit(data.features, data.displacements)
    return lambda test: displaced(test.start, model.predict(test.features))


def learn_local(data: BodyTransitions) -> Predict:
    """Learn a locally weighted regression, bandwidth chosen by leaving one out (thesis section 5.5.1)."""
    model = LocalRegressor(bandwidth=None).fit(data.features, data.displacements)
    return lambda test: displaced(test.start, model.predict(test.features))


def learn_physics(
    rng: np.random.Generator, data: BodyTransitions, geometry: BodyGeometry, before: TransitionPosterior | None = None
) -> TransitionPosterior:
    """Learn the physics, every class of model; go on from an earlier posterior if there is one."""
    return learn_body(rng, data, geometry, LearnOptions(parallel=False), before)


def predicted(posterior: TransitionPosterior, test: BodyTransitions) -> Array:
    """Return the expected states (n, 6) at the ends of transitions."""
    return posterior.predict(test.start, test.wrench, test.duration)


def training_and_test(
    rng: np.random.Generator, thing: HouseholdObject, n: int, noise: float, *, of_start: bool = False
) -> tuple[BodyTransitions, BodyTransitions]:
    """Gather n noisy transitions to learn from and `TEST_SAMPLES` without noise, by the same procedure.

    Args:
        rng: source of pushes and noise.
        thing: the object.
        n: transitions to learn from.
        noise: sigma [m, m/s] of the states after; see `observed`.
        of_start: whether states before are noisy too.
    """
    clean, test = gather(rng, thing, n), gather(rng, thing, TEST_SAMPLES)
    return observed(rng, clean, noise, [thing.radius_of_gyration], of_start=of_start).body(0), test.body(0)
