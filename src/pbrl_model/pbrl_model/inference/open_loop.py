"""A body pushed by a known wrench and watched from rest: the integrated likelihood (39) as a problem for inference.

The whole recording is one rollout, so the posterior is as sharp as data allow, and as hard to find.

The recording's convention of a step is: the wrench changes the velocities, then the constraints, then the pose advances
with the new velocities, and is observed. The kernel's, which is Chipmunk's, is: the pose advances with the old
velocities, then wrench and constraints. From rest the two are the same sequence of operations seen from another
beginning: the kernel's first advance moves nothing, and the pose after the recording's step k is the kernel's after
step k + 1. So one idle step is added and the first two of the kernel's poses are dropped.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pbrl_model.distributions import Uniform
from pbrl_model.errors import ModelError
from pbrl_model.inference.residual_kernel import sums_of_squares, whiten
from pbrl_model.kernel import MU_X, MU_Y
from pbrl_model.parameters import ANGLES, BodyParameters, expand
from pbrl_model.priors import Prior
from pbrl_model.rollout import DT, rollout
from pbrl_model.symmetry import THETA_PERIOD, equivalent_wheels, wrap

Array = NDArray[np.float64]

LOG_SCALE = "log_scale"
"""Name of the column that holds ln s, the scale of the pose noise."""
CHUNK = 512
"""Rows simulated at once: their poses stay in the cache between the rollout and its comparison."""


@dataclass(frozen=True)
class OpenLoop:
    """The posterior of one body's parameters, given one recording from rest.

    Attributes:
        prior: over some of `KERNEL_COLUMNS`, and at its end over `LOG_SCALE` where the scale of the noise is unknown.
        wrench: (T, 3) fx, fy [N], tau [N m] at the centre of mass, in body axes.
        poses: (T, 3) x, y [m], theta [rad] of the centre of mass, world axes, after each step.
        noise: (3,) standard deviations of the poses at s = 1 [m, m, rad].
        inertia_per_mass: [m^2].
        dt: [s].
        load: share of the weight that rests on the wheel: friction is at most mu * load * mass * g.
        base: parameters that are not learned.
        parallel: whether a call uses all cores.
    """

    prior: Prior
    wrench: Array
    poses: Array
    noise: Array
    inertia_per_mass: float
    dt: float = DT
    load: float = 1.0
    base: BodyParameters = field(default_factory=lambda: BodyParameters(mass=1.0))
    parallel: bool = True

    def __post_init__(self) -> None:
        for name, value, shape in (
            ("wrench", self.wrench, (len(self.wrench), 3)),
            ("poses", self.poses, (len(self.wrench), 3)),
            ("noise", self.noise, (3,)),
        ):
            if np.shape(value) != shape or not np.isfinite(value).all():
                raise ModelError(f"open loop: expected {name} as {shape} finite numbers, got shape {np.shape(value)}")
        if len(self.wrench) == 0 or not np.all(np.asarray(self.noise) > 0.0):
            raise ModelError("open loop: expected at least one step and noise above zero")
        if not self.load >= 0.0:
            raise ModelError(f"open loop: expected load of at least 0, got {self.load!r}")
        if LOG_SCALE in self.prior.names[:-1]:
            raise ModelError(f"open loop: expected {LOG_SCALE} as the last column, got {', '.join(self.prior.names)}")

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the columns."""
        return self.prior.names

    @property
    def bounds(self) -> Array:
        """Return the ends of the support (2, D)."""
        return self.prior.bounds

    @property
    def periodic(self) -> NDArray[np.bool_]:
        """Return which columns live on a circle."""
        return np.array([name in ANGLES for name in self.names])

    @property
    def noise_column(self) -> int | None:
        """Return the column of ln s, or None."""
        return len(self.names) - 1 if self.names[-1] == LOG_SCALE else None

    def sample_prior(self, rng: np.random.Generator, n: int) -> Array:
        """Draw (n, D)."""
        return self.prior.sample(rng, n)

    def log_prior(self, theta: Array) -> Array:
        """Return (P,) log prior densities [nat]."""
        return self.prior.log_prob(theta)

    def log_likelihood(self, theta: Array) -> Array:
        """Return (P,) log likelihoods [nat]: Gaussian, independent."""
        squares = np.empty(len(theta))
        for k, poses in self._simulated(theta, len(self.poses)):
            sums_of_squares(poses, self.poses, self.noise, squares[k : k + CHUNK])
        log_scale = theta[:, -1] if self.noise_column is not None else np.zeros(len(theta))
        count = self.poses.size
        constant = -0.5 * count * math.log(2.0 * math.pi) - len(self.poses) * float(np.sum(np.log(self.noise)))
        return constant - count * log_scale - 0.5 * squares * np.exp(-2.0 * log_scale)

    def residuals(self, theta: Array, share: float = 1.0) -> Array:
        """Return (P, M) residuals in standard deviations at s = 1, of the first share of the recording."""
        steps = max(1, math.ceil(share * len(self.poses)))
        out = np.empty((len(theta), steps, 3))
        for k, poses in self._simulated(theta, steps):
            whiten(poses, self.poses[:steps], self.noise, out[k : k + CHUNK])
        return out.reshape(len(theta), -1)

    def _simulated(self, theta: Array, steps: int) -> Iterator[tuple[int, Array]]:
        """Yield a chunk's first row and its poses (P, steps, 3) as observed, chunk by chunk."""
        physics = len(self.names) - (self.noise_column is not None)
        rows = expand(theta[:, :physics], self.names[:physics], self.base)
        rows[:, [MU_X, MU_Y]] *= self.load
        wrench = np.concatenate([self.wrench[:steps], np.zeros((1, 3))])[None]
        for k in range(0, len(rows), CHUNK):
            poses = rollout(
                rows[k : k + CHUNK],
                np.zeros((1, 6)),
                wrench,
                self.inertia_per_mass,
                dt=self.dt,
                parallel=self.parallel,
                body_wrench=True,
            )
            yield k, poses[:, 0, 2:]

    def images(self, theta: Array) -> Array:
        """Return (S, P, D): the same wheels turned by a quarter with exchanged coefficients."""
        turned = equivalent_wheels(theta, self.names)[:2]
        if np.array_equal(turned[0], turned[1]):
            return turned[:1]
        for name in ANGLES & set(self.names):
            column = self.names.index(name)
            turned[..., column] = wrap(turned[..., column], THETA_PERIOD)
        return turned


def wheel_evidence(folder: Path, *, parallel: bool = True) -> OpenLoop:
    """Return the problem of `test/data/wheel_evidence`, whose log evidence is known to be 6307.80.

    Args:
        folder: with `recording.npz`.
        parallel: whether a call uses all cores.

    Raises:
        ModelError: the recording is not there.
    """
    path = folder / "recording.npz"
    if not path.is_file():
        raise ModelError(f"{path}: expected the recording of the wheel with two modes, found none")
    with np.load(path) as data:
        grasped, poses = np.asarray(data["wrench"]), np.asarray(data["poses"])
    wrench = grasped.copy()
    wrench[:, 2] += -0.40 * grasped[:, 1]  # torque about the centre: lever of the grasp at (-0.40, 0)
    prior = Prior(
        {
            "mass": Uniform(2.0, 60.0),
            "wheel_x": Uniform(-0.4, 0.4),
            "wheel_y": Uniform(-0.3, 0.3),
            "wheel_theta": Uniform(-math.pi / 2, math.pi / 2),
            "mu_x": Uniform(0.0, 1.0),
            "mu_y": Uniform(0.0, 1.0),
            LOG_SCALE: Uniform(math.log(0.3), math.log(30.0)),
        }
    )
    inertia_per_mass = (0.8**2 + 0.5**2) / 12.0
    noise = np.array([0.002, 0.002, 0.01])
    return OpenLoop(prior, wrench, poses, noise, inertia_per_mass, load=0.5, parallel=parallel)
