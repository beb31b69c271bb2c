"""Where what holds or stops a body begins: draws held against short simulations, since the path says little of them.

A friction that is a twentieth too strong stops a simulated body a centimetre early. Along a path on which feet creep it
would have to be overcome all the way, which is decimetres: the right law looks wrong by far, and wrong ones no worse. A
touch that is missed by a centimetre did not happen: of draws about several places the best are drawn about again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climb import climb, settled
from pbrl_mismatch.search.fitted import Fitted, tops
from pbrl_mismatch.search.hypothesis import Hypothesis
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.path.ground import Ground
from pbrl_mismatch.search.path.starts import drawn

Array = NDArray[np.float64]
Index = NDArray[np.int64]

LOOKED_INTO, CLIMBED, STEPS = 12, 4, 4
"""So many draws, the likeliest after one step of the nuisances, are settled; so many of those are climbed from, in so
many steps."""
KEPT, KEPT_OF_PLACES = 2, 4
"""So many of them go on; of a touch, more."""
PLACES, APART = 6, 0.25
"""A touch is sought about so many places at most, the likeliest that are so far apart [m]: one that has taken the place
of what is hard to meet is not left alone."""
OF_EACH_PLACE = 4, 2
"""So many draws about each place are looked into, and climbed from."""
MORE_DRAWS, AGAIN, NEARBY = 4, 48, (0.05, 0.02)
"""A touch has so many times as many draws; the best about each place is drawn about again so many times, each time from
nearer, in standard deviations of the prior."""
SOFT = {"obstacle_stiffness": 2.0}
"""What is soft is met from further off: draws begin so many deviations of the prior below its mean."""


def holds(name: str) -> bool:
    """Tell whether an effect holds a body by dry friction, or stops it by a contact."""
    return EFFECTS[name].sticks or EFFECTS[name].touches is not None


def held_starts(
    rng: np.random.Generator,
    hypothesis: Hypothesis,
    variant: int,
    base: Fitted,
    ground: Ground,
    shortest: Cuts,
    options: DiagnoseOptions,
) -> Array:
    """Return starts (n, K) of an effect that holds or stops a body, likeliest first.

    They begin with what was believed of the body: what holds it was taken for its weight.

    Args:
        rng: of the draws.
        hypothesis: the base with the effect as its last.
        variant: which of its sub-models.
        base: what it is laid on.
        ground: the same along its path.
        shortest: windows that a simulation can follow from a wrong place.
        options: settings.
    """
    effect = EFFECTS[hypothesis.effects[-1]]
    place = tuple(hypothesis.columns.index(column) for column in (effect.touches or ())[:2])
    if place:
        options = options.model_copy(update={"draws": MORE_DRAWS * options.draws})
    draws, afresh = drawn(rng, hypothesis, effect, variant, base, ground, options)
    for k, column in enumerate(hypothesis.columns):
        if column in SOFT and column in effect.variants[variant]:
            draws[:, k] = hypothesis.mean[k] - SOFT[column] * hypothesis.spread[k]
    draws = hypothesis.believable(draws[afresh])
    objective = Objective(hypothesis, shortest, options.sensor_floor)
    # How the start and a steady wrench move the poses hardly depends on what acts besides.
    believed = base.hypothesis.as_believed(base.peak.coordinates[0])[None]
    slopes = Objective(base.hypothesis, shortest, options.sensor_floor).linearise(believed, objective.at_rest(1)).spread
    held = _Held.once(objective, slopes, place, draws, objective.at_rest(len(draws)))
    searched = np.isin(hypothesis.columns, [each for each in effect.variants[variant] if each not in effect.linear])
    for nearby in NEARBY if place else ():
        leaders = held.likeliest(1).repeat(AGAIN)
        moved = nearby * searched * hypothesis.spread * rng.standard_normal((len(leaders), len(searched)))
        near = hypothesis.believable(held.draws[leaders] + moved)
        held = held.beside(_Held.once(objective, slopes, place, near, held.nuisance[leaders]))
    looked_into, climbed, kept = (*OF_EACH_PLACE, KEPT_OF_PLACES) if place else (LOOKED_INTO, CLIMBED, KEPT)
    held = held.take(held.likeliest(looked_into)).settled()
    held = held.take(held.likeliest(climbed))
    return tops(climb(objective, held.draws, held.nuisance, iterations=STEPS, rough=True), kept)


@dataclass(frozen=True)
class _Held:
    """Draws held against windows.

    Attributes:
        objective: hypothesis and windows.
        slopes: (1, W, R, NUISANCES) in the nuisances.
        place: columns of where a draw touches; none for what is nowhere.
        draws: (n, K).
        nuisance: (n, W, NUISANCES).
        residual: (n, W, R).
        misfit: (n, W).
    """

    objective: Objective
    slopes: Array
    place: tuple[int, ...]
    draws: Array
    nuisance: Array
    residual: Array
    misfit: Array

    @staticmethod
    def once(objective: Objective, slopes: Array, place: tuple[int, ...], draws: Array, nuisance: Array) -> _Held:
        """Return draws after one step of their nuisances (n, W, NUISANCES)."""
        found = settled(objective, draws, nuisance, slopes, rounds=1)
        return _Held(objective, slopes, place, draws, *found)

    def settled(self) -> _Held:
        """Return the same with its nuisances moved for as long as that gains."""
        found = settled(self.objective, self.draws, self.nuisance, self.slopes, self.residual)
        return _Held(self.objective, self.slopes, self.place, self.draws, *found)

    def beside(self, other: _Held) -> _Held:
        """Return these draws and others."""
        both = ((getattr(self, name), getattr(other, name)) for name in ("draws", "nuisance", "residual", "misfit"))
        return _Held(self.objective, self.slopes, self.place, *map(np.concatenate, both))

    def take(self, rows: Index) -> _Held:
        """Return some of the draws."""
        some = (self.draws[rows], self.nuisance[rows], self.residual[rows], self.misfit[rows])
        return _Held(self.objective, self.slopes, self.place, *some)

    def likeliest(self, each: int) -> Index:
        """Return the rows of so many about each of the likeliest places, likeliest first there."""
        density = self.objective.likelihood(self.misfit) - 0.5 * self.objective.prior_misfit(self.draws)
        left, found = np.argsort(-density, kind="stable"), list[Index]()
        at = self.draws[:, self.place]
        while len(left) and len(found) < PLACES:
            near = np.linalg.norm(at[left] - at[left[0]], axis=1) < APART
            found.append(left[near][:each])
            left = left[~near]
        return np.concatenate(found)
