"""How likely recorded poses are under a model: windows with the unknown start integrated out.

In each window the simulated poses depend on the start state and on whatever the model leaves out. Both are
nuisances z with a Gaussian prior: the start from the smoother, and a wrench that is constant over a window in the
body's axes, as a rolling resistance or a sensor's bias is. To first order the residual is r(phi) - S z, with S from
finite differences on the simulation, so that

    r ~ Normal(0, sigma^2 R + S Q S^T),    Q = diag(P0, drag^2 (1, 1, lever^2)),

R from the noise of the poses as the smoother found it, sigma a scale that lets model error widen it, one for each
object (thesis 29), drag the size of the left-out force [N]. A left-out force of some newtons bends a window of two
seconds more than a line can follow, so S is taken at the most likely nuisances (Gauss-Newton): `marginal` finds them
anew for every row, compiled; a Metropolis chain keeps those of the mode it began at, ten times cheaper.
One more unknown is common to all windows and no Gaussian: how late the poses come after the wrenches.
With P0 = 0 and drag = 0 this is the thesis's likelihood: (25) over one-step windows, (39) over whole episodes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pbrl_model.engines.windowed import KernelEngine, MakeEngine, lever
from pbrl_model.fitting.marginal_kernel import FORCE_STEP, NUISANCES, START_STEP, marginal_parallel, marginal_serial
from pbrl_model.geometry import MassProperties
from pbrl_model.rollout import KERNEL_LOCK
from pbrl_model.sensing.windows import Windows

Array = NDArray[np.float64]

SERIAL_STEPS = 20_000
"""Below this many body steps in a linearisation of all rows, waking the other cores costs more than it saves."""
ROUNDS = 4
"""Linearisations at most on the way to the most likely nuisances of a window."""


@dataclass(frozen=True)
class Linearisation:
    """The simulated poses as a linear function of the nuisances, for each of P parameter rows.

    Attributes:
        nuisance: (P, W, 9) where it was taken: six of the start, in standard deviations, three of the force [N].
        sensitivities: (P, W, 3N, 9) of the simulated poses over noise.
    """

    nuisance: Array
    sensitivities: Array

    @cached_property
    def gram(self) -> Array:
        """Return S^T S of every row and window, (P, W, 9, 9): a sampler asks for it thousands of times."""
        return np.swapaxes(self.sensitivities, -1, -2) @ self.sensitivities

    def take(self, rows: NDArray[np.int64]) -> Linearisation:
        """Return that of some of the rows."""
        return Linearisation(self.nuisance[rows], self.sensitivities[rows])


class WindowedLikelihood:
    """Likelihood of kernel rows over windows.

    Args:
        body: centre of mass and inertia over mass.
        windows: what was recorded.
        with_drag: whether a constant wrench of unknown size is left out in each window.
        make_engine: of what simulates.
    """

    def __init__(
        self,
        body: MassProperties,
        windows: Windows,
        *,
        with_drag: bool = True,
        make_engine: MakeEngine = KernelEngine,
    ) -> None:
        self.body = body
        self.lever = lever(body)
        self.windows = windows
        self.with_drag = with_drag
        self.engine = make_engine(body, windows)
        self._count = np.array([int(seen.sum()) for seen in windows.seen])
        self._weight = windows.seen / windows.noise[:, None, :]
        self._log_noise = float(np.sum(windows.seen * np.log(windows.noise)[:, None, :]))
        values, vectors = np.linalg.eigh(windows.covariance)
        self._root = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
        self._free_start = bool(np.any(windows.covariance))
        self.has_nuisance = with_drag or self._free_start
        self._constant = -0.5 * float(self._count.sum()) * math.log(2 * np.pi) - self._log_noise

    def with_engine(self, make_engine: MakeEngine) -> WindowedLikelihood:
        """Return the same likelihood with another simulation behind it."""
        return WindowedLikelihood(self.body, self.windows, with_drag=self.with_drag, make_engine=make_engine)

    def at_rest(self, count: int) -> Array:
        """Return nuisances (count, W, 9) of zero: the start as smoothed, nothing left out."""
        return np.zeros((count, len(self.windows), NUISANCES))

    def simulate(self, rows: Array, nuisance: Array, delay: Array | None = None) -> Array:
        """Return (P, W, N, 3) simulated poses at the recorded times.

        Args:
            rows: (P, 12) kernel rows.
            nuisance: (P, W, 9), see `Linearisation`.
            delay: (P,) by how much poses come after wrenches [s]; None: as the windows were made for.
        """
        initial = self.windows.initial + np.einsum("wkl,pwl->pwk", self._root, nuisance[..., :6])
        return self.engine.poses(rows, initial, nuisance[..., 6:], self._late(rows, delay))

    def _late(self, rows: Array, delay: Array | None) -> Array:
        return np.zeros(len(rows)) if delay is None else delay - self.windows.delay

    def residuals(self, rows: Array, nuisance: Array, delay: Array | None = None, base: Array | None = None) -> Array:
        """Return (P, W, 3N) recorded minus simulated over noise, angles wrapped, zero where nothing was seen.

        Args:
            rows: (P, 12) kernel rows.
            nuisance: (P, W, 9).
            delay: (P,) see `simulate`.
            base: (P, W, N, 3) result of `simulate`, where it is at hand.
        """
        difference = self.windows.pose - (self.simulate(rows, nuisance, delay) if base is None else base)
        difference[..., 2] -= 2 * np.pi * np.round(difference[..., 2] / (2 * np.pi))
        return (difference * self._weight).reshape(len(rows), len(self.windows), -1)

    def linearise(
        self, rows: Array, nuisance: Array, delay: Array | None = None, base: Array | None = None
    ) -> Linearisation:
        """Take differences in every nuisance; arguments as of `residuals`."""
        base = self.simulate(rows, nuisance, delay) if base is None else base
        out = np.zeros((*base.shape[:2], base.shape[2] * 3, NUISANCES))
        for k in range(NUISANCES):
            if not (self.with_drag if k >= 6 else self._free_start):
                continue
            step = FORCE_STEP if k >= 6 else START_STEP
            moved = nuisance.copy()
            moved[..., k] += step
            change = (self.simulate(rows, moved, delay) - base) * (self._weight / step)[None]
            out[..., k] = change.reshape(*base.shape[:2], -1)
        return Linearisation(nuisance, out)

    def marginal(
        self, rows: Array, sigma: Array, drag: Array, delay: Array, nuisance: Array, *, rounds: int = ROUNDS
    ) -> Array:
        """Return (P,) log likelihoods, each linearised at its own most likely nuisances; compiled, kernel only.

        Args:
            rows: (P, 12) kernel rows.
            sigma: (P,) scale of the pose noise.
            drag: (P,) scale of the left-out force [N].
            delay: (P,) see `simulate`.
            nuisance: (P, W, 9) where the climb begins; moved to where it ends.
            rounds: linearisations at most; 1: at `nuisance`, which stays.

        Raises:
            TypeError: the engine is not the kernel.
        """
        engine = self.engine
        if not isinstance(engine, KernelEngine):
            raise TypeError(f"marginal: expected the kernel as engine, got {type(engine).__name__}")
        out = np.empty(len(rows))
        arguments = (
            np.ascontiguousarray(rows),
            self.windows.initial,
            self._root,
            drag,
            sigma,
            self._late(rows, delay),
            engine.forcing,
            self.windows.steps,
            engine.place,
            engine.constants,
            self.windows.pose,
            self._weight,
            self.with_drag,
            rounds,
            nuisance,
            out,
        )
        if len(rows) > 1 and NUISANCES * len(rows) * int(self.windows.steps.sum()) > SERIAL_STEPS:
            with KERNEL_LOCK:
                marginal_parallel(*arguments)
        else:
            marginal_serial(*arguments)
        return out + self._constant

    def best_nuisance(self, residuals: Array, linear: Linearisation, sigma: Array, drag: Array) -> Array:
        """Return (P, W, 9) the most likely nuisances, to linearise again at.

        Args:
            residuals: (P, W, 3N) at the linearisation's own nuisances.
            linear: of the same rows.
            sigma: (P,) scale of the pose noise.
            drag: (P,) scale of the left-out force [N].
        """
        scale = self._scale(drag)[:, None, :]
        scaled = linear.sensitivities * scale[:, :, None, :]
        transposed = np.swapaxes(scaled, -1, -2)
        inner = transposed @ scaled + (sigma**2)[:, None, None, None] * np.eye(NUISANCES)
        offset = self._centred(residuals, linear)
        return np.linalg.solve(inner, transposed @ offset[..., None])[..., 0] * scale

    def misfit(self, residuals: Array, nuisance: Array, sigma: Array, drag: Array) -> Array:
        """Return (P, W) what the nuisances of each window would make small: residuals and their own priors' squares."""
        scaled = nuisance / self._scale(drag)[:, None, :]
        return np.sum(residuals**2, axis=-1) / sigma[:, None] ** 2 + np.sum(scaled**2, axis=-1)

    @staticmethod
    def _centred(residuals: Array, linear: Linearisation) -> Array:
        """Return what the residuals would be, to first order, with no nuisance."""
        return residuals + (linear.sensitivities @ linear.nuisance[..., None])[..., 0]

    def log_density(self, residuals: Array, linear: Linearisation, sigma: Array, drag: Array) -> Array:
        """Return the log likelihood of residuals.

        Args:
            residuals: (P, W, 3N) of `residuals`, at the linearisation's nuisances.
            linear: of P rows, or of one that all share.
            sigma: (P,) scale of the pose noise.
            drag: (P,) scale of the left-out force [N].

        Returns:
            (P,) with the windows' own constants, so that different models can be compared.
        """
        variance = sigma[:, None] ** 2
        if not self.has_nuisance:
            squares = np.sum(residuals**2, axis=-1)
            return self._constant - 0.5 * np.sum(squares / variance + self._count * np.log(variance), axis=-1)
        offset = self._centred(residuals, linear)
        scale = self._scale(drag)
        inner = linear.gram * (scale[:, None, :, None] * scale[:, None, None, :])
        inner = inner + variance[..., None, None] * np.eye(NUISANCES)
        projected = (np.swapaxes(linear.sensitivities, -1, -2) @ offset[..., None])[..., 0] * scale[:, None, :]
        factor = np.linalg.cholesky(inner)
        half = np.linalg.solve(factor, projected[..., None])[..., 0]
        quadratic = (np.sum(offset**2, axis=-1) - np.sum(half**2, axis=-1)) / variance
        log_det = 2 * np.sum(np.log(np.diagonal(factor, axis1=-2, axis2=-1)), axis=-1)
        log_det = log_det + (self._count - NUISANCES) * np.log(variance)
        return self._constant - 0.5 * np.sum(quadratic + log_det, axis=-1)

    def normal_equations(
        self, residuals: Array, derivatives: Array, linear: Linearisation, sigma: Array, drag: Array
    ) -> tuple[Array, Array]:
        """Return (P, K, K) and (P, K): J^T C^-1 J and J^T C^-1 r, summed over windows.

        Args:
            residuals: (P, W, 3N).
            derivatives: (P, W, 3N, K) of the simulated poses over noise.
            linear: of the same rows.
            sigma: (P,) scale of the pose noise.
            drag: (P,) scale of the left-out force [N].
        """
        centred = self._centred(residuals, linear) if self.has_nuisance else residuals
        columns = np.concatenate([derivatives, centred[..., None]], -1)
        transposed = np.swapaxes(columns, -1, -2)
        variance = sigma[:, None, None, None] ** 2
        product = transposed @ columns
        if self.has_nuisance:
            scaled = linear.sensitivities * self._scale(drag)[:, None, None, :]
            inner = np.swapaxes(scaled, -1, -2) @ scaled + variance * np.eye(NUISANCES)
            along = np.swapaxes(scaled, -1, -2) @ columns
            product = product - np.swapaxes(along, -1, -2) @ np.linalg.solve(inner, along)
        total = np.sum(product / variance, axis=1)
        return total[:, :-1, :-1], total[:, :-1, -1]

    @staticmethod
    def _scale(drag: Array) -> Array:
        scale = np.ones((len(drag), NUISANCES))
        scale[:, 6:] = drag[:, None]
        return scale
