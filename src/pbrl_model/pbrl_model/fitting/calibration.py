"""Trials for simulation-based calibration of the fit: data drawn from the very model that is then fitted.

A trial draws everything that the fit takes as unknown from the fit's own prior: the body's parameters, the poses'
delay, the size of their noise and of the left-out force, each window's start and left-out wrench, the noise itself.
What the fit takes as known is drawn as well: pushes, headings, the smoother's idea of each start. The posterior must
then be calibrated; where it is not the inference is wrong, not the model.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import BodyGeometry
from pbrl_model.errors import ModelError
from pbrl_model.fitting.fit import FitOptions, target_of
from pbrl_model.fitting.likelihood import WindowedLikelihood
from pbrl_model.fitting.sampling import Sampled, weighted
from pbrl_model.fitting.starts import SearchPlan, find_modes
from pbrl_model.fitting.target import Target
from pbrl_model.geometry import MassProperties, mass_properties
from pbrl_model.inference.sbc import rank_among
from pbrl_model.parameters import ANGLES
from pbrl_model.prior_options import parse_prior_options
from pbrl_model.sensing.windows import Windows
from pbrl_model.symmetry import canonical_wheel, wrap

Array = NDArray[np.float64]

TABLE = BodyGeometry(
    "table", np.array([[-0.6, -0.35], [0.6, -0.35], [0.6, 0.35], [-0.6, 0.35]]), 0.7, 25.0, True, np.zeros(3)
)
WINDOWS, SECONDS, DT, RATE = 4, 1.2, 0.01, 12.0
NOISE = np.array([0.003, 0.003, 0.006])
"""Of a pose [m, m, rad]: tags of 3 mm, half a metre apart on the table."""
START = np.array([0.004, 0.004, 0.008, 0.02, 0.02, 0.04])
"""Standard deviations of the start as the smoother has it, widened."""
SPEED = np.array([0.12, 0.12, 0.25])
"""Of the starts [m/s, m/s, rad/s]."""
PUSH = np.array([35.0, 35.0, 15.0])
"""Size of the wrenches [N, N, N m]."""
HINGE = {
    "mass": {"distribution": "log_normal", "median": 25.0, "sigma": 0.5},
    "hinge_x": {"distribution": "truncated_normal", "mean": 0.9, "sd": 0.02, "lower": 0.8, "upper": 1.0},
    "hinge_y": {"distribution": "truncated_normal", "mean": 0.3, "sd": 0.02, "lower": 0.2, "upper": 0.4},
    "hinge_radius": {"distribution": "log_normal", "median": 0.9487, "sigma": 0.02},
}
"""A hinge that is about where the windows start: from another place a distance joint would fling the body there. A door
of a few kilograms would be flung by the left-out force alone: a fit of one says that its motion is not explained."""
SEARCH = SearchPlan(draws=400, keep=(6,), lengths=(), iterations=(12,))
DRAWS = 600
RANKED = 99
"""Posterior draws that the truth is ranked among."""


@dataclass(frozen=True)
class Trial:
    """One draw from the prior, fitted.

    Attributes:
        names: of what is ranked.
        truth: (K,) wheels as their representatives.
        rank: (K,) among `RANKED` draws.
        mean: (K,) of the posterior.
        sd: (K,) of the posterior.
        converged: whether the evidence did.
        ess: effective samples.
    """

    names: tuple[str, ...]
    truth: Array
    rank: NDArray[np.int64]
    mean: Array
    sd: Array
    converged: bool
    ess: float


def options_for(model_class: str) -> FitOptions:
    """Return what a class is fitted with; all but the hinge with the defaults of the command `fit`."""
    if model_class != "hinge":
        return FitOptions(model_class=model_class)
    return FitOptions(model_class=model_class, priors=parse_prior_options({"parameters": HINGE}))


def empty_windows(rng: np.random.Generator, model_class: str) -> Windows:
    """Return windows with everything that is taken as known, and no poses yet."""
    steps, poses = round(SECONDS / DT), round(SECONDS * RATE)
    time = DT * (np.arange(steps) + 0.5)
    phase, rate = rng.uniform(0, 2 * np.pi, (2, WINDOWS, 1, 3)), rng.uniform(1.0, 5.0, (2, WINDOWS, 1, 3))
    size = PUSH * rng.normal(size=(2, WINDOWS, 1, 3))
    angle = phase + rate * time[:, None]
    initial = np.concatenate([np.zeros((WINDOWS, 2)), rng.uniform(-0.3, 0.3, (WINDOWS, 1))], -1)
    speed = SPEED * rng.normal(size=(WINDOWS, 3))
    if model_class == "hinge":
        speed[:, :] = speed[:, 2:] * np.array([0.3, -0.9, 1.0])  # along the circle, roughly
    place = np.sort(rng.uniform(0.0, steps, (WINDOWS, poses)), axis=1)
    step = np.minimum(np.floor(place), steps - 1).astype(np.int64)
    return Windows(
        dt=DT,
        wrench=np.sum(size * np.sin(angle), axis=0),
        rate=np.sum(size * rate * np.cos(angle), axis=0),
        delay=0.0,
        heading=np.repeat(initial[:, 2:], steps, axis=1),
        steps=np.full(WINDOWS, steps),
        initial=np.concatenate([initial, speed], -1),
        covariance=np.tile(np.diag(START**2), (WINDOWS, 1, 1)),
        step=step,
        fraction=place - step,
        pose=np.zeros((WINDOWS, poses, 3)),
        seen=rng.random((WINDOWS, poses, 1)).repeat(3, axis=2) < 0.9,
        episode=np.arange(WINDOWS),
        start=np.zeros(WINDOWS),
        noise=np.tile(NOISE, (WINDOWS, 1)),
    )


def with_poses(rng: np.random.Generator, target: Target, position: Array) -> Windows:
    """Return the target's windows with poses drawn from the model at a position (D,)."""
    likelihood = target.likelihood
    (sigma,), (drag,) = target.noise(position[None])
    nuisance = rng.standard_normal(likelihood.at_rest(1).shape)
    nuisance[..., 6:] *= drag
    exact = likelihood.simulate(target.rows(position[None]), nuisance, target.delay(position[None]))[0]
    noise = sigma * likelihood.windows.noise[:, None, :] * rng.standard_normal(exact.shape)
    return replace(likelihood.windows, pose=exact + noise)


def run_trial(model_class: str, seed: int) -> Trial:
    """Draw a truth and its data, fit, rank.

    Raises:
        ModelError: the class is unknown.
    """
    rng = np.random.default_rng(seed)
    options = options_for(model_class)
    body: MassProperties = mass_properties(TABLE.footprint)
    target = target_of(TABLE, WindowedLikelihood(body, empty_windows(rng, model_class)), options)
    truth = target.sample_prior(rng, 1)
    windows = with_poses(rng, target, truth[0])
    if not np.isfinite(windows.pose).all():
        raise ModelError(f"calibration: expected finite poses, got others for {model_class} with seed {seed}")
    target = target.over(WindowedLikelihood(body, windows))
    modes = find_modes(rng, target, (), SEARCH)
    found = weighted(rng, target, modes, draws=DRAWS)
    return _ranked(rng, target, truth[0], found)


def _ranked(rng: np.random.Generator, target: Target, truth: Array, found: Sampled) -> Trial:
    physics = len(target.names)

    def representative(positions: Array) -> Array:
        out = positions.copy()
        out[:, :physics] = canonical_wheel(out[:, :physics], target.names)
        for name in ANGLES.intersection(target.names):
            column = target.names.index(name)
            out[:, column] = wrap(out[:, column], np.pi)
        return out

    draws = representative(found.position[0])
    one = representative(truth[None])[0]
    chosen = draws[np.linspace(0, len(draws) - 1, RANKED).round().astype(int)]
    return Trial(
        (*target.names, "delay", "log_sigma", "log_drag"),
        one,
        rank_among(rng, one, chosen),
        draws.mean(axis=0),
        draws.std(axis=0),
        bool(np.isfinite(found.log_evidence)),
        found.ess,
    )
