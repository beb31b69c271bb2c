"""The density that is searched and sampled: prior times likelihood over physics and noise (27), object-wise (29).

A position is one row: the learned parameters in the order of `names`, then the delay (how late the poses come after
the wrenches [s]), ln sigma (scale of the pose noise) and ln drag (left-out force [N]). All but the last two, which
only scale, change what is simulated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_model.engines.windowed import KernelEngine
from pbrl_model.fitting.likelihood import ROUNDS, Linearisation, WindowedLikelihood
from pbrl_model.fitting.marginal_kernel import SETTLED
from pbrl_model.parameters import KERNEL_COLUMNS, BodyParameters, expand
from pbrl_model.priors import Prior

Array = NDArray[np.float64]

LOG_SIGMA = (0.3, 0.7)
"""Mean and standard deviation of ln sigma: the smoother's noise, more likely wider than narrower."""
LEFT_OUT_FORCE = 5.0
"""Most likely size of what the model leaves out [N]: a rolling table's resistance, a wrist sensor's error in motion."""
LEFT_OUT_BESIDE_GROUND = 1.0
"""The same where the resistance is in the model: what casters that still have to turn do, the sensor's error."""
LOG_DRAG_SPREAD = 0.2
"""Standard deviation of ln drag. Narrow on purpose: with a free scale, a model that explains a resistance by a wheel
that slides somewhere else would be preferred to one that leaves the resistance out in every window."""
DELAY = 0.05
"""Standard deviation of the poses' delay after the wrenches [s]: a camera's exposure and its detector."""
NOISE_NAMES = ("delay", "log_sigma", "log_drag")
SETTLE_SHARES = (1.0, 0.4, 0.1)
"""Steps towards the most likely nuisances that are tried in every window."""
CHUNK_VALUES = 4_000_000
"""Sensitivities of so many numbers are held at once."""


@dataclass(frozen=True)
class Point:
    """Positions with what belongs to them.

    Attributes:
        position: (P, D).
        log_density: (P,).
        residuals: (P, W, 3N).
        linear: of every row.
    """

    position: Array
    log_density: Array
    residuals: Array
    linear: Linearisation

    def take(self, rows: NDArray[np.int64]) -> Point:
        """Return some of the rows."""
        return Point(self.position[rows], self.log_density[rows], self.residuals[rows], self.linear.take(rows))


@dataclass(frozen=True)
class Target:
    """Log density over positions.

    Attributes:
        names: K learned parameters.
        prior: over them.
        likelihood: of the recorded poses.
        base: values of what is not learned.
        ties: parameters that copy another's value, such as an isotropic friction's mu_y.
        left_out_force: most likely size of the force that the model leaves out [N].
    """

    names: tuple[str, ...]
    prior: Prior
    likelihood: WindowedLikelihood
    base: BodyParameters
    ties: Mapping[str, str] = field(default_factory=dict)
    left_out_force: float = LEFT_OUT_FORCE

    @property
    def dimension(self) -> int:
        """Return the length of a position."""
        return len(self.names) + len(NOISE_NAMES)

    @property
    def simulated(self) -> int:
        """Return how many of a position's first columns change what is simulated: the parameters and the delay."""
        return len(self.names) + 1

    @property
    def bounds(self) -> Array:
        """Lower and upper ends of the support of the simulated columns, (2, K + 1)."""
        return np.column_stack([self.prior.bounds, [-np.inf, np.inf]])

    @property
    def periodic(self) -> NDArray[np.bool_]:
        """Which of the simulated columns live on a circle, (K + 1,)."""
        return np.append(self.prior.periodic, False)

    def over(self, likelihood: WindowedLikelihood) -> Target:
        """Return the same target over other windows."""
        return replace(self, likelihood=likelihood)

    def rows(self, physics: Array) -> Array:
        """Return (P, 12) kernel rows of (P, K) learned values, or of whole positions."""
        rows = expand(physics[:, : len(self.names)], self.names, self.base)
        for copy, source in self.ties.items():
            rows[:, KERNEL_COLUMNS.index(copy)] = rows[:, KERNEL_COLUMNS.index(source)]
        return rows

    @property
    def _noise_prior(self) -> tuple[Array, Array]:
        """Return means and standard deviations of delay, ln sigma and ln drag."""
        return np.array([0.0, LOG_SIGMA[0], math.log(self.left_out_force)]), np.array(
            [DELAY, LOG_SIGMA[1], LOG_DRAG_SPREAD]
        )

    def log_prior(self, position: Array) -> Array:
        """Return (P,) log prior of positions."""
        means, deviations = self._noise_prior
        noise = (position[:, len(self.names) :] - means) / deviations
        normal = -0.5 * np.sum(noise**2 + np.log(2 * np.pi * deviations**2), axis=1)
        return self.prior.log_prob(position[:, : len(self.names)]) + normal

    def sample_prior(self, rng: np.random.Generator, n: int) -> Array:
        """Draw (n, D) positions."""
        means, deviations = self._noise_prior
        noise = means + deviations * rng.standard_normal((n, len(NOISE_NAMES)))
        return np.concatenate([self.prior.sample(rng, n), noise], -1)

    def residuals(self, position: Array, nuisance: Array) -> Array:
        """Return (P, W, 3N) residuals; rows outside the prior's support must not be asked for."""
        return self.likelihood.residuals(self.rows(position), nuisance, self.delay(position))

    def delay(self, position: Array) -> Array:
        """Return (P,) by how much poses come after wrenches [s]."""
        return position[:, len(self.names)]

    def noise(self, position: Array) -> tuple[Array, Array]:
        """Return sigma (P,) and drag (P,) [N]."""
        noise = np.exp(position[:, self.simulated :])
        return noise[:, 0], noise[:, 1]

    def log_likelihood(self, position: Array, residuals: Array, linear: Linearisation) -> Array:
        """Return (P,) log likelihood from residuals (P, W, 3N) and a linearisation that are at hand."""
        return self.likelihood.log_density(residuals, linear, *self.noise(position))

    def normal_equations(self, point: Point, derivatives: Array) -> tuple[Array, Array]:
        """Return (P, S, S) and (P, S) over the S simulated columns, see `WindowedLikelihood.normal_equations`.

        Args:
            point: P positions.
            derivatives: (P, W, 3N, S) of the simulated poses.
        """
        noise = self.noise(point.position)
        return self.likelihood.normal_equations(point.residuals, derivatives, point.linear, *noise)

    def evaluate(self, position: Array, nuisance: Array) -> Point:
        """Simulate and linearise every position (P, D) at nuisances (P, W, 9): ten rollouts a row."""
        rows, delay = self.rows(position), self.delay(position)
        base = self.likelihood.simulate(rows, nuisance, delay)
        linear = self.likelihood.linearise(rows, nuisance, delay, base)
        residuals = self.likelihood.residuals(rows, nuisance, delay, base)
        value = self.log_prior(position) + self.log_likelihood(position, residuals, linear)
        return Point(position, value, residuals, linear)

    def settle(self, point: Point) -> Point:
        """Linearise again at the most likely nuisances of each position, going only so far as the fit improves."""
        noise = self.noise(point.position)
        here = point.linear.nuisance
        aim = self.likelihood.best_nuisance(point.residuals, point.linear, *noise)
        best = self.likelihood.misfit(point.residuals, here, *noise)
        nuisance = here
        for share in SETTLE_SHARES:
            trial = here + share * (aim - here)
            misfit = self.likelihood.misfit(self.residuals(point.position, trial), trial, *noise)
            better = misfit < best
            best = np.where(better, misfit, best)
            nuisance = np.where(better[..., None], trial, nuisance)
        return self.evaluate(point.position, nuisance)

    def full_log_density(self, position: Array, nuisance: Array | None = None, *, rounds: int = ROUNDS) -> Array:
        """Return (P,) log densities, each position linearised at its own most likely nuisances.

        Args:
            position: (P, D).
            nuisance: (P, W, 9) where the climb to those begins; None: at rest.
            rounds: linearisations at most; 1: where the climb begins, with no climb.
        """
        out = self.log_prior(position)
        legal = np.flatnonzero(np.isfinite(out))
        begin = self.likelihood.at_rest(len(legal)) if nuisance is None else nuisance[legal].copy()
        inside = position[legal]
        if isinstance(self.likelihood.engine, KernelEngine):
            noise = self.noise(inside)
            out[legal] += self.likelihood.marginal(self.rows(inside), *noise, self.delay(inside), begin, rounds=rounds)
            return np.where(np.isfinite(out), out, -np.inf)
        chunk = max(1, CHUNK_VALUES // (self.likelihood.windows.seen.size * 9))
        for first in range(0, len(legal), chunk):
            point = self.evaluate(inside[first : first + chunk], begin[first : first + chunk])
            for _ in range(rounds - 1):
                before, point = point.log_density, self.settle(point)
                if np.all(np.abs(point.log_density - before) < SETTLED):
                    break
            out[legal[first : first + chunk]] = point.log_density
        return np.where(np.isfinite(out), out, -np.inf)


@dataclass(frozen=True)
class FrozenTarget:
    """A target with a linearisation frozen for each chain: (C, D) in, density and memo out.

    The memo is the residuals (C, W, 3N); a move of the noise alone takes them from the chain's state and needs no
    rollout.
    """

    target: Target
    start: Array  # (C, D) positions of positive density
    linear: Linearisation

    def density(self, position: Array, memo: Array | None) -> tuple[Array, Array]:
        """Return log densities (C,) and residuals (C, W, 3N).

        Args:
            position: (C, D).
            memo: residuals of the same physics, or None to simulate.
        """
        out = self.target.log_prior(position)
        legal = np.isfinite(out)
        if memo is None:
            # A position that the prior forbids is simulated as the first that it allows, and then rejected.
            stand_in = np.where(legal[:, None], position, position[np.argmax(legal)])
            if not np.any(legal):
                stand_in = np.repeat(self.start[:1], len(position), axis=0)
            memo = self.target.residuals(stand_in, self.linear.nuisance)
        value = self.target.log_likelihood(position, memo, self.linear)
        return np.where(legal & np.isfinite(value), out + value, -np.inf), memo
