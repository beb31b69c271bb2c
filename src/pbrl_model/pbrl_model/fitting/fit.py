"""From a recording to a posterior: episodes, windows, modes, chains, and a test on what was left out."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import BodyGeometry, Recording
from pbrl_model.engines.windowed import PymunkEngine
from pbrl_model.errors import ModelError
from pbrl_model.fitting.episodes import body_of, motions_of, usable_episodes
from pbrl_model.fitting.heldout import Heldout, Split, heldout_error, split
from pbrl_model.fitting.likelihood import WindowedLikelihood
from pbrl_model.fitting.options import FitOptions
from pbrl_model.fitting.polish import Modes
from pbrl_model.fitting.sampling import Sampled, chains, sampled
from pbrl_model.fitting.starts import SearchPlan, climb_again, find_modes
from pbrl_model.fitting.target import LEFT_OUT_BESIDE_GROUND, LEFT_OUT_FORCE, Target
from pbrl_model.geometry import MassProperties
from pbrl_model.parameters import ANGLES, BodyParameters, free_columns
from pbrl_model.posterior import Posterior
from pbrl_model.predict import UNKNOWN_MASS
from pbrl_model.prior_options import MassOptions, PriorOptions
from pbrl_model.priors import Prior, table2_prior
from pbrl_model.sensing.motion import Motion
from pbrl_model.sensing.wrench_error import wrench_error
from pbrl_model.symmetry import wrap
from pbrl_model.verdicts import (
    note_on_delay,
    note_on_left_out,
    note_on_noise,
    note_on_unheard,
    note_on_wrench,
    notes_on,
)

__all__ = ["Fit", "FitOptions", "ObjectFit", "fit_recording", "target_of"]

Array = NDArray[np.float64]

SHORT_WINDOWS = (0.5, 1.0)
"""Lengths of the search's windows before the target's own [s]."""
STAGE_KEEP = (16, 6, 4)
STAGE_ITERATIONS = (6, 8, 15)
LEAST_DELAY = 0.01
"""Wrenches are not shifted for less [s], nor for less than the delay's standard deviation; it stays an unknown."""
DELAY_ROUNDS = 3
DOOR_MASS_SPREAD = 1.5
"""Spread of ln mass for a body on a hinge where none is told."""


@dataclass(frozen=True)
class ObjectFit:
    """What was learned of one object.

    Attributes:
        posterior: over its physics.
        noise: (chains, n, 2) draws of sigma (scale of the pose noise) and left-out force [N].
        delay: (chains, n) draws of how late the poses come after the wrenches [s].
        acceptance: (chains, 2) share of proposals taken, physics and noise; NaN for importance sampling.
        heldout: errors on what was left out, or None.
        motions: the episodes on one clock.
        body: centre of mass and inertia over mass.
    """

    posterior: Posterior
    noise: Array
    delay: Array
    acceptance: Array
    heldout: Heldout | None
    motions: tuple[Motion, ...]
    body: MassProperties

    @property
    def notes(self) -> tuple[str, ...]:
        """Return what the data do not say, in sentences."""
        return self.posterior.notes

    @property
    def names(self) -> tuple[str, ...]:
        """Return the learned parameters' names."""
        return self.posterior.names

    def to_report(self) -> dict[str, Any]:
        """Return this object's part of `report.json`."""
        evidence = self.posterior.log_evidence
        return {
            "parameters": self.posterior.summary(),
            "log_evidence": evidence if math.isfinite(evidence) else None,
            "log_evidence_sd": self.posterior.log_evidence_sd if math.isfinite(evidence) else None,
            "heldout": self.heldout.to_report() if self.heldout else None,
            "notes": list(self.notes),
        }


@dataclass(frozen=True)
class Fit:
    """What was learned from one recording."""

    recording: Path
    objects: Mapping[str, ObjectFit]
    seconds: float

    def to_report(self) -> dict[str, Any]:
        """Return `report.json` of the command `fit`."""
        objects = {name: found.to_report() for name, found in self.objects.items()}
        return {"recording": str(self.recording), "objects": objects, "seconds": self.seconds}


def fit_recording(recording: Recording, options: FitOptions | None = None) -> Fit:
    """Learn the physics of the objects that were pushed.

    Args:
        recording: as read.
        options: None: the defaults.

    Raises:
        ModelError: an object was not held, a stream is missing or broken, nothing was felt, or an option does not fit.
        BagError: an episode is malformed.
    """
    chosen = options or FitOptions()
    started = time.perf_counter()
    held = sorted({grasp.object for grasp in recording.grasps})
    for name in chosen.objects:
        if name not in held:
            raise ModelError(f"fit: expected objects that were held ({', '.join(held) or 'none was'}), got {name!r}")
    names = chosen.objects or held
    if not names:
        raise ModelError(f"{recording.path}: expected at least one grasp to learn from, got none")
    seeds = np.random.SeedSequence(chosen.seed).spawn(len(names))
    objects = {
        name: _fit_object(np.random.default_rng(seed), recording, name, chosen)
        for name, seed in zip(names, seeds, strict=True)
    }
    return Fit(recording.path, objects, time.perf_counter() - started)


def target_of(
    geometry: BodyGeometry, likelihood: WindowedLikelihood, options: FitOptions, error: float = 0.0
) -> Target:
    """Put prior, likelihood and what is not learned together.

    Args:
        geometry: footprint, nominal mass, pose in the scene.
        likelihood: of the recorded poses.
        options: class, priors and left-out force.
        error: of the wrenches themselves in one window [N]; it adds to the left-out force.

    Raises:
        ModelError: an option does not fit the footprint.
    """
    prior = table2_prior(geometry, options.model_class, _priors(options))
    ties = {"mu_y": "mu_x"} if options.model_class == "hinge" else {}
    prior = Prior({name: part for name, part in prior.parts.items() if name not in ties})
    mass = UNKNOWN_MASS if math.isnan(geometry.nominal_mass) else geometry.nominal_mass
    radius = 1.0 if options.model_class == "hinge" else math.nan
    base = BodyParameters(mass=mass, hinge_radius=radius)
    usual = LEFT_OUT_BESIDE_GROUND if "mu_ground" in prior.names else LEFT_OUT_FORCE
    return Target(prior.names, prior, likelihood, base, ties, math.hypot(options.left_out_force or usual, error))


def _priors(options: FitOptions) -> PriorOptions:
    """Return the priors; what a door weighs at its handle is not known from what it weighs on scales.

    A spread other than the usual one was meant for the door. That of a file or a state may be the usual one, told.
    """
    mass = options.priors.mass
    if options.model_class != "hinge" or mass.sigma != MassOptions().sigma:
        return options.priors
    return options.priors.model_copy(update={"mass": mass.model_copy(update={"sigma": DOOR_MASS_SPREAD})})


def _fit_object(rng: np.random.Generator, recording: Recording, name: str, options: FitOptions) -> ObjectFit:
    searched = _search(rng, recording, name, options)
    geometry = recording.bodies[name]
    motions, parts, target = searched.motions, searched.parts, searched.target
    modes = searched.modes
    if options.engine == "pymunk":
        target = target.over(target.likelihood.with_engine(partial(PymunkEngine, footprint=geometry.footprint)))
        modes = Modes(target.evaluate(modes.point.position, modes.point.linear.nuisance), modes.covariance)
    found = _sampled(rng, target, modes, options)
    body = target.likelihood.body
    posterior = _posterior(name, target, found, options)
    heldout = _heldout(rng, parts, posterior, geometry, body)
    if heldout is not None:
        posterior = replace(posterior, heldout_rmse=heldout.after.rmse_position)
    noise = np.exp(found.position[..., target.simulated :])
    delay = found.position[..., target.simulated - 1]
    notes = note_on_unheard(len(usable_episodes(recording, name)) - len(motions))
    notes += notes_on(posterior, target.prior, motions, rng) + note_on_noise(noise) + found.notes
    if target.likelihood.with_drag:
        notes += note_on_wrench(wrench_error(recording, motions, body))
        notes += note_on_left_out(noise, target.left_out_force) + note_on_delay(delay)
    return ObjectFit(replace(posterior, notes=notes), noise, delay, found.acceptance, heldout, motions, body)


def _sampled(rng: np.random.Generator, target: Target, modes: Modes, options: FitOptions) -> Sampled:
    """Draw from the posterior."""
    steps = {"count": options.chains, "burn_in": options.burn_in, "thin": options.thin}
    if options.sampler == "importance":
        return sampled(rng, target, modes, draws=options.chains * options.draws, **steps)
    return chains(rng, target, modes, draws=options.draws, **steps)


@dataclass(frozen=True)
class _Searched:
    """Episodes on one clock, the density over them, and its modes."""

    motions: tuple[Motion, ...]
    parts: Split
    target: Target
    modes: Modes


def _search(rng: np.random.Generator, recording: Recording, name: str, options: FitOptions) -> _Searched:
    """Find the modes. Where poses prove late, put the wrenches onto their clock and climb again, while it is better."""
    motions, parts, target = _observed(recording, name, options, 0.0)
    best = _Searched(motions, parts, target, find_modes(rng, target, parts.searched, _plan(options)))
    for _ in range(DELAY_ROUNDS):
        column, found = best.target.simulated - 1, best.modes
        delay, variance = float(found.point.position[0, column]), float(found.covariance[0, column, column])
        if abs(delay - best.motions[0].delay) < max(LEAST_DELAY, math.sqrt(variance)):
            break
        motions, parts, target = _observed(recording, name, options, delay)
        modes = climb_again(rng, target, found)
        # A delay that stood in for something else leads away; the poses are the same ones on every clock.
        if not modes.point.log_density.max() > found.point.log_density.max():
            break
        best = _Searched(motions, parts, target, modes)
    return best


def _observed(
    recording: Recording, name: str, options: FitOptions, delay: float
) -> tuple[tuple[Motion, ...], Split, Target]:
    """Return the episodes with the wrenches as late as told, their windows, and the density over them."""
    motions = motions_of(recording, name, options, delay)
    _check_felt(name, motions)
    parts = split(motions, options)
    body = body_of(recording.bodies[name], motions[0].oriented)
    likelihood = WindowedLikelihood(body, parts.fitted, with_drag=options.likelihood == "windowed")
    # Windows are fitted with a left-out force each, as if the next had another; what joints are off is alike in all.
    error = wrench_error(recording, motions, body) * math.sqrt(len(parts.fitted))
    return motions, parts, target_of(recording.bodies[name], likelihood, options, error)


def _plan(options: FitOptions) -> SearchPlan:
    lengths = tuple(length for length in SHORT_WINDOWS if length < options.window)
    keep, iterations = STAGE_KEEP[-len(lengths) - 1 :], STAGE_ITERATIONS[-len(lengths) - 1 :]
    return SearchPlan(options.search_draws, keep, lengths, iterations)


def _check_felt(name: str, motions: Sequence[Motion]) -> None:
    if max(float(np.abs(motion.wrench).max()) for motion in motions) < 1e-9:
        raise ModelError(f"{name}: expected a force while it was held, got zero throughout; was the wrist sensor on?")


def _posterior(name: str, target: Target, found: Sampled, options: FitOptions) -> Posterior:
    """Name the draws of positions (C, n, D), tied parameters included."""
    position = found.position
    names = free_columns(options.model_class)
    columns = {known: position[..., k] for k, known in enumerate(target.names)}
    columns |= {known: wrap(column, 2 * math.pi) for known, column in columns.items() if known in ANGLES}
    columns |= {copy: columns[source] for copy, source in target.ties.items()}
    return Posterior(
        name,
        options.model_class,
        names,
        np.stack([columns[known] for known in names], -1),
        target.base,
        log_evidence=found.log_evidence,
        log_evidence_sd=found.log_evidence_sd,
        ess=found.ess,
    )


def _heldout(
    rng: np.random.Generator, parts: Split, posterior: Posterior, geometry: BodyGeometry, body: MassProperties
) -> Heldout | None:
    if parts.heldout is None:
        return None
    return heldout_error(parts.kind, parts.heldout, posterior.thinned(100, rng).rows(), geometry, body)
