"""Posterior predictive test of a model: whether there is a wrench in its windows that it does not have.

In each window a wrench may act that is straight between three knots. Whitened by the noise, the unknown starts and the
sensor's own error, and freed of all that the model's own parameters could do, the poses split into what such a wrench
would do to a body that nothing else holds (D numbers) and the rest (R numbers). If the model is right both are noise,

    F = (|explained|^2 / D) / (|rest|^2 / R)  ~  F(D, R):

the noise is estimated in the same breath, so that a tag which is a little better or worse than thought is no mismatch.
So is the size of the sensor's own error, up to what was told: with one that is larger than it is, the test would be
blunt and its p-values too high.

What the wrench would do in the model is no measure: a wheel that holds a body where a pin let it go would hold it
against the wrench as well, and the whole misfit would pass for noise.

Of the D numbers some fifteen are what wrenches that last would do (`lasting.py`), the others what only fleeting ones
could: two tests of which the first is the sharper by far for what goes on for long.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2
from scipy.stats import f as f_distribution

from pbrl_mismatch.data.cuts import Cuts, Index
from pbrl_mismatch.kernels import places as at
from pbrl_mismatch.search.climb import Peak
from pbrl_mismatch.search.hypothesis import BELIEVED
from pbrl_mismatch.search.lasting import lasting_wrenches, zero_errors
from pbrl_mismatch.search.objective import START, WRENCH
from pbrl_mismatch.search.p_values import least_of_two, unless_unbelievable

Array = NDArray[np.float64]

KNOTS = 3
"""A wrench is straight between the first, the middle and the last moment of a window."""
TELLING = 0.05
"""A direction that one newton moves by less than this many standard deviations tells nothing."""
FLOORS = (1.0, 0.6, 0.3, 0.1, 0.03)
"""Shares of the sensor's own error that the windows are asked for; the likeliest counts, none is larger than told."""
ENDURES, ZERO = 0.02, 0.07
"""Of the size of a sensor's own error so much may last through a recording in every way: no law of a wheel and no axis
of a sensor is right to a few millinewtons, which a minute tells. And so much its zero may be off in each hold."""
OWN, ALIKE = 0.05, 0.02
"""Of a lasting wrench the model's own parameters leave at least this share; and less of it than this is another's."""


@dataclass(frozen=True)
class Verdict:
    """What the test says.

    Attributes:
        p_value: chance of so large a misfit if the model were right, of any wrench whatever.
        statistic: F.
        explained: D, numbers that a left-out wrench would explain.
        rest: R, numbers that are noise either way.
        noise_scale: root of the mean square of the rest: noise over what was thought.
        lasting: the chance where wrenches that last are looked for.
        fleeting: where those that do not.
        conflict: chance that what is believed of mass, inertia and delay is so far off.
    """

    p_value: float
    statistic: float
    explained: int
    rest: int
    noise_scale: float
    lasting: float = 1.0
    fleeting: float = 1.0
    conflict: float = 1.0

    @property
    def either(self) -> float:
        """Return the chance of so large a misfit to wrenches that last or to others."""
        return unless_unbelievable(least_of_two(self.lasting, self.fleeting), self.conflict)

    @property
    def least(self) -> float:
        """Return the smaller chance, of any wrench or of one that lasts."""
        return min(self.p_value, self.lasting)


def belief_conflict(peak: Peak, row: int) -> float:
    """Return the chance that what is believed of mass, inertia and delay is so far off (chi-square).

    A fit that explains the poses with a mass or a delay that nobody would believe has left something out.
    """
    hypothesis = peak.objective.hypothesis
    off = (peak.coordinates[row] - hypothesis.mean) / hypothesis.spread
    held = [k for k, column in enumerate(hypothesis.columns) if column in BELIEVED]
    return float(chi2.sf(np.sum(off[held] ** 2), len(held))) if held else 1.0


def pushed(cuts: Cuts, mass: float) -> Array:
    """Return how a wrench that is straight between knots moves a body that nothing else holds.

    Args:
        cuts: W windows of N poses.
        mass: of the body [kg].

    Returns:
        (W, 3 N, 3 KNOTS) poses over their noise; for each knot forces along x and y of one newton, and a torque of one
        newton at the radius of gyration.
    """
    gyration, time = cuts.track.gyration, cuts.place * cuts.track.dt
    half = 0.5 * cuts.track.dt * cuts.span[:, 1, None]
    # Twice integrated: what falls from one to nothing at half the window, what rises to there and falls, what rises on.
    rises, rises_on = time**3 / (6.0 * half), np.maximum(time - half, 0.0) ** 3 / (6.0 * half)
    way = np.stack([0.5 * time**2 - rises + rises_on, rises - 2.0 * rises_on, rises_on], -1) / mass
    moved = np.einsum("wnk,ij->wnikj", way, np.diag([1.0, 1.0, 1.0 / gyration])) * cuts.weight[..., None, None]
    return np.asarray(moved.reshape(len(cuts), -1, 3 * KNOTS))


def knots(cuts: Cuts) -> Index:
    """Return the steps (W, KNOTS) of a track at which windows have their knots."""
    share = np.linspace(0.0, 1.0, KNOTS)
    return np.minimum(cuts.span[:, :1] + np.rint(cuts.span[:, 1:2] * share).astype(np.int64), cuts.span[:, 3:])


def predictive_test(peak: Peak, row: int) -> Verdict:
    """Test a fitted model on the windows of its objective.

    Args:
        peak: the fit.
        row: which of its points.
    """
    objective = peak.objective
    cuts = objective.cuts
    u, z = peak.coordinates[row : row + 1], peak.nuisance[row : row + 1]
    linear = objective.linearise(u, z)
    push = pushed(cuts, float(objective.hypothesis.rows(u)[0, at.MASS]))
    steps = knots(cuts)
    usual = (ENDURES * lasting_wrenches(cuts, steps), ZERO * zero_errors(cuts, steps))
    lasting, zero = (objective.floor * each.reshape(len(cuts), push.shape[-1], -1) for each in usual)
    windows = []
    for w in range(len(cuts)):
        seen = cuts.weight[w].reshape(-1) > 0.0
        spread = linear.spread[0, w][seen]
        # The residual that would be left with no nuisance, to first order; its covariance is I + S S^T.
        centred = linear.residual[0, w][seen] + spread @ z[0, w]
        windows.append(_Window(centred, linear.slope[0, w][seen], spread, push[w][seen], lasting[w], zero[w]))
    white = max((_whiten(windows, share) for share in FLOORS), key=lambda each: each.log_likelihood)
    verdict, conflict = _split(white), belief_conflict(peak, row)
    return replace(verdict, p_value=unless_unbelievable(verdict.p_value, conflict), conflict=conflict)


@dataclass(frozen=True)
class _Window:
    """One window: residual (R,), and slopes in parameters (R, K), nuisances (R, NUISANCES) and knots (R, 3 KNOTS).

    Of lasting wrenches and of errors of the sensor's zero there is what each is at the knots (3 KNOTS, L), as large as
    it may be in any recording.
    """

    residual: Array
    slope: Array
    spread: Array
    push: Array
    lasting: Array
    zero: Array


@dataclass(frozen=True)
class _White:
    """All windows, whitened: residual (R,) and own slopes (R, M) as an orthonormal basis, what knots do by window.

    What lasting wrenches and errors of the sensor's zero do (R, L) is beside them.
    """

    residual: Array
    own: Array
    pushes: list[Array]
    lasting: Array
    zero: Array
    log_det: float

    @property
    def free(self) -> Array:
        """Return (R,) the residual without what the model's own parameters could do."""
        return np.asarray(self.residual - self.own @ (self.own.T @ self.residual))

    @property
    def log_likelihood(self) -> float:
        """Return the log likelihood at the best scale of the noise, up to what all floors share [nat]."""
        count = len(self.residual)
        return -0.5 * count * float(np.log(max(np.sum(self.free**2) / count, 1e-12))) - self.log_det


def _whiten(windows: list[_Window], share: float) -> _White:
    """Whiten windows whose sensor has this share of its floor."""
    residual, slopes, pushes, lasting, zero, log_det = [], [], [], [], [], 0.0
    scale = np.array([1.0] * START + [share] * WRENCH)
    for each in windows:
        spread = each.spread * scale
        factor = np.linalg.cholesky(np.eye(len(each.residual)) + spread @ spread.T)
        log_det += float(np.log(np.diag(factor)).sum())
        whiten = np.linalg.inv(factor)
        residual.append(whiten @ each.residual)
        slopes.append(whiten @ each.slope)
        push = whiten @ each.push
        left, size, _ = np.linalg.svd(push, full_matrices=False)
        pushes.append(left[:, size > TELLING])
        lasting.append(push @ each.lasting)
        zero.append(push @ each.zero)
    slope = np.concatenate(slopes)
    norms = np.linalg.norm(slope, axis=0)
    own, strength, _ = np.linalg.svd(slope[:, norms > 0.0] / norms[norms > 0.0], full_matrices=False)
    own = own[:, strength > 1e-6]
    return _White(np.concatenate(residual), own, pushes, np.concatenate(lasting), np.concatenate(zero), log_det)


def _split(white: _White) -> Verdict:
    """Split the whitened residual into what wrenches explain and the rest, both free of the model's own slopes."""
    own, free = white.own, white.free
    basis = np.zeros((len(free), sum(each.shape[1] for each in white.pushes)))
    row = column = 0
    for each in white.pushes:
        basis[row : row + len(each), column : column + each.shape[1]] = each
        row, column = row + len(each), column + each.shape[1]
    basis, upper = np.linalg.qr(basis - own @ (own.T @ basis))
    basis = basis[:, np.abs(np.diag(upper)) > 1e-8]
    explained = basis.T @ free
    d = basis.shape[1]
    r = max(len(free) - d - own.shape[1], 1)
    noise = float(np.sum((free - basis @ explained) ** 2)) / r
    if d == 0:
        return Verdict(1.0, 0.0, 0, r, math.sqrt(noise))
    squares, least = float(np.sum(explained**2)), max(noise, 1e-12)
    inside, usual = _lasting(white, basis)
    last = inside.T @ explained
    enduring = float(last @ np.linalg.solve(least * np.eye(len(last)) + usual, last))

    def chance(squares: float, count: int) -> float:
        return float(f_distribution.sf(max(squares, 0.0) / count, count, r)) if count else 1.0

    return Verdict(
        chance(squares / least, d),
        squares / d / least,
        d,
        r,
        math.sqrt(noise),
        chance(enduring, len(last)),
        chance((squares - float(last @ last)) / least, d - len(last)),
    )


def _lasting(white: _White, basis: Array) -> tuple[Array, Array]:
    """Return what lasting wrenches do: a basis (D, L') within one (R, D) of any, and their usual covariance in it."""
    whole = np.linalg.norm(white.lasting, axis=0)
    lasting = basis.T @ white.lasting
    free = np.linalg.norm(lasting, axis=0) > OWN * whole
    left, size, _ = np.linalg.svd(lasting[:, free] / whole[free], full_matrices=False)
    inside = np.asarray(left[:, size > ALIKE])
    usual = inside.T @ np.column_stack([lasting, basis.T @ white.zero])
    return inside, np.asarray(usual @ usual.T)
