"""A cloud of particles over one object's physics: found by the batch search, carried on by IBIS as windows come.

Particles live in `coordinates`, where there are no bounds and each wheel is one point. Their weights are made of the
exact likelihood, with every particle's own linearisation of every window's nuisances (see `likelihood`): for new
windows alone that is little work. To move particles, all windows count. Then they walk along a likelihood whose
nuisances are linearised once for each mode, at its best particle: ten times cheaper, and near enough that most walks
are kept when they are judged by the exact one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_model.fitting.coordinates import Coordinates
from pbrl_model.fitting.likelihood import Linearisation, WindowedLikelihood
from pbrl_model.fitting.starts import SearchPlan, find_modes
from pbrl_model.fitting.target import Target
from pbrl_model.inference import smc
from pbrl_model.inference.cloud import Cloud, covariances, no_nan, normalised
from pbrl_model.inference.mixture import Mixture
from pbrl_model.inference.problem import Domain
from pbrl_model.online.windows import joined_windows
from pbrl_model.sensing.motion import Motion
from pbrl_model.sensing.windows import Windows

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SEARCH = SearchPlan(draws=300, keep=(12, 6, 4), lengths=(0.5, 1.0), iterations=(6, 8, 15))
"""Half as wide as a batch fit's: it is done again as more is seen."""
SETTLING = 3
"""Times that a mode's nuisances are linearised at a better place."""
INFLATE = 1.5
"""Factor on a mode's covariance in the mixture that the cloud is drawn from: rather too wide than too narrow."""
PRIOR_SHARE = 0.05
"""Of the cloud that is drawn from the prior at a search."""
NEGLIGIBLE = 12.0
"""A mode whose mass is smaller by so many nats than the largest is not worth particles."""
LEAST_MASS = 2.0
"""No mode starts with a share smaller by more nats than this than the largest's."""


@dataclass(frozen=True)
class Near:
    """A likelihood whose windows are linearised once for each mode.

    Attributes:
        target: likelihood over W windows.
        linear: of one row each, in the order of the modes.
    """

    target: Target
    linear: tuple[Linearisation, ...]

    @classmethod
    def at(cls, target: Target, places: Array) -> Near:
        """Linearise at the most likely nuisances of each position (M, D)."""
        point = target.evaluate(places, target.likelihood.at_rest(len(places)))
        for _ in range(SETTLING):
            point = target.settle(point)
        return cls(target, tuple(point.linear.take(np.array([row])) for row in range(len(places))))

    def log_likelihood(self, position: Array, mode: Index) -> Array:
        """Return (P,) log likelihoods of positions (P, D) that belong to modes (P,)."""
        out = np.full(len(position), -np.inf)
        for number, linear in enumerate(self.linear):
            rows = np.flatnonzero(mode == number)
            if len(rows):
                part = position[rows]
                residuals = self.target.residuals(part, np.repeat(linear.nuisance, len(rows), axis=0))
                out[rows] = no_nan(self.target.log_likelihood(part, residuals, linear))
        return out


@dataclass(frozen=True)
class Tracked:
    """A cloud with what its weights are made of.

    Attributes:
        cloud: at temperature 1, over coordinates; its groups are modes.
        target: whose posterior it is.
        steps: of the last change: temperatures, acceptance.
        foretold: log density of the last windows before they were learned from [nat]; NaN after a search.
        left: effective particles that these windows alone would have left.
    """

    cloud: Cloud
    target: Target
    steps: tuple[smc.Info, ...] = ()
    foretold: float = math.nan
    left: float = math.inf

    @property
    def windows(self) -> Windows:
        """Return what it was learned from."""
        return self.target.likelihood.windows

    @property
    def mean_log_likelihood(self) -> float:
        """Return the posterior mean of the log likelihood of everything [nat]."""
        alive = self.cloud.weight > 0.0
        prior = Coordinates(self.target).log_prior(self.cloud.position[alive])
        return float(np.sum(self.cloud.weight[alive] * (self.cloud.log_density[alive] - prior)))

    def positions(self) -> Array:
        """Return (P, D) positions of equal weight, each wheel as its representative; the same ones each time."""
        count = len(self.cloud.position)
        total = np.cumsum(self.cloud.weight)
        rows = np.searchsorted(total, (0.5 + np.arange(count)) / count * total[-1], side="right")
        return Coordinates(self.target).positions(self.cloud.position[np.minimum(rows, count - 1)])

    def best_places(self, value: Array) -> Array:
        """Return (M, D) the position of the highest value (P,) in each mode; where there is none, the best of all."""
        best, rows = int(np.argmax(value)), []
        for mode in range(int(self.cloud.group.max()) + 1):
            own = np.flatnonzero((self.cloud.group == mode) & np.isfinite(value))
            rows.append(int(own[np.argmax(value[own])]) if len(own) else best)
        return Coordinates(self.target).positions(self.cloud.position[rows])


def tracked_of(target: Target, position: Array, log_evidence: float) -> Tracked:
    """Return draws (P, D) from a posterior as a cloud to go on from, all of one mode."""
    at = Coordinates(target).of(position)
    cloud = smc.init(_path_of(target), at)
    return Tracked(smc.settled(replace(cloud, log_evidence=log_evidence)), target)


def _path_of(target: Target) -> smc.Path:
    coordinates = Coordinates(target)
    return lambda at, _: (coordinates.log_density(at), np.zeros(len(at)))


def search(
    rng: np.random.Generator,
    target: Target,
    motions: Sequence[Motion],
    particles: int,
    known: Tracked | None = None,
    options: smc.Options | None = None,
) -> Tracked:
    """Search everything for modes and carry a cloud from a mixture round them to the posterior.

    Args:
        rng: source of randomness.
        target: over all windows.
        motions: that they were cut from.
        particles: how many.
        known: a cloud that the search must not lose: its modes are components beside those found.
        options: of the cloud's way.

    Raises:
        ModelError: nothing of the prior is compatible with the data.
    """
    coordinates = Coordinates(target)
    places, mixture = _mixture(rng, target, motions, known)
    near = Near.at(target, places)
    from_prior = round(PRIOR_SHARE * particles)
    drawn, _ = mixture.sample(rng, particles - from_prior)
    begin = np.concatenate([drawn, coordinates.sample_prior(rng, from_prior)])
    group = np.argmax(mixture.log_components(begin), axis=0).astype(np.int64)

    def start(at: Array) -> Array:
        own = math.log1p(-PRIOR_SHARE) + mixture.log_density(at)
        return np.logaddexp(own, math.log(PRIOR_SHARE) + coordinates.log_prior(at))

    def path(at: Array, _: Index) -> tuple[Array, Array]:
        base = start(at)
        return base, coordinates.log_density(at) - base

    def cheap(at: Array, mode: Index) -> tuple[Array, Array]:
        base = start(at)
        return base, coordinates.log_prior(at) + near.log_likelihood(coordinates.positions(at), mode) - base

    cloud, steps = smc.run(rng, smc.init(path, begin, group), path, options, cheap)
    return Tracked(smc.settled(cloud), target, steps)


def _mixture(
    rng: np.random.Generator, target: Target, motions: Sequence[Motion], known: Tracked | None
) -> tuple[Array, Mixture]:
    """Return the modes' positions (M, D) and a mixture round them, over coordinates."""
    coordinates = Coordinates(target)
    modes = find_modes(rng, target, motions, SEARCH)
    mass = modes.point.log_density + 0.5 * np.linalg.slogdet(modes.covariance)[1]
    keep = np.flatnonzero(mass > mass.max() - NEGLIGIBLE)
    places, mass = modes.point.position[keep], mass[keep]
    mean, covariance = coordinates.of(places), coordinates.covariance(places, modes.covariance[keep])
    if known is not None:
        cloud = known.cloud
        own = covariances(cloud.position, cloud.weight, cloud.group)
        shares = {number: cloud.weight * (cloud.group == number) for number in own}
        alive = [number for number, share in shares.items() if share.sum() > 0.0]
        means = np.array([shares[number] @ cloud.position / shares[number].sum() for number in alive])
        places = np.concatenate([places, coordinates.positions(means)])
        mean = np.concatenate([mean, means])
        covariance = np.concatenate([covariance, [own[number] for number in alive]])
        mass = np.concatenate([mass, np.full(len(alive), mass.max())])
    weight = np.exp(np.maximum(mass - mass.max(), -LEAST_MASS))
    return places, Mixture.around(mean, INFLATE * covariance, weight, Domain.unbounded(target.dimension))


def absorb(
    rng: np.random.Generator, known: Tracked, windows: Windows, keep: Windows, options: smc.Options | None = None
) -> Tracked:
    """Go on from a posterior to that of further windows.

    While the weights stay even, new windows only reweigh the particles. Where they do not, the cloud is carried over in
    steps.

    Args:
        rng: source of randomness.
        known: the posterior so far.
        windows: the new ones.
        keep: those that the posterior is to be of beside the new ones: what it was of, or fewer, so that work and
            memory stay bounded.
        options: of the cloud's way.

    Raises:
        ModelError: no particle allows the new windows.
    """
    chosen, at = options or smc.Options(), known.cloud.position
    everything, fresh = _over(known.target, joined_windows([keep, windows])), _over(known.target, windows)
    begin = smc.go_on(known.cloud, _likelihood(fresh, at))
    light = smc.reweight(begin, 1.0)
    foretold, same = light.log_evidence - begin.log_evidence, len(keep) == len(known.windows)
    if same and light.ess >= chosen.resample_below * len(at):
        info = smc.Info(1.0, light.ess, False, math.nan, 0)
        return Tracked(smc.settled(light), everything, (info,), foretold, light.ess)
    kept = known.target if same else _over(known.target, keep)
    coordinates, places = Coordinates(kept), known.best_places(known.cloud.log_density + begin.gain)
    near_kept, near_fresh = Near.at(kept, places), Near.at(fresh, places)

    def path(at: Array, _: Index) -> tuple[Array, Array]:
        return coordinates.log_density(at), _likelihood(fresh, at)

    def cheap(at: Array, mode: Index) -> tuple[Array, Array]:
        position = coordinates.positions(at)
        return coordinates.log_prior(at) + near_kept.log_likelihood(position, mode), near_fresh.log_likelihood(
            position, mode
        )

    if not same:
        begin = _without(begin, coordinates.log_density(at))
    cloud, steps = smc.run(rng, begin, path, chosen, cheap)
    return Tracked(smc.settled(cloud), everything, steps, foretold, light.ess)


def _likelihood(target: Target, at: Array) -> Array:
    """Return (P,) exact log likelihoods of coordinates (P, D)."""
    coordinates = Coordinates(target)
    return coordinates.log_density(at) - coordinates.log_prior(at)


def _without(cloud: Cloud, base: Array) -> Cloud:
    """Return a cloud whose start has become another density (P,): windows that are forgotten no longer count."""
    with np.errstate(invalid="ignore"):
        changed = no_nan(cloud.log_weight + base - cloud.base)
    log_weight, change = normalised(changed)
    return replace(cloud, log_weight=log_weight, base=base, log_evidence=cloud.log_evidence + change)


def _over(target: Target, windows: Windows) -> Target:
    likelihood = target.likelihood
    return target.over(WindowedLikelihood(likelihood.body, windows, with_drag=likelihood.with_drag))
