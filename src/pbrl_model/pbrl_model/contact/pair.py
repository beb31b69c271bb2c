"""Contact friction of two bodies: both simulated together, the held one tied softly to where it was seen.

Replaying the gripper's forces open loop would not do: a table held behind and pushed against in front folds as a column
does, several times a second. So the held body gets the wrench that was felt, and a weak spring and damper towards its
smoothed path. What the spring has to do, beside poses of the pushed body, is what the model gets wrong, and is compared
with zero: with the true coefficient neither has anything to explain.

Nuisances of each window, with Gaussian priors: start of the pushed body (6), place of the held one (3: an error in
vision shifts the contact), left-out bias of the sensor (3). To first order the residual is r - S z; z is integrated out
as in `likelihood.py`, with S frozen at the most likely nuisances of the first guess.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_model.contact.episodes import Touch
from pbrl_model.contact.wrench import HeldBody, felt_wrench
from pbrl_model.engines.contact_world import CONTACT_COLUMNS, ContactScene, frame_poses, rollout_contact
from pbrl_model.sensing.windows import Windows, shooting_windows

Array = NDArray[np.float64]

PAIR_NAMES = ("restitution", "contact_friction")
SPRING_RATE, SPRING_DAMPING = 10.0, 0.8
"""The tie's frequency [rad/s], faster than the column folds, and its damping ratio."""
HOLD = 4
"""Steps between which the tie's wrench is held."""
BIN = 0.25
"""The tie's wrench counts as means over so long [s]."""
OFFSET = np.array([2e-3, 2e-3, 5e-3])
"""Standard deviation of an error in vision that lasts a window [m, m, rad]."""
LEFT_BIAS = np.array([0.7, 0.7, 0.15])
"""Standard deviation of the sensor's bias that is left in a window [N, N, N m]."""
FORCE_NOISE = np.array([0.5, 0.5, 0.1])
"""Least standard deviation of a mean of the tie's wrench [N, N, N m]."""
ITERATIONS = 30
"""Sweeps of the solver: two bodies in touch need no more."""
NUISANCES = 12
STARTS, OFFSETS, BIASES = slice(0, 6), slice(6, 9), slice(9, 12)
DIFFERENCE = 0.3
"""Finite difference in a nuisance, in standard deviations: wider than the kinks that contacts make."""
ROUNDS = 3
GUESS = 0.4
GRID = 60
"""Values of the contact friction that are compared."""
THETAS = 8
"""So many draws of the pushed body's parameters are averaged over."""


@dataclass(frozen=True)
class _Window:
    """What is known of the held body in each of W windows of T steps.

    Attributes:
        path: (W, T + 1, 6) smoothed states of its centre of mass, the last repeated after a window's end.
        felt: (W, T, 3) wrench of the grippers, zero after a window's end.
        force_sd: (W, 3) standard deviation of a bin's mean of the tie's wrench.
    """

    path: Array
    felt: Array
    force_sd: Array


class PairLikelihood:
    """Likelihood of pushed bodies and pairs' coefficients over windows in which two bodies touch.

    Args:
        scene: footprints of both, the held one first.
        held: what is known of the held body.
        touches: with the motions of both.
        window: length of a window [s].
    """

    def __init__(self, scene: ContactScene, held: HeldBody, touches: Sequence[Touch], window: float) -> None:
        self.scene = scene
        self.windows = shooting_windows([touch.pushed for touch in touches], window)
        inertia = held.parameters.mass * np.array([1.0, 1.0, held.body.inertia_per_mass])
        self._spring, self._damper = SPRING_RATE**2 * inertia, 2.0 * SPRING_DAMPING * SPRING_RATE * inertia
        self._held = _held_windows(held, touches, self.windows, self._spring)
        self._held_row = np.append(held.parameters.to_vector(), [1.0, 1.0])  # Chipmunk multiplies coefficients
        values, vectors = np.linalg.eigh(self.windows.covariance)
        self._root = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
        self._weight = self.windows.seen / self.windows.noise[:, None, :]
        steps = int(self.windows.steps.max())
        inside = (np.arange(steps) < self.windows.steps[:, None]).astype(float)
        bins = np.arange(max(1, math.ceil(steps * self.windows.dt / BIN)))
        member = ((np.arange(steps) * self.windows.dt / BIN).astype(int) == bins[:, None]) * inside[:, None, :]
        counts = member.sum(-1, keepdims=True)
        self._averages = member / np.maximum(counts, 1.0)  # (W, bins, T)
        self._binned = (counts > 0)[..., 0]  # (W, bins)

    def at_rest(self, count: int) -> Array:
        """Return nuisances (count, W, 12) of zero."""
        return np.zeros((count, len(self.windows), NUISANCES))

    def simulate(self, rows: Array, nuisance: Array) -> tuple[Array, Array]:
        """Return poses (P, W, N, 3) of the pushed frame, and the tie's wrench (P, W, T, 3) in the held body's axes.

        Args:
            rows: (P, 14) of the pushed body, `CONTACT_COLUMNS`, the pair's coefficients last.
            nuisance: (P, W, 12) in standard deviations.
        """
        w, shape = self.windows, (len(rows), len(self.windows))
        worlds, steps = shape[0] * shape[1], self._held.felt.shape[1]
        parameters = np.empty((*shape, 2, len(CONTACT_COLUMNS)))
        parameters[:, :, 0], parameters[:, :, 1] = self._held_row, rows[:, None]
        told = parameters.reshape(worlds, 2, -1)
        wanted = np.repeat(self._held.path[None], shape[0], axis=0)
        wanted[..., :3] += (nuisance[..., OFFSETS] * OFFSET)[:, :, None, :]
        initial = np.empty((*shape, 2, 6))
        initial[:, :, 0] = wanted[:, :, 0]
        initial[:, :, 1] = w.initial + np.einsum("wkl,pwl->pwk", self._root, nuisance[..., STARTS])
        state = initial.reshape(worlds, 2, 6)
        path, tie = np.empty((*shape, steps + 1, 6)), np.empty((*shape, steps, 3))
        path[:, :, 0] = initial[:, :, 1]
        for first in range(0, steps, HOLD):
            last = min(first + HOLD, steps)
            off = wanted[:, :, first] - state.reshape(*shape, 2, 6)[:, :, 0]
            pull = self._spring * off[..., :3] + self._damper * off[..., 3:]
            tie[:, :, first:last] = pull[:, :, None]
            wrench = np.zeros((*shape, last - first, 2, 3))
            wrench[:, :, :, 0] = self._held.felt[:, first:last] + pull[:, :, None]
            moved = rollout_contact(
                self.scene, told, state, wrench.reshape(worlds, -1, 2, 3), w.dt, iterations=ITERATIONS
            )
            path[:, :, first + 1 : last + 1] = moved[:, 1:, 1].reshape(*shape, last - first, 6)
            state = np.ascontiguousarray(moved[:, -1])
        frames = frame_poses(self.scene, np.repeat(path[..., None, :], 2, axis=-2))[..., 1, :]
        which = np.arange(len(w))[:, None]
        before, after = frames[:, which, w.step], frames[:, which, w.step + 1]
        return before + w.fraction[..., None] * (after - before), self._in_body_axes(tie)

    def _in_body_axes(self, wrench: Array) -> Array:
        c, s = np.cos(self._held.path[:, :-1, 2]), np.sin(self._held.path[:, :-1, 2])
        x, y, turn = np.moveaxis(wrench, -1, 0)
        return np.stack([c * x + s * y, -s * x + c * y, turn], -1)

    def residuals(self, rows: Array, nuisance: Array) -> Array:
        """Return (P, W, M): poses and the tie's mean wrenches over their noise; zero where nothing was seen."""
        poses, tie = self.simulate(rows, nuisance)
        difference = self.windows.pose - poses
        difference[..., 2] -= 2 * np.pi * np.round(difference[..., 2] / (2 * np.pi))
        mean = np.einsum("wbt,pwtk->pwbk", self._averages, tie)
        mean = mean + (nuisance[..., BIASES] * LEFT_BIAS)[:, :, None, :] * self._binned[..., None]
        parts = difference * self._weight, mean / self._held.force_sd[:, None, :]
        return np.concatenate([part.reshape(*part.shape[:2], -1) for part in parts], axis=-1)

    def sensitivities(self, row: Array, nuisance: Array, base: Array) -> Array:
        """Return (W, M, 12): by how much residuals (W, M) of one row (14,) fall as a nuisance grows by a deviation."""
        moved = nuisance[None] + DIFFERENCE * np.eye(NUISANCES)[:, None, :]
        away = self.residuals(np.repeat(row[None], NUISANCES, axis=0), moved)
        return np.moveaxis(base - away, 0, -1) / DIFFERENCE

    def settle(self, row: Array) -> tuple[Array, Array]:
        """Return the most likely nuisances (W, 12) of one row (14,), and the sensitivities (W, M, 12) there."""
        nuisance = self.at_rest(1)[0]
        for _ in range(ROUNDS):
            base = self.residuals(row[None], nuisance[None])[0]
            slopes = self.sensitivities(row, nuisance, base)
            aim = _most_likely(base, nuisance, slopes)
            steps = np.array([0.0, 0.3, 1.0])
            tried = nuisance + steps[:, None, None] * (aim - nuisance)
            residuals = self.residuals(np.repeat(row[None], len(steps), axis=0), tried)
            best = np.argmin(np.sum(residuals**2, -1) + np.sum(tried**2, -1), axis=0)
            nuisance = tried[best, np.arange(len(best))]
        base = self.residuals(row[None], nuisance[None])[0]
        return nuisance, self.sensitivities(row, nuisance, base)

    def log_likelihood(self, rows: Array, nuisance: Array, slopes: Array) -> Array:
        """Return (P,) log likelihoods, up to a constant, the nuisances integrated out about those given.

        Args:
            rows: (P, 14).
            nuisance: (W, 12) where the sensitivities were taken.
            slopes: (W, M, 12).
        """
        residuals = self.residuals(rows, np.repeat(nuisance[None], len(rows), axis=0))
        centred = residuals + (slopes @ nuisance[..., None])[..., 0]
        factor = np.linalg.cholesky(np.swapaxes(slopes, -1, -2) @ slopes + np.eye(NUISANCES))
        half = np.linalg.solve(factor, np.swapaxes(slopes, -1, -2) @ centred[..., None])[..., 0]
        return -0.5 * (np.sum(centred**2, axis=(1, 2)) - np.sum(half**2, axis=(1, 2)))


def learn_pair(rng: np.random.Generator, likelihood: PairLikelihood, physics: Array, draws: int = 320) -> Array:
    """Sample contact friction under a uniform prior on [0, 1], and restitution from that prior.

    A bounce is over before a camera has seen it twice, and the smoothed approach is slower than the true one: learned
    from that, everything would seem to bounce. So restitution is drawn, not learned, and friction is learned whatever
    it may be. Each of several draws of the pushed body's posterior counts the same: what simulating both together would
    change in that posterior is left to the route that sees the contact's forces.

    Args:
        rng: source of randomness.
        likelihood: of both bodies.
        physics: (n, 12) draws of the pushed body's rows.
        draws: to return.

    Returns:
        (draws, 2) of `PAIR_NAMES`.
    """
    restitution = (rng.permutation(THETAS) + rng.random(THETAS)) / THETAS
    friction = (np.arange(GRID) + 0.5) / GRID
    each = math.ceil(draws / THETAS)
    found = np.empty((THETAS, each, 2))
    chosen = rng.choice(len(physics), size=THETAS, replace=len(physics) < THETAS)
    for k, (row, bounce) in enumerate(zip(physics[chosen], restitution, strict=True)):
        nuisance, slopes = likelihood.settle(np.append(row, [bounce, GUESS]))
        points = np.stack([np.full(GRID, bounce), friction], -1)
        rows = np.concatenate([np.repeat(row[None], GRID, axis=0), points], -1)
        value = likelihood.log_likelihood(rows, nuisance, slopes)
        weight = np.exp(value - value.max())
        cell = rng.choice(GRID, size=each, p=weight / weight.sum())
        found[k] = np.stack([np.full(each, bounce), (cell + rng.random(each)) / GRID], -1)
    return found.reshape(-1, 2)[:draws]


def _most_likely(residuals: Array, nuisance: Array, slopes: Array) -> Array:
    transposed = np.swapaxes(slopes, -1, -2)
    centred = residuals + (slopes @ nuisance[..., None])[..., 0]
    solved = np.linalg.solve(transposed @ slopes + np.eye(NUISANCES), transposed @ centred[..., None])
    return np.asarray(solved[..., 0], dtype=np.float64)


def _held_windows(held: HeldBody, touches: Sequence[Touch], windows: Windows, spring: Array) -> _Window:
    """Cut the held body's motions where the windows were cut."""
    count, longest = len(windows), int(windows.steps.max())
    path, felt, force_sd = np.zeros((count, longest + 1, 6)), np.zeros((count, longest, 3)), np.ones((count, 3))
    for w in range(count):
        motion = touches[int(windows.episode[w])].held
        first, steps = round((windows.start[w] - motion.time[0]) / motion.dt), int(windows.steps[w])
        path[w, : steps + 1] = motion.state[first : first + steps + 1]
        path[w, steps + 1 :] = path[w, steps] * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        felt[w, :steps] = felt_wrench(held, motion)[first : first + steps]
        place_sd = np.sqrt(np.einsum("nii->ni", motion.covariance[first : first + steps]).mean(axis=0)[:3])
        force_sd[w] = np.hypot(spring * place_sd, FORCE_NOISE)
    return _Window(path, felt, force_sd)
