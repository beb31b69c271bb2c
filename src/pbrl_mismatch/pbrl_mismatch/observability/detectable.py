"""For each effect the smallest strength that this recording would have shown, and the motion that shows it.

At a fitted model, an effect of a strength s at a place and with other parameters drawn from its prior changes the
poses by d(s). Whitened by the noise and freed of what the windows' unknown starts, the sensor's own error and the
model's own parameters can take up, its squared length is the noncentrality of the test; for small effects it grows as
s squared. The strength at which 95 % of recordings with this motion and noise would have shown the effect follows
from it; of many draws, the median is told. A hold that gives shows between gripper and body instead, where the
noncentrality is that of the readings' linear law.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.data.simulation import poses
from pbrl_mismatch.effects.effect import Effect, Scene
from pbrl_mismatch.effects.grasp_compliance import PARAMETERS as HOLD
from pbrl_mismatch.effects.registry import EFFECTS, effect_named
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.observability.power import needed, power
from pbrl_mismatch.observability.strengths import laid_on, rounded, scaled, size_of, strength_columns, unit_of
from pbrl_mismatch.search.fitted import Fitted, scene_of
from pbrl_mismatch.search.grip import GRASP_COMPLIANCE, GripEvidence
from pbrl_mismatch.search.objective import START, Linear, reduce

Array = NDArray[np.float64]

DRAWS = 12
PLAUSIBLE = 0.95
"""Quantile of the prior's strength up to which an effect is plausible."""
WANTED = 0.95
"""Share of recordings in which an effect of the smallest strength is noticed."""
NOWHERE = 0.1
"""A chance of being noticed below this is next to that of a false alarm."""
PRIOR_DRAWS = 400
ROUNDS = 3
"""Times that the effect is simulated anew at the strength that the last round suggests."""
CHANGES = (1e-4, 1e4)
"""Factors on a drawn strength that are tried at most."""


@dataclass(frozen=True)
class Detectable:
    """What a recording could have shown of an effect.

    Attributes:
        effect: its name.
        smallest: strength that would have been noticed in 95 % of such recordings, at a typical place and moment;
            infinite where no strength would.
        plausible: strength below which 95 % of the prior lies.
        unit: of both.
        chance: that an effect drawn from the prior would have been noticed, 0..1.
        motion: what shows it.
    """

    effect: str
    smallest: float
    plausible: float
    unit: str
    chance: float
    motion: str

    @property
    def shown(self) -> bool:
        """Tell whether a plausible strength of it would have been noticed."""
        return self.smallest <= self.plausible

    def to_report(self) -> dict[str, Any]:
        """Return a JSON-able form; a strength that is infinite is null."""
        return {
            "effect": self.effect,
            "smallest": self.smallest if math.isfinite(self.smallest) else None,
            "plausible": self.plausible,
            "unit": self.unit,
            "chance": self.chance,
            "motion": self.motion,
        }

    def sentence(self) -> str:
        """Return what could not be seen, and how to see it."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        if not math.isfinite(self.smallest):
            seen = "nowhere" if self.chance < NOWHERE else f"only in {100 * self.chance:.0f} % of the ways it may be"
            return f"{self.effect}: {seen} would it have shown, however strong. {self.motion}"
        return f"{self.effect}: below about {rounded(self.smallest)}{unit} it would not have shown. {self.motion}"


def could_not_show(
    rng: np.random.Generator,
    ground: Fitted,
    effects: Sequence[str] | None = None,
    grip: GripEvidence | None = None,
    workers: int = 1,
    *,
    level: float = 0.05,
) -> tuple[Detectable, ...]:
    """Return the effects that this recording could not have shown, those it came nearest to last.

    Args:
        rng: of places and moments.
        ground: the model that is believed: the repaired one, or the baseline.
        effects: names; None: all of the library that are not in `ground`.
        grip: what the grippers' poses say; None where that is nothing.
        workers: threads; the result does not depend on how many.
        level: of false alarms of the test; one that alarms nearly always hides nothing.
    """
    if level >= WANTED:
        return ()
    found = [each for each in detectable(rng, ground, effects, grip, workers, level=level) if not each.shown]
    return tuple(sorted(found, key=lambda each: (each.chance, each.effect)))


def detectable(
    rng: np.random.Generator,
    ground: Fitted,
    effects: Sequence[str] | None = None,
    grip: GripEvidence | None = None,
    workers: int = 1,
    *,
    level: float = 0.05,
    wanted: float = WANTED,
    draws: int = DRAWS,
) -> tuple[Detectable, ...]:
    """Return what the recording could have shown of each effect; its most visible variant counts.

    Args:
        rng: of places and moments.
        ground: the model that is believed.
        effects: names; None: all of the library that are not in `ground`.
        grip: what the grippers' poses say; None where that is nothing.
        workers: threads; the result does not depend on how many.
        level: of false alarms of the test.
        wanted: power.
        draws: of each variant's prior.

    Raises:
        MismatchError: an effect is unknown, or level and power do not fit.
    """
    every = [effect_named(name) for name in (EFFECTS if effects is None else effects)]
    absent = [effect for effect in every if effect.name not in ground.hypothesis.effects]
    scene = scene_of(ground.peak.objective.cuts.track, ground.row)
    motion = Sensitivity(ground)

    def most_visible(own: np.random.Generator, effect: Effect) -> Detectable:
        shows = motion.noncentrality if grip is None or effect.name != GRASP_COMPLIANCE else partial(_between, grip)
        tried = [
            _variant(own, ground, shows, scene, effect.name, variant, level, wanted, draws)
            for variant in range(len(effect.variants))
        ]
        return min(tried, key=lambda each: (each.smallest / each.plausible, -each.chance))

    with ThreadPoolExecutor(workers) as pool:
        return tuple(pool.map(most_visible, rng.spawn(len(absent)), absent))


class Sensitivity:
    """How much of a change the windows of a fitted model show; linearised once."""

    def __init__(self, ground: Fitted) -> None:
        peak, objective = ground.peak, ground.peak.objective
        cuts = objective.cuts
        self.ground = ground
        self.weight = peak.weight[:1]
        self.linear = objective.linearise(peak.coordinates[:1], peak.nuisance[:1])
        self.nuisance = peak.nuisance[:1]
        self.told = cuts.told + np.einsum("wkl,wl->wk", cuts.root, self.nuisance[0, :, :START])
        scale = objective.floor * np.array([1.0, 1.0, cuts.track.gyration])
        self.extra = (self.nuisance[0, :, START:] * scale)[:, None, :]
        self.start = self._simulated(ground.row[None])
        self.prior = np.diag(ground.hypothesis.spread**-2.0)

    def _simulated(self, rows: Array) -> Array:
        cuts = self.ground.peak.objective.cuts
        told, extra = (np.repeat(each[None], len(rows), 0) for each in (self.told, self.extra))
        return poses(np.ascontiguousarray(rows), cuts, told, extra)

    def noncentrality(self, rows: Array) -> Array:
        """Return (P,) how far rows (P, WIDTH) are off what the ground can take up, in squared standard deviations."""
        change = self._simulated(rows) - self.start
        change[..., 2] -= 2.0 * np.pi * np.round(change[..., 2] / (2.0 * np.pi))
        change = np.clip(np.nan_to_num(change * self.ground.peak.objective.cuts.weight), -1e5, 1e5)
        moved = np.moveaxis(change.reshape(len(rows), len(self.told), -1), 0, -1)
        slope = np.concatenate([self.linear.slope[0], moved], axis=-1)[None]
        reduced = reduce(Linear(self.linear.residual, slope, self.linear.spread), self.nuisance)
        joint = reduced.weighed(self.weight)[0][0]
        own = len(self.prior)
        across = joint[own:, :own]
        taken = np.einsum("pk,kp->p", across, np.linalg.solve(joint[:own, :own] + self.prior, across.T))
        return np.maximum(np.diag(joint)[own:] - taken, 0.0)


def _between(grip: GripEvidence, rows: Array) -> Array:
    """Return (P,) how far rows (P, WIDTH) are off a hold as it should be, in squared standard deviations."""
    return grip.noncentrality(rows[:, [COLUMN[each.column] for each in HOLD]])


def _variant(
    rng: np.random.Generator,
    ground: Fitted,
    shows: Callable[[Array], Array],
    scene: Scene,
    name: str,
    variant: int,
    level: float,
    wanted: float,
    draws: int,
) -> Detectable:
    effect = EFFECTS[name]
    hypothesis = ground.hypothesis.with_effect(effect, scene, variant)
    free = effect.variants[variant]
    columns = strength_columns(name, free)
    rows = hypothesis.rows(hypothesis.sample_prior(rng, PRIOR_DRAWS))
    plausible = float(np.quantile(size_of(rows, columns), PLAUSIBLE))
    rows = laid_on(ground.row, rows[:draws], name, variant, ground.hypothesis.columns)
    target = needed(len(free), level, wanted)
    found = shows(rows)
    chance = float(np.mean(power(found, len(free), level)))
    factor = np.ones(draws)
    for _ in range(ROUNDS):
        seen = found > 1e-9
        factor = np.where(seen, factor * np.sqrt(target / np.maximum(found, 1e-9)), np.inf)
        factor = np.where(
            (factor < CHANGES[0]) | (factor > CHANGES[1]), np.where(factor < 1.0, CHANGES[0], np.inf), factor
        )
        trial = scaled(rows, columns, np.where(np.isfinite(factor), factor, 1.0))
        found = np.where(np.isfinite(factor), shows(trial), 0.0)
    strength = np.where(np.isfinite(factor), size_of(trial, columns), np.inf)
    return Detectable(name, float(np.median(strength)), plausible, unit_of(columns), chance, effect.shows)
