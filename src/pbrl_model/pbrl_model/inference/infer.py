"""Posterior and log evidence of a problem: modes first, their shapes next, then importance sampling from a mixture.

The steps check one another. Climbs from many starts find the modes; probes learn the modes' shapes, which a curvature
at the top does not tell where the density has kinks; importance sampling weighs all of it, with an error. Then walkers
set out from the weighted sample: if the mixture covers the posterior they stay among what it covers, and if they walk
off to where the mixture hardly draws, mass has been missed and the round is repeated with what they have seen.

What no check here sees: a mode that no start found, and the neck of a funnel, a density whose width shrinks by orders
of magnitude along another column. Where a scale is unknown, make its logarithm the problem's noise column.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from pbrl_model.errors import ModelError
from pbrl_model.inference.facets import ProbeOptions
from pbrl_model.inference.importance import FEWEST, PARETO_LIMIT, Defence, Weighted, flattened, log_proposal, population
from pbrl_model.inference.metered import Metered
from pbrl_model.inference.mixture import Mixture
from pbrl_model.inference.modes import Modes, SearchOptions, find_modes
from pbrl_model.inference.population import WalkOptions, learned, moved, populate
from pbrl_model.inference.problem import Problem
from pbrl_model.inference.shapes import Shapes, of_mode, starting_shapes, taught_shapes, walked_shapes

Array = NDArray[np.float64]

LEAST_EFFECT = 0.05
"""Fewer effective samples than this share of the calls: the weights' tail is not known well enough."""
REFINED = 0.25
"""A population of which less than this share of the calls is effective teaches once more."""
COVERED = 0.05
"""Where one draw would carry more than this share of all weight, the mixture does not cover a mode."""
LOST = 4.0
"""An attempt has lost mass when its log evidence is so many standard errors below an earlier one's."""
STRAYED = 5.0
"""Walkers have left what the mixture covers when their log weights rose by so many standard errors."""
STRAYED_SHARE = 0.03
"""Or when more than this share of them came to where a draw would have weighed more than any that was made."""


@dataclass(frozen=True)
class InferenceOptions:
    """Effort. A likelihood call is one row; about 30 000 are made by default, see `modest` for fewer.

    Attributes:
        search: of the mode finder.
        probe: of the probes that learn each mode's shape.
        walk: of walkers, that check this and learn it anew where it was not right.
        draws: of the population that the estimates are made of.
        learning_draws: of each round that teaches the mixture.
        rounds: at most so many.
        refinements: populations that may teach once more instead of counting, where they are of little effect.
        check_moves: of every walker in the check that nothing was missed; 0: no check.
        attempts: at being converged.
        equal_draws: draws of equal weight that are handed out.
        prior_share: share of draws taken from the prior.
        least_ess: fewer effective samples than this: not converged.
        max_calls: no further wave or attempt begins once so many were made.
    """

    search: SearchOptions = field(default_factory=SearchOptions)
    probe: ProbeOptions = field(default_factory=ProbeOptions)
    walk: WalkOptions = field(default_factory=WalkOptions)
    draws: int = 8000
    learning_draws: int = 1000
    rounds: int = 6
    refinements: int = 1
    check_moves: int = 10
    attempts: int = 3
    equal_draws: int = 1000
    prior_share: float = 0.05
    least_ess: float = 200.0
    max_calls: int = 200_000

    def __post_init__(self) -> None:
        if min(self.draws, self.learning_draws, self.equal_draws, self.attempts) < 1:
            raise ModelError(f"inference: expected draws and attempts of at least 1, got {self}")
        if min(self.rounds, self.refinements, self.check_moves, self.max_calls) < 0:
            raise ModelError(
                f"inference: expected rounds, refinements, check_moves and max_calls of at least 0, got {self}"
            )
        if not 0.0 <= self.prior_share < 1.0:
            raise ModelError(f"inference: expected a prior_share in [0, 1), got {self.prior_share}")

    @classmethod
    def modest(cls) -> InferenceOptions:
        """Return options for an expensive or smooth likelihood: some 3000 calls."""
        return cls(
            search=SearchOptions(screen=64, starts=8, shares=(1.0,), iterations=8, waves=2, hits=2),
            probe=ProbeOptions(probes=12, steps=2, most=4),
            walk=WalkOptions(walkers=40, moves=3, settle=6, remember=8, components=2),
            draws=1000,
            learning_draws=300,
            rounds=3,
            refinements=0,
            check_moves=4,
            attempts=2,
            least_ess=100.0,
            max_calls=10_000,
        )


@dataclass(frozen=True)
class Inference:
    """What is known of a problem.

    Attributes:
        names: D names of the columns.
        draws: (n, D) of equal weight, in random order.
        samples: (N, D) of the last population.
        log_weights: (N,) of them, not normalised.
        log_evidence: [nat].
        log_evidence_sd: its standard error [nat].
        ess: effective samples.
        pareto_k: shape of the weights' tail.
        modes: (M, D) the best point of every mode, every description of each.
        shares: (M,) of the posterior's mass.
        calls: likelihood rows computed in all.
        converged: whether the above may be believed.
        notes: why not, or what to know, in sentences.
    """

    names: tuple[str, ...]
    draws: Array
    samples: Array
    log_weights: Array
    log_evidence: float
    log_evidence_sd: float
    ess: float
    pareto_k: float
    modes: Array
    shares: Array
    calls: int
    converged: bool
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Attempt:
    """One round of weighing, and what speaks against it."""

    shapes: Shapes
    found: Weighted
    doubts: tuple[str, ...]


def infer(
    rng: np.random.Generator,
    problem: Problem,
    options: InferenceOptions | None = None,
    guesses: Array | None = None,
) -> Inference:
    """Find every mode of a problem's posterior, sample it, and compute its log evidence.

    Args:
        rng: source of randomness; the same seed gives the same bytes.
        problem: prior, likelihood and residuals.
        options: effort; None: the defaults.
        guesses: (G, D) places to start from beside the prior's draws, or None.

    Raises:
        ModelError: an option is out of range, the problem contradicts itself, or no start has a finite density.
    """
    settings = options or InferenceOptions()
    meter = Metered.of(rng, problem)
    modes = find_modes(rng, meter, settings.search, guesses, settings.max_calls)
    shapes = _taught(rng, meter, settings, starting_shapes(rng, meter, modes, settings.probe))
    best = tried = _weighed(rng, meter, settings, shapes)
    for attempt in range(1, settings.attempts):
        if not best.doubts or meter.calls >= settings.max_calls:
            break
        shapes = _relearned(rng, meter, settings, tried, from_prior=attempt % 2 == 0)
        tried = _not_below(best, _weighed(rng, meter, settings, shapes))
        if not tried.doubts or tried.found.ess > best.found.ess:
            best = tried
    return _report(rng, meter, settings, modes, best)


def _not_below(before: Attempt, tried: Attempt) -> Attempt:
    """Return the attempt, doubted where its evidence is below an earlier one's: mass that was known has been lost."""
    error = np.hypot(before.found.log_evidence_sd, tried.found.log_evidence_sd)
    lost = before.found.log_evidence - tried.found.log_evidence
    if not lost > LOST * error + 0.1:
        return tried
    note = f"the log evidence fell by {lost:.1f} from one attempt to the next: not converged"
    return replace(tried, doubts=(*tried.doubts, note))


def _weighed(rng: np.random.Generator, meter: Metered, settings: InferenceOptions, shapes: Shapes) -> Attempt:
    """Weigh a population from the mixture and look for what speaks against it."""
    defence = _defence(meter, settings)
    found = population(rng, meter.log_density, shapes.mixture, settings.draws, defence)
    for _ in range(settings.refinements):
        if found.ess > REFINED * found.calls or len(found.samples) == 0:
            break
        flat = flattened(found.log_weights, FEWEST * (meter.domain.dimension + 1) * len(shapes.mixture.mean))
        shapes = replace(shapes, mixture=shapes.mixture.adapted(found.samples, flat))
        found = population(rng, meter.log_density, shapes.mixture, settings.draws, defence)
    doubts = []
    wanted = max(settings.least_ess, LEAST_EFFECT * found.calls)
    if not found.ess >= wanted:
        doubts.append(f"only {found.ess:.0f} effective samples, {wanted:.0f} are wanted: not converged")
    if not found.pareto_k <= PARETO_LIMIT:
        doubts.append(f"Pareto k of the weights is {found.pareto_k:.2f}, above {PARETO_LIMIT}: not converged")
    if not doubts and settings.check_moves:
        doubts += strayed(rng, meter, shapes, found, settings)
    return Attempt(shapes, found, tuple(doubts))


def _defence(meter: Metered, settings: InferenceOptions) -> Defence:
    return Defence(meter.problem.sample_prior, meter.problem.log_prior, settings.prior_share)


def strayed(
    rng: np.random.Generator, meter: Metered, shapes: Shapes, found: Weighted, settings: InferenceOptions
) -> list[str]:
    """Return what speaks against a weighted sample when walkers set out from it.

    A sample of the posterior stays one under moves that keep the posterior: the mean of the log weights may not rise,
    and hardly a walker may come to where a draw would have weighed more than any that was made.
    """
    before, after, defence = [np.zeros(0)], [np.zeros(0)], _defence(meter, settings)
    for number in range(len(shapes.alone)):
        start = of_mode(rng, meter, shapes, found, number, settings.walk.walkers)
        values = meter.log_density(start)
        before.append(values - log_proposal(found.mixture, start, defence, found.proposals))
        points, values = moved(rng, meter.log_density, meter.domain, start, values, settings.check_moves)
        after.append(values - log_proposal(found.mixture, points, defence, found.proposals))
    last = np.concatenate(after)
    if len(last) == 0:
        return ["no draw belongs to any mode: not converged"]
    rises = last - np.concatenate(before)
    rise, error = float(rises.mean()), float(rises.std()) / np.sqrt(len(rises))
    beyond = int(np.sum(last > np.max(found.log_weights)))
    if rise > STRAYED * error + 0.1 or beyond > STRAYED_SHARE * len(last):
        return [
            f"walkers leave what the mixture covers ({beyond} of {len(last)} to where it hardly draws, log weights "
            f"rise by {rise:.2f}): not converged"
        ]
    return []


def _taught(rng: np.random.Generator, meter: Metered, settings: InferenceOptions, alone: list[Mixture]) -> Shapes:
    return taught_shapes(rng, meter, alone, settings.learning_draws, settings.rounds)


def _relearned(
    rng: np.random.Generator, meter: Metered, settings: InferenceOptions, tried: Attempt, *, from_prior: bool
) -> Shapes:
    """Return a mixture learned anew: from walkers that set out from the last sample, or cool down from the prior."""
    if from_prior:
        draws = meter.domain.clip(meter.problem.sample_prior(rng, 4 * settings.walk.walkers))
        walk = replace(settings.walk, walkers=2 * settings.walk.walkers, components=2 * settings.walk.components)
        walked = populate(rng, meter.log_density, learned(rng, draws, meter.domain, 1), walk)
        alone = list(tried.shapes.alone)
        if walked is not None:
            alone.append(learned(rng, walked.points, meter.domain, walk.components))
    else:
        alone = walked_shapes(rng, meter, tried.shapes, tried.found, settings.walk, settings.probe)
    return _taught(rng, meter, settings, alone)


def _report(
    rng: np.random.Generator, meter: Metered, settings: InferenceOptions, modes: Modes, best: Attempt
) -> Inference:
    found, notes = best.found, list(best.doubts)
    if modes.hits[0] < settings.search.hits:
        notes.append(
            f"the best mode was found by {modes.hits[0]} of {modes.starts} starts, {settings.search.hits} are wanted: "
            "others may have been missed"
        )
    missed = _uncovered(meter, settings, found, modes.dropped)
    if missed:
        notes.append(f"{missed} more modes of some mass were left out; raise search.most")
    return Inference(
        names=tuple(meter.problem.names),
        draws=found.resampled(rng, settings.equal_draws) if len(found.samples) else np.zeros((0, len(meter.spread))),
        samples=found.samples,
        log_weights=found.log_weights,
        log_evidence=found.log_evidence,
        log_evidence_sd=found.log_evidence_sd,
        ess=found.ess,
        pareto_k=found.pareto_k,
        modes=best.shapes.best,
        shares=mode_shares(found, best.shapes),
        calls=meter.calls,
        converged=not notes,
        notes=tuple(notes),
    )


def _uncovered(meter: Metered, settings: InferenceOptions, found: Weighted, places: Array) -> int:
    """Return how many places the mixture hardly draws from although the density there is high."""
    if len(places) == 0 or len(found.samples) == 0:
        return len(places)
    proposed = log_proposal(found.mixture, places, _defence(meter, settings), found.proposals)
    weights = meter.log_density(places) - proposed
    return int(np.sum(weights > found.log_evidence + np.log(COVERED * found.proposals)))


def mode_shares(found: Weighted, shapes: Shapes) -> Array:
    """Return the posterior's mass (M,) in each mode: every sample belongs to components as these explain it."""
    count = len(shapes.best)
    if len(found.samples) == 0:
        return np.full(count, np.nan)
    log_components = found.mixture.log_components(found.samples)
    owned = np.exp(
        log_components - logsumexp(log_components, axis=0) + found.log_weights - logsumexp(found.log_weights)
    )
    shares = np.zeros(count)
    np.add.at(shares, shapes.mode, owned.sum(axis=1))
    return shares
