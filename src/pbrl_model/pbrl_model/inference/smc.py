"""Sequential Monte Carlo in pure steps: a weighted cloud of particles is carried from one density to another.

A path joins two unnormalised densities, gamma_b = base + b * gain in logarithms, b from 0 to 1. On the way the cloud is
reweighted, resampled where its weights have become uneven, and moved by Metropolis steps that keep gamma_b; the
temperatures are chosen so that a step costs a given share of the effective sample size (Del Moral, Doucet and Jasra
2006; Jasra et al. 2011). Which densities, the caller says:

    the prior and the posterior                   tempering, for posteriors that are broad
    any mixture that can be drawn from, and it    importance sampling that mends itself
    the posterior of some windows, and of more    IBIS (Chopin 2002): going on as data arrive

Where the path is dear and something near it is cheap, particles walk along the cheap one, and each walk is taken or
left as a whole so that the path's own density is kept (Liu 2001, surrogate transition).

The logarithm of the ratio of the two normalising constants is kept on the way: the evidence, or what new data add to
it. Particles belong to groups, and each group moves with its own covariance: two modes that lie apart would else be
moved with steps as long as the way between them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_model.errors import ModelError
from pbrl_model.inference import mcmc
from pbrl_model.inference.cloud import (
    Cloud,
    at_temperature,
    covariances,
    effective,
    no_nan,
    normalised,
    regrouped,
    resample,
)

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Path = Callable[[Array, Index], tuple[Array, Array]]
"""(positions (P, D), groups (P,)) -> (base (P,), gain (P,)) log densities; -inf where there is none.

The groups are a hint, for a cheap density that approximates around modes; a path itself is a function of the positions.
"""

BEST_SCALE = 2.38
"""Of a random walk over the square root of the dimension (Roberts, Gelman and Gilks 1997)."""
LEAST_STEP = 1e-4
"""A temperature grows by at least this much: beyond it, a cloud that no longer fits is not helped by patience."""
SCALE_LIMITS = (-10.0, 2.0)
"""Of the logarithm of the step length: one temperature must not spoil it for all that follow."""


@dataclass(frozen=True)
class Options:
    """How a cloud is carried.

    Attributes:
        keep: share of the effective sample size that a change of temperature leaves.
        resample_below: share of the particles below which the effective sample size calls for resampling.
        wanted_moves: mean number of accepted moves of a particle at each temperature.
        most_sweeps: at most so many proposals for each particle at each temperature.
    """

    keep: float = 0.5
    resample_below: float = 0.6
    wanted_moves: float = 3.0
    most_sweeps: int = 16

    def __post_init__(self) -> None:
        if not (0.0 < self.keep < 1.0 and 0.0 <= self.resample_below <= 1.0):
            raise ModelError(f"smc: expected shares between 0 and 1, got keep={self.keep}, {self.resample_below}")
        if self.most_sweeps < 1 or not self.wanted_moves > 0.0:
            raise ModelError(f"smc: expected at least one move, got {self.most_sweeps} sweeps, {self.wanted_moves}")


@dataclass(frozen=True)
class Info:
    """What a human needs of one step.

    Attributes:
        temperature: reached.
        ess: effective sample size after reweighting.
        resampled: whether it called for resampling.
        acceptance: mean share of proposals taken; NaN where nothing was moved.
        sweeps: proposals for each particle.
    """

    temperature: float
    ess: float
    resampled: bool
    acceptance: float
    sweeps: int


def init(path: Path, position: Array, group: Index | None = None, log_weight: Array | None = None) -> Cloud:
    """Return a cloud at the start of a path.

    Args:
        path: the densities.
        position: (P, D) draws from the first density.
        group: (P,) numbers; None: all one group.
        log_weight: (P,) of the draws; None: equal.

    Raises:
        ModelError: there are no particles, or one of them has no density at the start.
    """
    if len(position) < 2:
        raise ModelError(f"smc: expected at least two particles, got {len(position)}")
    group = np.zeros(len(position), dtype=np.int64) if group is None else group
    weight = np.full(len(position), -np.log(len(position))) if log_weight is None else normalised(log_weight)[0]
    base, gain = path(position, group)
    alive = np.isfinite(weight)
    if not np.all(np.isfinite(base[alive])):
        wrong = int(np.sum(~np.isfinite(base[alive])))
        raise ModelError(f"smc: expected particles of positive density at the start, got {wrong} without")
    scale = float(np.log(BEST_SCALE / np.sqrt(position.shape[1])))
    return Cloud(np.array(position), weight, group, base, gain, 0.0, 0.0, scale)


def next_temperature(cloud: Cloud, options: Options) -> float:
    """Return the furthest temperature that leaves the wanted share of the effective sample size, by bisection."""
    wanted = options.keep * cloud.ess

    def left(temperature: float) -> float:
        return effective(cloud.log_weight + _increment(cloud, temperature))

    if left(1.0) >= wanted:
        return 1.0
    low, high = cloud.temperature, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if left(middle) >= wanted else (low, middle)
    return min(1.0, max(low, cloud.temperature + LEAST_STEP))


def _increment(cloud: Cloud, temperature: float) -> Array:
    """Return (P,) what the log weights gain on the way to a temperature."""
    with np.errstate(invalid="ignore"):  # a particle that is dead already stays so
        return no_nan(at_temperature(cloud.base, cloud.gain, temperature) - cloud.log_density)


def reweight(cloud: Cloud, temperature: float) -> Cloud:
    """Return the cloud at another temperature, with weights for its density there.

    Raises:
        ModelError: no particle has any density there.
    """
    log_weight, total = normalised(cloud.log_weight + _increment(cloud, temperature))
    return replace(cloud, log_weight=log_weight, temperature=temperature, log_evidence=cloud.log_evidence + total)


def move(
    rng: np.random.Generator, cloud: Cloud, path: Path, options: Options, cheap: Path | None = None
) -> tuple[Cloud, float, int]:
    """Move particles of equal weight by a random walk that keeps the density at the cloud's temperature.

    Each particle is a chain of `mcmc`; the step length is adapted from sweep to sweep, and sweeps go on until a
    particle has moved as often as wanted.

    Returns:
        The cloud, the share of proposals taken (of the walks, where they go along something cheap), and how many sweeps
        were made.
    """
    if cheap is None:
        return _walk(rng, cloud, path, options)
    begin = _along(cloud, cheap)
    walked, _, sweeps = _walk(rng, begin, cheap, options)
    arrived = _along(walked, path)
    with np.errstate(invalid="ignore"):
        gain = (arrived.log_density - walked.log_density) - (cloud.log_density - begin.log_density)
    taken = np.log(rng.random(len(gain))) < no_nan(gain)
    moved = replace(
        arrived,
        position=np.where(taken[:, None], arrived.position, cloud.position),
        base=np.where(taken, arrived.base, cloud.base),
        gain=np.where(taken, arrived.gain, cloud.gain),
    )
    return moved, float(taken.mean()), sweeps


def _along(cloud: Cloud, path: Path) -> Cloud:
    """Return the same particles with the values of another path."""
    base, gain = path(cloud.position, cloud.group)
    return replace(cloud, base=base, gain=gain)


def _walk(rng: np.random.Generator, cloud: Cloud, path: Path, options: Options) -> tuple[Cloud, float, int]:
    """Make sweeps; return (cloud, mean acceptance, sweeps)."""
    by_group = covariances(cloud.position, cloud.weight, cloud.group)
    covariance = np.stack([by_group[number] for number in cloud.group.tolist()])
    blocks = (mcmc.Block(tuple(range(cloud.position.shape[1]))),)
    temperature, group = cloud.temperature, cloud.group

    def density(position: Array, _: Array | None) -> tuple[Array, Array]:
        base, gain = path(position, group)
        value = no_nan(at_temperature(base, gain, temperature))
        return value, np.stack([base, gain], -1)

    state = mcmc.State(
        cloud.position,
        no_nan(cloud.log_density),
        np.stack([cloud.base, cloud.gain], -1),
        cloud.position,
        covariance,
        np.full((len(group), 1), cloud.log_scale),
        0,
        False,
    )
    taken: list[float] = []
    while len(taken) < options.most_sweeps and sum(taken) < options.wanted_moves:
        state, info = mcmc.step(rng, state, density, blocks)
        taken.append(float(info.accepted.mean()))
        state = replace(state, log_scale=state.log_scale + (taken[-1] - mcmc.WANTED_MANY))
    scale = float(np.clip(state.log_scale[0, 0], *SCALE_LIMITS))
    base, gain = state.memo.T
    moved = replace(cloud, position=state.position, base=base.copy(), gain=gain.copy(), log_scale=scale)
    return moved, float(np.mean(taken)), len(taken)


def step(
    rng: np.random.Generator, cloud: Cloud, path: Path, options: Options, cheap: Path | None = None
) -> tuple[Cloud, Info]:
    """Go one temperature further: reweight; where the weights have become uneven, resample and move."""
    cloud = reweight(cloud, next_temperature(cloud, options))
    ess = cloud.ess
    if ess >= options.resample_below * len(cloud.position):
        return cloud, Info(cloud.temperature, ess, False, np.nan, 0)
    cloud, acceptance, sweeps = move(rng, regrouped(resample(rng, cloud)), path, options, cheap)
    return cloud, Info(cloud.temperature, ess, True, acceptance, sweeps)


def run(
    rng: np.random.Generator, cloud: Cloud, path: Path, options: Options | None = None, cheap: Path | None = None
) -> tuple[Cloud, tuple[Info, ...]]:
    """Go to the end of the path.

    Args:
        rng: source of randomness.
        cloud: on the path.
        path: the densities.
        options: None: the defaults.
        cheap: densities near those of the path, to move along.

    Raises:
        ModelError: no particle has any density on the way.
    """
    chosen = options or Options()
    infos: list[Info] = []
    while cloud.temperature < 1.0:
        cloud, info = step(rng, cloud, path, chosen, cheap)
        infos.append(info)
    return cloud, tuple(infos)


def go_on(cloud: Cloud, gain: Array) -> Cloud:
    """Return a cloud that has come to its end at the start of the next path: its density times new data's.

    Args:
        cloud: at temperature 1.
        gain: (P,) log likelihood of the new data at its particles.

    Raises:
        ModelError: the cloud is still on its way.
    """
    if cloud.temperature != 1.0:
        raise ModelError(f"smc: expected a cloud at temperature 1 to go on from, got {cloud.temperature:g}")
    return replace(cloud, base=cloud.log_density, gain=gain, temperature=0.0)


def settled(cloud: Cloud) -> Cloud:
    """Return a cloud at the end of its path with all that it gained as its base, ready for what comes next."""
    return replace(cloud, base=cloud.log_density, gain=np.zeros(len(cloud.base)), temperature=1.0)
