"""The told oracle: what a fit reaches that knows which effect was concealed and where it is. For scoring alone.

It is given the truth as a start and the effect's own prior and law; what it then lacks of the truth is the law's doing,
and what a diagnosis lacks of it is the search's. Its evidence against the baseline's says whether an effect that was
drawn could have been seen at all.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import Recording
from pbrl_bringup.concealed.truth import Truth
from pbrl_mismatch.data.cuts import Cuts, cut_windows
from pbrl_mismatch.data.grip import lay_grips
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.diagnose import fit_baselines, track_of
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.observability.power import needed
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.search.climbed_on import led
from pbrl_mismatch.search.fitted import Fitted, Stages, cut_stages, fit_from, judged, scene_of
from pbrl_mismatch.search.grip import GRASP_COMPLIANCE, GripEvidence, beside_motion, gives_way, grip_evidence
from pbrl_mismatch.search.hops import hopped
from pbrl_mismatch.search.hypothesis import BaselineOptions, Hypothesis, baselines
from pbrl_mismatch.search.library import trace
from pbrl_mismatch.search.told_baseline import ToldBaseline

Array = NDArray[np.float64]

STARTS, PLAIN = 8, 3
"""Starts of a fit that is told, and how many of them are not beside the truth but at it."""
JITTER = 0.15, 0.003
"""Of the farthest and of the nearest start beside the truth, in standard deviations of the prior: a contact is met or
missed by a centimetre where a post may be anywhere in a metre or two."""
THOROUGH = {"candidates": STARTS, "keep": (STARTS, 4), "iterations": (12, 24)}
"""Settings of a fit that is told: what it does not find, what was drawn is thought not to be seen at all."""
LEVEL, POWER = 0.05, 0.95
"""Of false alarms, and the share of recordings in which what can be detected is."""
HOPELESS = 0.7
"""Times the detectable strength below which a first glance says no; it lacks some starts of a look."""


@dataclass(frozen=True)
class Oracle:
    """What is reached when told.

    Attributes:
        fitted: the true effects, fitted from their true values.
        baseline: the best baseline.
        without: of several effects, the same with each of them left out.
    """

    fitted: Fitted
    baseline: Fitted
    without: tuple[Fitted, ...] = ()

    @property
    def gain(self) -> float:
        """Return by how much the truth is likelier than the baseline [nat]."""
        return self.fitted.evidence - self.baseline.evidence

    @property
    def times_detectable(self) -> float:
        """Return how strong the effects are over the least that this oracle detects in 95 % of recordings.

        Of several effects it is the faintest that counts, beside the others. Twice the gain of the best log posterior
        is a chi-square whose non-centrality grows with the square of the strength; what a test at 5 % finds in 95 % has
        a known one.
        """
        return min(self._times(less) for less in (self.baseline, *self.without))

    def _times(self, less: Fitted) -> float:
        freedom = max(len(self.fitted.hypothesis.parameters) - len(less.hypothesis.parameters), 1)
        found = 2.0 * (_height(self.fitted) - _height(less)) - freedom
        return math.sqrt(max(found, 0.0) / needed(freedom, LEVEL, POWER))


def _height(fitted: Fitted) -> float:
    """Return the log posterior at its best point, simulated or along the path, with what the grippers say [nat]."""
    objective, peak = fitted.peak.objective, fitted.peak
    motion = float(objective.likelihood(peak.misfit)[0] - 0.5 * objective.prior_misfit(peak.coordinates)[0])
    return (motion if fitted.traced is None else max(motion, fitted.traced.log_posterior)) + fitted.beside


@dataclass(frozen=True)
class Laid:
    """A recording laid out for an oracle.

    Attributes:
        track: of the body.
        stages: windows of growing length.
        longest: windows of the path.
        grip: what the grippers' poses say, where they say anything.
        options: of a diagnosis.
        baseline: a model that counts as no mismatch; None: every kind of body that does.
    """

    track: Track
    stages: Stages
    longest: Cuts
    grip: GripEvidence | None
    options: DiagnoseOptions
    baseline: ToldBaseline | None = None


def lay_out(recording: Recording, body: str, baseline: ToldBaseline | None = None) -> Laid:
    """Lay out what an oracle looks at.

    Args:
        recording: as a diagnosis gets it.
        body: whose motion it is about.
        baseline: a model that counts as no mismatch; None: every kind of body that does.
    """
    options = DiagnoseOptions()
    track = track_of(recording, body)
    grips = lay_grips(recording, track)
    grip = None if grips is None else grip_evidence(grips, options.delay_spread)
    return Laid(track, cut_stages(track, options), cut_windows(track, max(options.windows)), grip, options, baseline)


def oracle(laid: Laid, truth: Truth) -> Oracle:
    """Fit what was concealed, told, and every kind of baseline, not told.

    Args:
        laid: the recording.
        truth: what was concealed; effects that act through the body's motion.
    """
    bases = _bases(laid)
    best = _best_told(laid, truth, bases)
    # A baseline that had not found its best would make what was concealed look stronger than it is.
    bases = led(bases, [best], laid.stages, laid.options)
    return Oracle(judged(best, laid.stages, laid.options), judged(bases[0], laid.stages, laid.options, even=True))


def _bases(laid: Laid) -> list[Fitted]:
    rng = np.random.default_rng(laid.options.seed)
    bases = fit_baselines(rng, laid.track, laid.stages, laid.options, laid.baseline)
    traced = [trace(laid.longest, laid.options, each, each.peak.coordinates) for each in bases]
    return [beside_motion(each, laid.grip) for each in traced]


def _best_told(laid: Laid, truth: Truth, bases: list[Fitted]) -> Fitted:
    """Return the likeliest told fit on the bases of the true kind."""
    true = [each for each in bases if laid.baseline is not None or each.hypothesis.variant == _kind(truth)]
    return max((_told(laid, truth, each, STARTS) for each in true), key=_evidence)


def seen(laid: Laid, truth: Truth) -> Oracle | None:
    """Return the oracle if what was concealed is at least what it detects in 95 % of recordings, else nothing.

    Of several effects each has to be, beside an oracle that is told the others: what cannot be seen cannot be named.

    Most draws that are too weak are so by far. They are told by a climb from the truth with the effects and one
    without: what keeps the baseline from better optima makes the effects look stronger, never weaker.
    """
    if _glance(laid, truth).times_detectable < HOPELESS:
        return None
    found = oracle(laid, truth)
    if found.times_detectable >= 1.0 and len(truth.effects) > 1:
        found = _beside_parts(laid, truth, found)
    return found if found.times_detectable >= 1.0 else None


def _beside_parts(laid: Laid, truth: Truth, found: Oracle) -> Oracle:
    """Return an oracle with what is reached with each of several effects left out, all led to where the others are.

    Where feet stick there are many tops: what has all effects and what lacks one may be on different ones.
    """
    bases = _bases(laid)
    rests = [replace(truth, effects=tuple(o for o in truth.effects if o != name)) for name in truth.effects]
    fits = [_best_told(laid, rest, bases) for rest in rests]
    tops = [found.fitted]
    if GRASP_COMPLIANCE not in truth.effects:  # which is laid on a top as it is
        tops += [_laid_on(laid, truth, tops[0].hypothesis, *each) for each in zip(truth.effects, fits, strict=True)]
    fitted = max(tops, key=_evidence)
    without = tuple(led([each], [fitted], laid.stages, laid.options)[0] for each in fits)
    return replace(found, fitted=judged(fitted, laid.stages, laid.options), without=without)


def _laid_on(laid: Laid, truth: Truth, hypothesis: Hypothesis, name: str, rest: Fitted) -> Fitted:
    """Return a hypothesis fitted from where all but one of its effects are without that one, which is told."""
    own = {column for variant in EFFECTS[name].variants for column in variant} - set(rest.hypothesis.columns)
    told = {column: value for column, value in truth.told.items() if column in own}
    return beside_motion(_fitted(hypothesis, told, rest, laid, STARTS), laid.grip)


def _evidence(fitted: Fitted) -> float:
    return fitted.evidence


def _glance(laid: Laid, truth: Truth) -> Oracle:
    """Return an oracle that climbs once over the longest windows, from the truth, with the effects and without."""
    last = replace(laid, stages=Stages(laid.stages.fitted[-1:], laid.stages.splits[-1:]))
    hasty = laid.options.model_copy(update={"windows": laid.options.windows[-1:], "keep": (1,), "survivors": ()})
    last = replace(last, options=hasty.model_copy(update={"iterations": laid.options.iterations[-1:]}))
    if laid.baseline is not None:
        base = _fitted(laid.baseline.hypothesis, {}, None, last, 1)
    else:
        base = _fitted(kind_of_baseline(laid.track, laid.options, _kind(truth)), truth.told, None, last, 1)
    return Oracle(_told(last, truth, base, PLAIN), beside_motion(base, laid.grip))


def _kind(truth: Truth) -> str:
    return "wheel" if "wheel_x" in truth.told else "free"


def kind_of_baseline(track: Track, options: DiagnoseOptions, kind: str) -> Hypothesis:
    """Return one kind of baseline as a diagnosis believes it before it has looked."""
    lower, upper = track.outline.min(axis=0), track.outline.max(axis=0)
    believed = BaselineOptions(track.nominal_mass, options.mass_spread, options.inertia_spread, options.delay_spread)
    return baselines(believed, (kind,), 0.5 * (lower + upper), 0.5 * (upper - lower), None)[0]


def _told(laid: Laid, truth: Truth, base: Fitted, starts: int) -> Fitted:
    """Return the likeliest fit of a baseline with everything that was concealed, over its sub-models."""
    scaled = scene_of(laid.track, base.row)
    grounds = [base.hypothesis]
    for name in truth.effects:
        if name != GRASP_COMPLIANCE:
            variants = range(len(EFFECTS[name].variants))
            grounds = [each.with_effect(EFFECTS[name], scaled, variant) for each in grounds for variant in variants]
    fits = [_fitted(each, truth.told, base, laid, starts) for each in grounds]
    if GRASP_COMPLIANCE in truth.effects and laid.grip is not None:
        fits = [gives_way(each, laid.grip) for each in fits]
    return max((beside_motion(each, laid.grip) for each in fits), key=_evidence)


def _fitted(hypothesis: Hypothesis, values: Mapping[str, float], base: Fitted | None, laid: Laid, count: int) -> Fitted:
    """Climb from the truth, and with all starts from beside it, see `starts_told`, and along the path as well."""
    starts = starts_told(hypothesis, values, base, count, np.random.default_rng(laid.options.seed))
    if count < STARTS:
        return fit_from(hypothesis, laid.stages, starts, laid.options)
    found = fit_from(hypothesis, laid.stages, starts, laid.options.model_copy(update=THOROUGH))
    (found,) = hopped([found], laid.stages.fitted[-1], laid.options)
    # Each has a path of its own.
    begun = (found.peak.coordinates[0], *starts[:PLAIN])
    along = [trace(laid.longest, laid.options, found, each[None]) for each in begun]
    return max(along, key=_evidence)


def starts_told(
    hypothesis: Hypothesis, values: Mapping[str, float], base: Fitted | None, count: int, rng: np.random.Generator
) -> Array:
    """Return starts (count, K): the truth, where the baseline has the body's own parameters, and beside the truth.

    What is not told starts where the baseline is, or at its prior. Without one of its effects a body's best is seldom
    at the truth: one wheel between two does what both do, and a body that a patch holds is four times as heavy. Every
    second start has what bends so as it was believed to be.

    Args:
        hypothesis: that is to be fitted.
        values: what is told, by column.
        base: what the hypothesis is laid on.
        count: of starts.
        rng: source of randomness.
    """
    centre, own = hypothesis.mean.copy(), {}
    told = np.isin(hypothesis.columns, list(values))
    for k, parameter in enumerate(hypothesis.parameters):
        if told[k]:
            value = values[parameter.column]
            centre[k] = math.log(max(value, 1e-6)) if parameter.positive else value
        if base is not None and parameter.column in base.hypothesis.columns:
            own[k] = base.peak.coordinates[0, base.hypothesis.columns.index(parameter.column)]
            centre[k] = centre[k] if told[k] else own[k]
    beside = np.zeros(count)
    beside[PLAIN:] = np.geomspace(*JITTER, max(count - PLAIN, 0))
    starts = np.tile(centre, (count, 1))
    if own and count > 1:
        starts[1, list(own)] = list(own.values())
    starts[2::2] = np.where(told, centre, hypothesis.as_believed(centre))
    return starts + beside[:, None] * hypothesis.spread * rng.standard_normal(starts.shape)
