"""Which laws a pull shows: one by one, then pairs and threes around the likeliest, weighed by evidence and prior."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.joint.evidence import Explained, Hypothesis, Problem, checked, explained
from pbrl_mismatch.joint.laws import Law
from pbrl_mismatch.joint.pull import Pull

Array = NDArray[np.float64]

CLIMBED = 2
"""Best starts that are climbed from."""
EXTENDED = 2
"""So many of the likeliest sets of a size are extended by one law more."""
CHECKED, CLOSE = 4, 12.0
"""So many hypotheses at most, and none so far behind the first [nat], have their evidence checked by sampling."""
LESS_TEXTURE = (1.0, 0.3)
"""Factors of the texture under which starts are looked at: as the parent needs it, and as a better law would."""


@dataclass(frozen=True)
class Weighed:
    """An effect, or several together, with its best form.

    Attributes:
        effects: their names; empty: nothing was left out.
        explained: the best form.
        log_weight: log of prior odds times evidence, forms averaged [nat].
        probability: among all that were tried.
    """

    effects: tuple[str, ...]
    explained: Explained
    log_weight: float
    probability: float


def baseline_of(pull: Pull) -> Explained:
    """Return constant friction alone."""
    problem = Problem(pull, Hypothesis(()))
    return explained(problem, problem.mean + np.log([[0.3], [3.0]]))


def extended(parent: Explained, law: Law) -> Explained:
    """Return a hypothesis with one law more, climbed from the best places for it."""
    pull = parent.problem.pull
    problem = Problem(pull, Hypothesis((*parent.hypothesis.laws, law)))
    count = len(parent.coordinates) - 1
    own = law.starts(pull)
    unknowns = law.unknowns(pull)
    own = np.column_stack(
        [np.log(own[:, k]) if each.positive else own[:, k] for k, each in enumerate(unknowns)] or [np.empty((1, 0))]
    )
    starts = []
    for factor in LESS_TEXTURE:
        texture = np.full((len(own), 1), parent.coordinates[-1] + math.log(factor))
        starts.append(np.hstack([np.tile(parent.coordinates[:count], (len(own), 1)), own, texture]))
    every = np.vstack(starts)
    density = np.array([problem.log_density(start) for start in every])
    return explained(problem, _apart(every[np.argsort(-density, kind="stable")], problem.spread))


def _apart(starts: Array, spread: Array) -> Array:
    """Return the first starts, leaving out those next to one that is already in."""
    kept: list[Array] = []
    for start in starts:
        if all(np.max(np.abs(start - other) / spread) > 0.25 for other in kept):
            kept.append(start)
        if len(kept) == CLIMBED:
            break
    return np.array(kept)


def search(
    rng: np.random.Generator, pull: Pull, laws: Sequence[Law], *, most_together: int = 3, none_odds: float = 1.0
) -> tuple[Weighed, ...]:
    """Return sets of effects that were tried and the baseline, likeliest first.

    Args:
        rng: for the check of evidences.
        pull: what was felt.
        laws: to try.
        most_together: effects at most.
        none_odds: prior odds that nothing was left out against any single effect.
    """
    base = baseline_of(pull)
    tried: list[Explained] = []
    parents, price = [base], math.log(len({law.effect for law in laws}))
    for _ in range(most_together):
        found = _extend(parents, laws)
        tried += found
        # One law more is tried only where the last one paid for itself.
        paid = max((each.evidence for each in found), default=-math.inf) > parents[0].evidence + price
        if not paid:
            break
        parents = _likeliest(found)
    weighed = weigh(base, tried, none_odds)
    best = weighed[0].log_weight
    near = {each.effects for each in weighed[:CHECKED] if each.log_weight > best - CLOSE} | {()}
    named = {id(each.explained) for each in weighed if each.effects in near}
    # In the order of the search, so that the same seed draws the same for the same hypothesis.
    base = checked(rng, base) if id(base) in named else base
    tried = [checked(rng, each) if id(each) in named else each for each in tried]
    return weigh(base, tried, none_odds)


def _extend(parents: Sequence[Explained], laws: Sequence[Law]) -> list[Explained]:
    done: set[frozenset[tuple[str, str]]] = set()
    found = []
    for parent in parents:
        had = {(law.effect, law.form) for law in parent.hypothesis.laws}
        for law in laws:
            key = frozenset(had | {(law.effect, law.form)})
            if law.effect in parent.hypothesis.effects or key in done:
                continue
            done.add(key)
            found.append(extended(parent, law))
    return found


def _likeliest(found: Sequence[Explained]) -> list[Explained]:
    order = sorted(found, key=lambda each: -each.evidence)
    return order[:EXTENDED]


def weigh(base: Explained, tried: Sequence[Explained], none_odds: float) -> tuple[Weighed, ...]:
    """Return hypotheses likeliest first; forms of an effect share its prior, and single effects share one.

    A set of m effects has the prior of one of them to the power of m, so that each has to pay for itself. What a law
    that is a little wrong leaves is not there for others to take: the texture has it.
    """
    groups: dict[tuple[str, ...], list[Explained]] = {(): [base]}
    for each in tried:
        groups.setdefault(tuple(sorted(each.hypothesis.effects)), []).append(each)
    singles = max(sum(len(key) == 1 for key in groups), 1)
    entries = []
    for key, members in groups.items():
        evidence = np.array([member.evidence for member in members])
        prior = math.log(none_odds) if not key else -len(key) * math.log(singles)
        weight = prior + float(np.logaddexp.reduce(evidence)) - math.log(len(members))
        best = members[int(np.argmax(evidence))]
        entries.append(Weighed(best.hypothesis.effects, best, weight, 0.0))
    total = np.logaddexp.reduce([each.log_weight for each in entries])
    entries = [replace(each, probability=math.exp(each.log_weight - total)) for each in entries]
    return tuple(sorted(entries, key=lambda each: -each.log_weight))
