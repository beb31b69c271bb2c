"""Physics-based learning from transitions (thesis section 5.3): one body's posterior, over classes and parameters.

Bodies are learned one by one, each with its own noise (equation 29). The classes of a body's model are inferred side by
side and weighed by their evidence, which the thesis's Metropolis sampler could not; draws of the posterior are kernel
rows, shared out among the classes by their probabilities. Predictions are the mean over the draws of what the
simulation says (section 5.3: "the expectation of the simulator's output"). Contact is not in this model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import logsumexp

from pbrl_bag.types import BodyGeometry
from pbrl_model.errors import ModelError
from pbrl_model.geometry import MassProperties, mass_properties
from pbrl_model.inference.infer import Inference, infer
from pbrl_model.transitions.classes import TransitionClass, to_pivot, transition_class
from pbrl_model.transitions.data import BodyTransitions, Transitions, checked_action
from pbrl_model.transitions.options import LearnOptions
from pbrl_model.transitions.problem import TransitionProblem, simulate

__all__ = ["LearnOptions", "PhysicsRegression", "TransitionPosterior", "learn", "learn_body", "update"]

Array = NDArray[np.float64]

NEGLIGIBLE_CLASS = 1e-3
"""A class of smaller probability has no draws, and what is wrong with its inference is not worth a note."""
CONTENDER = 8.0
"""A class whose evidence, when screened, is smaller by so many nats than the largest is not looked at again."""
GUESSES = 24
"""Draws of an earlier posterior of a class that its inference starts from."""


@dataclass(frozen=True)
class TransitionPosterior:
    """What transitions say of one body.

    Attributes:
        geometry: of the body.
        data: transitions it was learned from.
        rows: (N, 12) draws as kernel rows, of equal weight.
        kind: (N,) index of each draw's class among `classes`.
        noise: (N,) the object's sigma, in metres and metres a second [m, m/s].
        classes: names.
        probabilities: of the classes, (C,).
        inferences: of each class.
        options: it was learned with.
        notes: what to know before believing it; empty if nothing.
    """

    geometry: BodyGeometry
    data: BodyTransitions
    rows: Array
    kind: NDArray[np.int64]
    noise: Array
    classes: tuple[str, ...]
    probabilities: Array
    inferences: tuple[Inference, ...]
    options: LearnOptions
    notes: tuple[str, ...]

    @property
    def converged(self) -> bool:
        """Tell whether every class that matters converged."""
        return not self.notes

    @property
    def class_probabilities(self) -> Mapping[str, float]:
        """Return the probability of each class."""
        return dict(zip(self.classes, self.probabilities.tolist(), strict=True))

    @property
    def best_class(self) -> str:
        """Return the most probable class."""
        return self.classes[int(np.argmax(self.probabilities))]

    def simulate(self, start: Array, wrench: Array, duration: Array, draws: int | None = None) -> Array:
        """Simulate actions (n) under the first `draws` draws (None: all); return (N, n, 6) states after.

        A pivot is where a state has its anchor. Of a body that is pinned that is so, up to noise; of one that is not,
        and that is somewhere else than when it was seen, a draw that thinks it pinned does as well as it can.
        """
        body = mass_properties(self.geometry.footprint)
        rows = self.rows[:draws]
        moved = to_pivot(rows, start, body.com)
        dt, parallel = self.options.dt, self.options.parallel
        return simulate(rows, start + moved, wrench, duration, body, dt, parallel=parallel) - moved

    def predict(self, start: Array, wrench: Array, duration: Array, draws: int | None = None) -> Array:
        """Return (n, 6) expected states after actions: the mean over the posterior's draws.

        Args:
            start: (n, 6) states of the centre of mass.
            wrench: (n, 3) at the centre of mass, world axes.
            duration: (n,) [s].
            draws: how many are used; None: all.
        """
        return self.simulate(start, wrench, duration, draws).mean(axis=0)


def learn(
    rng: np.random.Generator,
    transitions: Transitions,
    index: int,
    geometry: BodyGeometry,
    options: LearnOptions | None = None,
) -> TransitionPosterior:
    """Learn one body's model from transitions in which it touched nothing.

    Args:
        rng: source of randomness; the same seed gives the same bytes.
        transitions: observed; only rows in which the body is pushed or moves are used.
        index: of the body among them.
        geometry: its footprint and nominal mass (NaN: unknown).
        options: None: the defaults.

    Raises:
        ModelError: the body was never pushed, an option is out of range, or the transitions do not fit the options.
    """
    return learn_body(rng, transitions.body(index), geometry, options)


def learn_body(
    rng: np.random.Generator,
    data: BodyTransitions,
    geometry: BodyGeometry,
    options: LearnOptions | None = None,
    before: TransitionPosterior | None = None,
) -> TransitionPosterior:
    """Do what `learn` does with one body's own transitions; start from an earlier posterior of it, if there is one."""
    settings = options or LearnOptions()
    told = data.informative()
    if not told.wrench.any():
        raise ModelError(
            f"{geometry.name}: expected a transition in which it is pushed, got none in {len(data)}; push it first"
        )
    body = mass_properties(geometry.footprint)
    kinds = [
        transition_class(name, geometry, settings.priors, settings.noise, ground=settings.ground)
        for name in settings.classes
    ]
    problems = [TransitionProblem(kind, told, body, settings.dt, parallel=settings.parallel) for kind in kinds]
    found = _inferred(rng, problems, [_guesses(before, kind) for kind in kinds], settings)
    return _posterior(rng, told, geometry, body, settings, kinds, found)


def update(
    rng: np.random.Generator, posterior: TransitionPosterior, transitions: Transitions, index: int
) -> TransitionPosterior:
    """Go on with more transitions: all data count alike, and the search starts from the posterior so far.

    Raises:
        ModelError: see `learn`.
    """
    before, more = posterior.data, transitions.body(index)
    names = ("start", "wrench", "duration", "end")
    data = BodyTransitions(*(np.concatenate([getattr(before, name), getattr(more, name)]) for name in names))
    return learn_body(rng, data, posterior.geometry, posterior.options, posterior)


def _inferred(
    rng: np.random.Generator,
    problems: Sequence[TransitionProblem],
    guesses: Sequence[Array | None],
    options: LearnOptions,
) -> list[Inference]:
    """Infer every class briefly, and again at length what may matter and has not converged."""
    found = [infer(rng, each, options.screening, some) for each, some in zip(problems, guesses, strict=True)]
    best = max(each.log_evidence for each in found)
    for number, each in enumerate(found):
        if not each.converged and each.log_evidence > best - CONTENDER:
            found[number] = infer(rng, problems[number], options.inference, each.draws[:GUESSES])
    return found


def _guesses(before: TransitionPosterior | None, kind: TransitionClass) -> Array | None:
    """Return draws of an earlier posterior of this class, or None."""
    if before is None or kind.name not in before.classes:
        return None
    draws = before.inferences[before.classes.index(kind.name)].draws[:GUESSES]
    return draws if draws.shape[1:] == (len(kind.prior.names),) else None


def _posterior(
    rng: np.random.Generator,
    data: BodyTransitions,
    geometry: BodyGeometry,
    body: MassProperties,
    options: LearnOptions,
    kinds: Sequence[TransitionClass],
    found: Sequence[Inference],
) -> TransitionPosterior:
    evidence = np.array([each.log_evidence for each in found])
    if not np.isfinite(evidence).any():
        raise ModelError(
            f"{geometry.name}: expected a class that can explain the transitions, got none; widen the prior"
        )
    probabilities = np.exp(evidence - logsumexp(evidence))
    probabilities = np.where(probabilities < NEGLIGIBLE_CLASS, 0.0, probabilities)
    counts = _shared_out(rng, probabilities / probabilities.sum(), options.draws)
    rows, noise, member, notes = [], [], [], []
    for number, (kind, each, count) in enumerate(zip(kinds, found, counts, strict=True)):
        if probabilities[number] > 0.0:
            notes += [f"{kind.name}: {note}" for note in each.notes]
        theta = each.draws[np.arange(count) % max(1, len(each.draws))]
        rows.append(kind.rows(theta, data.start, body.com))
        noise.append(np.exp(theta[:, -1]))
        member.append(np.full(count, number, dtype=np.int64))
    order = rng.permutation(options.draws)
    return TransitionPosterior(
        geometry,
        data,
        np.concatenate(rows)[order],
        np.concatenate(member)[order],
        np.concatenate(noise)[order],
        tuple(kind.name for kind in kinds),
        probabilities / probabilities.sum(),
        tuple(found),
        options,
        tuple(notes),
    )


def _shared_out(rng: np.random.Generator, probabilities: Array, draws: int) -> NDArray[np.int64]:
    """Return (C,) how many of the draws each class gets, to within one of its share."""
    ticks = (rng.random() + np.arange(draws)) / draws
    member = np.minimum(np.searchsorted(np.cumsum(probabilities), ticks, side="right"), len(probabilities) - 1)
    return np.bincount(member, minlength=len(probabilities))


class PhysicsRegression:
    """The learner as the baselines are: transitions in, states out, every body by itself, no contact.

    Args:
        rng: source of randomness.
        geometries: of the K bodies, in the transitions' order.
        options: None: the defaults.
    """

    def __init__(
        self, rng: np.random.Generator, geometries: Sequence[BodyGeometry], options: LearnOptions | None = None
    ) -> None:
        self._rng = rng
        self._geometries = tuple(geometries)
        self._options = options or LearnOptions()
        self.posteriors: tuple[TransitionPosterior, ...] = ()

    def fit(self, transitions: Transitions) -> PhysicsRegression:
        """Learn every body; return self.

        Raises:
            ModelError: the number of bodies differs, or see `learn`.
        """
        if transitions.bodies != len(self._geometries):
            raise ModelError(f"learn: expected transitions of {len(self._geometries)} bodies, got {transitions.bodies}")
        self.posteriors = tuple(
            learn(self._rng, transitions, index, geometry, self._options)
            for index, geometry in enumerate(self._geometries)
        )
        return self

    def predict(self, state: ArrayLike, target: ArrayLike, wrench: ArrayLike, duration: ArrayLike) -> Array:
        """Return (n, K, 6) expected states after actions; see `checked_action` for the arguments.

        Raises:
            ModelError: nothing has been learned, or the arguments do not fit.
        """
        before, targets, pushes, seconds = checked_action(state, target, wrench, duration)
        if before.shape[1] != len(self.posteriors):
            raise ModelError(f"learn: expected states of {len(self.posteriors)} learned bodies, got {before.shape[1]}")
        after = np.empty_like(before)
        for index, posterior in enumerate(self.posteriors):
            own = np.where((targets == index)[:, None], pushes, 0.0)
            after[:, index] = posterior.predict(before[:, index], own, seconds)
        return after
