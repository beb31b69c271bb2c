"""Settings of the learner on transitions: classes, priors, noise, effort."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from pbrl_model.errors import ModelError
from pbrl_model.inference.infer import InferenceOptions
from pbrl_model.inference.modes import SearchOptions
from pbrl_model.inference.population import WalkOptions
from pbrl_model.prior_options import FrictionOptions, PriorOptions
from pbrl_model.transitions.classes import CLASSES, NoisePrior


def brief_inference() -> InferenceOptions:
    """Return the effort by which classes are screened: transitions are short, their horizon need not grow."""
    search = SearchOptions(screen=128, starts=16, shares=(1.0,), iterations=15, waves=2, hits=2, most=4)
    return replace(
        InferenceOptions.modest(), search=search, draws=800, rounds=2, equal_draws=400, attempts=1, check_moves=0
    )


def thorough_inference() -> InferenceOptions:
    """Return the effort for a class that matters and that screening has not settled."""
    return replace(
        InferenceOptions.modest(),
        search=SearchOptions(screen=192, starts=24, shares=(1.0,), iterations=20, waves=3, hits=2, most=6),
        walk=WalkOptions(walkers=64, moves=3, settle=10, remember=24, components=4),
        draws=2000,
        learning_draws=600,
        equal_draws=400,
        max_calls=20_000,
    )


FLAT_FRICTION = FrictionOptions(mean=0.5, sd=100.0)
"""Friction coefficients that are uniform on [0, 1] for all practical purposes.

Nothing is known of them before, and a wheel that never slipped leaves its coefficient anywhere above what it had to
hold: a prior that slopes there would draw the optimum to the very edge of that plateau.
"""


@dataclass(frozen=True)
class LearnOptions:
    """What is learned and how hard.

    Attributes:
        classes: of `CLASSES`, each with the same prior probability.
        ground: whether friction of the whole body on the floor is learned too.
        dt: step of the simulations [s].
        draws: kept of the posterior.
        priors: settings of table 2; where they say nothing of friction it is `FLAT_FRICTION`.
        noise: prior of the object's noise.
        screening: effort for every class at first.
        inference: effort for classes that are not settled then and may matter.
        parallel: False from callers that are parallel themselves.
    """

    classes: tuple[str, ...] = CLASSES
    ground: bool = False
    dt: float = 0.01
    draws: int = 200
    priors: PriorOptions = field(default_factory=PriorOptions)
    noise: NoisePrior = field(default_factory=NoisePrior)
    screening: InferenceOptions = field(default_factory=brief_inference)
    inference: InferenceOptions = field(default_factory=thorough_inference)
    parallel: bool = True

    def __post_init__(self) -> None:
        if not self.classes or len(set(self.classes)) != len(self.classes):
            raise ModelError(f"learn: expected classes, each once, got {self.classes}")
        if self.draws < 1 or not (math.isfinite(self.dt) and self.dt > 0.0):
            raise ModelError(f"learn: expected draws >= 1 and dt above zero [s], got {self.draws} and {self.dt!r}")
        if "friction" not in self.priors.model_fields_set:
            object.__setattr__(self, "priors", self.priors.model_copy(update={"friction": FLAT_FRICTION}))
