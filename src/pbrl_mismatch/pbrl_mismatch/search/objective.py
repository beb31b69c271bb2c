"""Misfit of a hypothesis over windows, with what is unknown in each window eliminated.

In each window w the poses depend on the coordinates u and on nine nuisances z_w: six of the start, and a wrench that
is constant over the window in the body's axes, of the size that a sensor's own error has; all with unit Gaussian
priors. What is minimised is

    sum_w ((|r_w|^2 + |z_w|^2) / s_w^2 + 2 n_w ln s_w) + |(u - m) / s|^2,

r_w the n_w residuals over their noise. Linearised, each z_w is solved for and put back (Schur complement): what is left
are normal equations in u alone. A scale s_w of at least one, its best in each window, widens everything where a model
leaves much unexplained: what no law has right, a knock, a foot that sticks, then counts for what it is and no more.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.data.simulation import poses
from pbrl_mismatch.search.hypothesis import Hypothesis, step_sizes

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

START, WRENCH = 6, 3
NUISANCES = START + WRENCH
START_STEP, WRENCH_STEP = 0.05, 1.0
"""Finite differences in the nuisances, in standard deviations."""
CHUNK = 3_000_000
"""Simulated numbers that are held at once."""


@dataclass(frozen=True)
class Linear:
    """A hypothesis linearised at P points.

    Attributes:
        residual: (P, W, R) recorded minus simulated, over noise.
        slope: (P, W, R, K) of the simulated poses over noise, in u.
        spread: (P, W, R, NUISANCES) the same in z.
    """

    residual: Array
    slope: Array
    spread: Array


@dataclass(frozen=True)
class Objective:
    """Misfit of one hypothesis over one set of windows.

    Attributes:
        hypothesis: what is free.
        cuts: W windows.
        floor: size of a sensor's own error [N]; as a torque, times the radius of gyration.
        even: whether all windows have the same scale, as in a common least-squares fit.
    """

    hypothesis: Hypothesis
    cuts: Cuts
    floor: float
    even: bool = False

    @property
    def observations(self) -> int:
        """Return how many numbers were observed."""
        return self.cuts.observations

    def at_rest(self, count: int) -> Array:
        """Return nuisances (count, W, NUISANCES) of zero."""
        return np.zeros((count, len(self.cuts), NUISANCES))

    def _simulated(self, rows: Array, nuisance: Array, asked: Mask | None = None) -> Array:
        """Return (P, W, N, 3) simulated poses, of windows (P, W) that are asked."""
        track = self.cuts.track
        told = self.cuts.told + np.einsum("wkl,pwl->pwk", self.cuts.root, nuisance[..., :START])
        scale = self.floor * np.array([1.0, 1.0, track.gyration])
        return poses(rows, self.cuts, told, (nuisance[..., START:] * scale)[:, :, None, :], asked)

    def _residual(self, found: Array) -> Array:
        difference = self.cuts.pose - found
        difference[..., 2] -= 2 * np.pi * np.round(difference[..., 2] / (2 * np.pi))
        with np.errstate(invalid="ignore"):  # a law that runs away is cut off below
            bounded = np.nan_to_num(difference * self.cuts.weight, nan=1e6, posinf=1e6, neginf=-1e6)
        return np.clip(bounded, -1e6, 1e6).reshape(len(found), len(self.cuts), -1)

    def residual(self, coordinates: Array, nuisance: Array) -> Array:
        """Return (P, W, R) residuals over noise, zero where nothing was seen.

        Args:
            coordinates: (P, K).
            nuisance: (P, W, NUISANCES).
        """
        return self._residual(self._simulated(self.hypothesis.rows(coordinates), nuisance))

    def residual_of(self, asked: Mask, coordinates: Array, nuisance: Array) -> Array:
        """Return (n, R) residuals as `residual` does, of the n windows (P, W) alone that are asked."""
        return self._residual(self._simulated(self.hypothesis.rows(coordinates), nuisance, asked))[asked]

    @property
    def counts(self) -> Array:
        """Return (W,) how many numbers were observed in each window."""
        return np.maximum(np.sum(self.cuts.weight > 0.0, axis=(1, 2)), 1).astype(float)

    def misfit(self, residual: Array, nuisance: Array) -> Array:
        """Return (P, W) the data's part: squares of residuals and nuisances."""
        return np.sum(residual**2, axis=-1) + np.sum(nuisance**2, axis=-1)

    def weights(self, misfit: Array) -> Array:
        """Return (P, W) one over the square of each window's scale: its best one that is at least one."""
        counts = self.counts
        if self.even:
            misfit = np.broadcast_to(misfit.sum(axis=1, keepdims=True) / counts.sum() * counts, misfit.shape)
        return 1.0 / np.maximum(1.0, misfit / counts)

    def likelihood(self, misfit: Array) -> Array:
        """Return (P,) log likelihoods at the windows' best scales, up to a constant of the windows [nat]."""
        weight = self.weights(misfit)
        return np.sum(-0.5 * misfit * weight + 0.5 * self.counts * np.log(weight), axis=1)

    def prior_misfit(self, coordinates: Array) -> Array:
        """Return (P,) squares of the coordinates over their prior."""
        return np.sum(((coordinates - self.hypothesis.mean) / self.hypothesis.spread) ** 2, axis=1)

    def linearise(self, coordinates: Array, nuisance: Array, spread: Array | None = None) -> Linear:
        """Take finite differences in every coordinate and nuisance, as many rows in one call as fit.

        Args:
            coordinates: (P, K).
            nuisance: (P, W, NUISANCES).
            spread: (P, W, R, NUISANCES) slopes in the nuisances from a point nearby; None: taken anew.
        """
        count, free = coordinates.shape
        steps = step_sizes(self.hypothesis)
        loose = NUISANCES if spread is None else 0
        moves = 1 + free + loose
        u = np.repeat(coordinates, moves, axis=0).reshape(count, moves, free)
        z = np.repeat(nuisance, moves, axis=0).reshape(count, moves, *nuisance.shape[1:])
        for k in range(free):
            u[:, 1 + k, k] += steps[k]
        nuisance_steps = np.array([START_STEP] * START + [WRENCH_STEP] * WRENCH)
        for k in range(loose):
            z[:, 1 + free + k, :, k] += nuisance_steps[k]
        flat, flat_z = u.reshape(-1, free), z.reshape(-1, *nuisance.shape[1:])
        rows = self.hypothesis.rows(flat)
        size = max(1, CHUNK // (self.cuts.pose.size * moves)) * moves
        found = np.concatenate(
            [self._simulated(rows[a : a + size], flat_z[a : a + size]) for a in range(0, len(rows), size)]
        ).reshape(count, moves, *self.cuts.pose.shape)
        residual = self._residual(found[:, 0])
        with np.errstate(invalid="ignore"):
            change = (found[:, 1:] - found[:, :1]) * self.cuts.weight
        change = np.clip(np.nan_to_num(change), -1e5, 1e5).reshape(count, moves - 1, len(self.cuts), -1)
        change /= np.concatenate([steps, nuisance_steps[:loose]])[:, None, None]
        change = np.moveaxis(change, 1, -1)
        return Linear(residual, change[..., :free], change[..., free:] if spread is None else spread)


@cache
def scattered(count: float) -> float:
    """Return how much a window of so many numbers costs on average by its best scale, were all of it noise [nat].

    The misfit is then a chi-square with as many degrees of freedom, whatever the window's nuisances are; half of such
    windows scatter above one a number, about half the square root of count / pi is paid for it.
    """
    tail = np.polynomial.legendre.leggauss(64)
    above, weight = 0.5 * (tail[0] + 1.0) * chi2.sf(count, count), 0.5 * tail[1] * chi2.sf(count, count)
    return float(0.5 * count * (weight @ np.log(chi2.isf(above, count) / count)))


@dataclass(frozen=True)
class Reduced:
    """Normal equations with the nuisances put back.

    Attributes:
        matrix: (P, W, K, K) of the data, not scaled, no prior.
        vector: (P, W, K) likewise.
        gain: (P, W, NUISANCES, K) how the best nuisances follow the coordinates.
        shift: (P, W, NUISANCES) step of the nuisances for no step of the coordinates.
        log_det: (P,) log determinants of the nuisances' matrices, summed.
    """

    matrix: Array
    vector: Array
    gain: Array
    shift: Array
    log_det: Array

    def weighed(self, weight: Array) -> tuple[Array, Array]:
        """Return matrix (P, K, K) and vector (P, K) with a weight (P, W) for each window."""
        return np.einsum("pw,pwkl->pkl", weight, self.matrix), np.einsum("pw,pwk->pk", weight, self.vector)

    def take(self, rows: NDArray[np.int64]) -> Reduced:
        """Return those of some points."""
        return Reduced(self.matrix[rows], self.vector[rows], self.gain[rows], self.shift[rows], self.log_det[rows])

    @classmethod
    def room(cls, points: int, windows: int, free: int) -> Reduced:
        """Return those of no point yet, to be put in."""
        return cls(
            np.empty((points, windows, free, free)),
            np.empty((points, windows, free)),
            np.empty((points, windows, NUISANCES, free)),
            np.empty((points, windows, NUISANCES)),
            np.empty(points),
        )

    def put(self, rows: NDArray[np.int64], other: Reduced) -> None:
        """Write others in place of some points'."""
        for name, value in vars(other).items():
            getattr(self, name)[rows] = value


def nuisance_step(spread: Array, residual: Array, nuisance: Array) -> tuple[Array, Array]:
    """Step to the best nuisances, coordinates kept.

    Args:
        spread: (..., R, NUISANCES) slopes of windows.
        residual: (..., R).
        nuisance: (..., NUISANCES).

    Returns:
        The steps (..., NUISANCES), and by how much (...) the misfits would fall, were all linear.
    """
    spread_t = np.swapaxes(spread, -1, -2)
    pull = (spread_t @ residual[..., None])[..., 0] - nuisance
    step = np.linalg.solve(spread_t @ spread + np.eye(NUISANCES), pull[..., None])[..., 0]
    return np.asarray(step, dtype=np.float64), np.sum(pull * step, axis=-1)


def reduce(linear: Linear, nuisance: Array) -> Reduced:
    """Eliminate the nuisances (P, W, NUISANCES) from a linearisation."""
    spread_t = np.swapaxes(linear.spread, -1, -2)
    slope_t = np.swapaxes(linear.slope, -1, -2)
    inner = spread_t @ linear.spread + np.eye(NUISANCES)
    cross = spread_t @ linear.slope
    pull = (spread_t @ linear.residual[..., None])[..., 0] - nuisance
    solved = np.linalg.solve(inner, np.concatenate([cross, pull[..., None]], -1))
    gain, shift = solved[..., :-1], solved[..., -1]
    cross_t = np.swapaxes(cross, -1, -2)
    matrix = slope_t @ linear.slope - cross_t @ gain
    vector = (slope_t @ linear.residual[..., None])[..., 0] - (cross_t @ shift[..., None])[..., 0]
    _, log_det = np.linalg.slogdet(inner)
    return Reduced(0.5 * (matrix + np.swapaxes(matrix, -1, -2)), vector, gain, shift, np.sum(log_det, axis=1))
