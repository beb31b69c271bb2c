"""The posterior of one body's model given its transitions (thesis equations 21, 24-26 and 29), as `infer` wants it.

Every transition is simulated from its observed state before; the simulation's end and the observed state after differ
by Gaussian noise of one scale sigma, the object's own (equation 29), in every component: angles count by the body's
radius of gyration, so that a turn weighs as much as the body's mass moves by it. Angles are compared within half a
turn, which the thesis leaves out.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pbrl_model.distributions import LOG_2PI
from pbrl_model.errors import ModelError
from pbrl_model.geometry import MassProperties
from pbrl_model.rollout import rollout_states
from pbrl_model.transitions.classes import TransitionClass
from pbrl_model.transitions.data import BodyTransitions, state_scale

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

CHUNK_STATES = 40_000  # states that a rollout writes at once: what fits in a core's cache is written fast
STEP_SLACK = 1e-6  # [s] a duration may differ from a whole number of steps


class TransitionProblem:
    """A class's posterior.

    Args:
        kind: the class.
        data: the body's transitions, at least one.
        body: mass properties of the footprint.
        dt: step of the simulation [s].
        parallel: whether rollouts may use all cores.
    """

    def __init__(
        self, kind: TransitionClass, data: BodyTransitions, body: MassProperties, dt: float, *, parallel: bool
    ) -> None:
        self._kind, self._data, self._body = kind, data, body
        self._dt, self._parallel = dt, parallel
        self._scale = state_scale(math.sqrt(body.inertia_per_mass))
        self.names = kind.prior.names
        self.bounds = kind.prior.bounds
        self.periodic: Flags = kind.prior.periodic
        self.noise_column: int | None = len(self.names) - 1

    def sample_prior(self, rng: np.random.Generator, n: int) -> Array:
        """Draw (n, D) from the prior."""
        return self._kind.prior.sample(rng, n)

    def log_prior(self, theta: Array) -> Array:
        """Return (P,) log prior densities [nat]."""
        return self._kind.prior.log_prob(theta)

    def log_likelihood(self, theta: Array) -> Array:
        """Return (P,) log likelihoods [nat] of the states after, densities in their own units."""
        residuals = self.residuals(theta)
        count = residuals.shape[1]
        squares = np.einsum("pm,pm->p", residuals, residuals)
        log_sigma = theta[:, -1]
        constant = len(self._data) * float(np.log(self._scale).sum()) - 0.5 * count * LOG_2PI
        return constant - count * log_sigma - 0.5 * squares * np.exp(-2.0 * log_sigma)

    def residuals(self, theta: Array, share: float = 1.0) -> Array:
        """Return (P, 6 n) observed minus simulated, in metres; all of them whatever the share, they are short."""
        rows = self._kind.rows(theta, self._data.start, self._body.com)
        end = simulate(
            rows,
            self._data.start,
            self._data.wrench,
            self._data.duration,
            self._body,
            self._dt,
            parallel=self._parallel,
        )
        gap = self._data.end - end
        gap[..., 2] -= 2.0 * np.pi * np.round(gap[..., 2] / (2.0 * np.pi))
        gap *= self._scale
        return gap.reshape(len(theta), -1)

    def images(self, theta: Array) -> Array:
        """Return (S, P, D) all descriptions of the same bodies."""
        return self._kind.images(theta)


def simulate(
    rows: Array, start: Array, wrench: Array, duration: Array, body: MassProperties, dt: float, *, parallel: bool
) -> Array:
    """Simulate transitions under parameter rows.

    Args:
        rows: (P, 12) kernel rows.
        start: (n, 6) states of the centre of mass, or (P, n, 6) if they differ between rows.
        wrench: (n, 3) at the centre of mass, world axes, constant over each transition.
        duration: (n,) whole numbers of steps [s].
        body: mass properties of the footprint.
        dt: step [s].
        parallel: whether all cores may be used.

    Returns:
        (P, n, 6) states after.

    Raises:
        ModelError: a duration is no whole number of steps, or the simulation is not finite.
    """
    steps = step_counts(duration, dt)
    longest = int(steps.max(initial=1))
    pushes = np.repeat(wrench[:, None], longest, axis=1)
    out = np.empty((len(rows), len(wrench), 6))
    share = max(1, CHUNK_STATES // max(1, len(wrench) * (longest + 1)))
    every = np.arange(len(wrench))
    for first in range(0, len(rows), share):
        some = rows[first : first + share]
        here = start if start.ndim == 2 else start[first : first + share]
        states = rollout_states(some, here, pushes, body.inertia_per_mass, body.com, dt, steps, parallel=parallel)
        out[first : first + share] = states[:, every, steps]
    return out


def step_counts(duration: Array, dt: float) -> NDArray[np.int64]:
    """Return (n,) how many steps durations (n,) are.

    Raises:
        ModelError: one of them is no whole number of steps.
    """
    steps = np.maximum(np.round(duration / dt), 1.0).astype(np.int64)
    off = np.abs(steps * dt - duration)
    if off.size and off.max() > STEP_SLACK:
        raise ModelError(
            f"transitions: expected durations of whole steps of {dt:g} s, got {duration[int(off.argmax())]:g} s; "
            f"choose a dt that divides them"
        )
    return steps
