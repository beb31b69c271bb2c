"""How the lattice is searched: epsilons, patience, direction."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from pbrl_control.settings import Positive, Section

ROUNDS = 120


class LatticeSettings(Section):
    """Everything the search can be told.

    Attributes:
        epsilon: to begin with (thesis 4.5.4: 3.0).
        last_epsilon: to end with; 1: the cheapest plan.
        epsilon_step: by which it goes down; in hundredths, like the others.
        time_limit: [s] for all of it.
        direction: from the start or from the goal. The plans cost the same once epsilon is 1; which is found sooner
            depends on which end is more shut in.
        expansions: most, in all.
        thinned: cells along the side of the blocks in each of which a first search expands but one state for each
            heading and articulation; 1: there is no such search. It finds a plan soon in large places; its bound is
            what is proved of it, and may be above `epsilon`.
    """

    epsilon: Annotated[float, Field(ge=1.0, le=1000.0)] = 3.0
    last_epsilon: Annotated[float, Field(ge=1.0, le=1000.0)] = 1.0
    epsilon_step: Annotated[float, Field(ge=0.01, le=1000.0)] = 0.2
    time_limit: Positive = 10.0
    direction: Literal["forward", "backward"] = "backward"
    expansions: Annotated[int, Field(ge=1)] = 10**12
    thinned: Literal[1, 2, 4, 8] = 1

    @model_validator(mode="after")
    def _descends(self) -> Self:
        if self.last_epsilon > self.epsilon:
            raise ValueError(f"expected last_epsilon at most epsilon, got {self.last_epsilon} and {self.epsilon}")
        if len(self.numerators) > ROUNDS:
            raise ValueError(f"expected at most {ROUNDS} epsilons, got {len(self.numerators)}; take a larger step")
        return self

    @property
    def _hundredths(self) -> list[int]:
        begin, end, step = (round(100 * value) for value in (self.epsilon, self.last_epsilon, self.epsilon_step))
        return [*range(begin, end, -step), end]

    @property
    def denominator(self) -> int:
        """What `numerators` are over: as small as can be."""
        return 100 // math.gcd(100, *self._hundredths)

    @property
    def numerators(self) -> list[int]:
        """The epsilons times `denominator`, from the first to the last."""
        return [value * self.denominator // 100 for value in self._hundredths]
