"""What furniture is like, before any of it has been pushed."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pbrl_control.settings import NotNegative, Positive, Section


class BeliefSettings(Section):
    """The mixture of which a thing's prior is made; the weights need not add to one, only their shares count.

    Forces are those of casters of 75 mm under an office table (polyurethane on a hard floor).

    Attributes:
        draws: of which a prior is made.
        free: weight of things whose casters all roll.
        one_locked: weight of those with one locked caster, under a corner of the footprint.
        blocked: weight of those with two, three or all four locked, alike: a large friction in the middle of those.
        loaded: weight of those that roll and carry a load.
        mass_sigma: spread of log mass around what a person would guess.
        unknown_median: [kg] where nobody guesses.
        unknown_sigma: spread of log mass there.
        load: mass with its load over that without, at most.
        rolling: friction coefficient of the whole thing on casters that roll: lever over radius, 0.75 mm / 37.5 mm.
        rolling_sigma: spread of its logarithm; carpet has six times that of a hard floor.
        caster_friction: coefficient of a locked caster's tread.
        caster_sigma: its spread; what a caster carries of the weight differs from a quarter likewise.
        inset: [m] of a caster from the corner of the footprint, along both sides.
        inset_sigma: [m]
    """

    draws: Annotated[int, Field(ge=20, le=10_000)] = 400
    free: NotNegative = 0.55
    one_locked: NotNegative = 0.25
    blocked: NotNegative = 0.12
    loaded: NotNegative = 0.08
    mass_sigma: NotNegative = 0.25
    unknown_median: Positive = 15.0
    unknown_sigma: NotNegative = 0.8
    load: Annotated[float, Field(gt=1.0, le=10.0)] = 2.0
    rolling: Positive = 0.02
    rolling_sigma: NotNegative = 0.4
    caster_friction: Positive = 0.7
    caster_sigma: NotNegative = 0.1
    inset: NotNegative = 0.06
    inset_sigma: NotNegative = 0.015

    @property
    def weights(self) -> tuple[float, ...]:
        """Weights of the four kinds: free, one locked, blocked, loaded."""
        return self.free, self.one_locked, self.blocked, self.loaded
