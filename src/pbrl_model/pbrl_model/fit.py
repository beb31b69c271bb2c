"""From a recording to a posterior: episodes, windows, modes, chains, and a test on what was left out."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.episodes import cut_episodes
from pbrl_bag.types import BodyGeometry, Recording
from pbrl_model import mcmc
from pbrl_model.errors import ModelError
from pbrl_model.fit_options import FitOptions
from pbrl_model.geometry import MassProperties, mass_properties
from pbrl_model.heldout import Heldout, Split, heldout_error, split
from pbrl_model.likelihood import WindowedLikelihood
from pbrl_model.parameters import ANGLES, BodyParameters, free_columns
from pbrl_model.posterior import Posterior
from pbrl_model.predict import UNKNOWN_MASS
from pbrl_model.prior_options import PriorOptions
from pbrl_model.priors import Prior, table2_prior
from pbrl_model.sensing import Motion, observe
from pbrl_model.starts import SearchPlan, find_modes
from pbrl_model.symmetry import wrap
from pbrl_model.target import LEFT_OUT_BESIDE_GROUND, LEFT_OUT_FORCE, FrozenTarget, Target
from pbrl_model.verdicts import note_on_left_out, notes_on

__all__ = ["Fit", "FitOptions", "ObjectFit", "fit_recording", "motions_of"]

Array = NDArray[np.float64]

SHORTEST = 0.5
"""Episodes shorter than this [s] are left out, unless there is no other."""
SHORT_WINDOWS = (0.5, 1.0)
"""Lengths of the search's windows before the target's own [s]."""
STAGE_KEEP = (16, 6, 4)
STAGE_ITERATIONS = (6, 8, 15)
DOOR_MASS_SPREAD = 1.5
"""Least spread of ln mass for a body on a hinge."""


@dataclass(frozen=True)
class ObjectFit:
    """What was learned of one object.

    Attributes:
        posterior: over its physics.
        noise: (chains, n, 2) draws of sigma (scale of the pose noise) and left-out force [N].
        acceptance: (chains, 2) share of proposals taken, physics and noise.
        heldout: errors on what was left out, or None.
        motions: the episodes on one clock.
        body: centre of mass and inertia over mass.
    """

    posterior: Posterior
    noise: Array
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


def motions_of(recording: Recording, name: str, options: FitOptions | None = None) -> tuple[Motion, ...]:
    """Return the episodes of one object on one clock.

    Raises:
        ModelError: a stream is missing or broken, every episode is too short, or the pose never changes.
        BagError: an episode is malformed.
    """
    chosen = options or FitOptions()
    com = _body(recording.bodies[name], _oriented(recording, name)).com
    episodes = [episode for episode in cut_episodes(recording) if episode.object == name]
    usable = [episode for episode in episodes if episode.duration >= SHORTEST]
    if not usable:
        longest = max((episode.duration for episode in episodes), default=0.0)
        raise ModelError(f"{name}: expected an episode of at least {SHORTEST} s, got at most {longest:.3f} s")
    seen = [np.nan_to_num(np.hstack([each.poses.position, each.poses.quaternion])) for each in usable]
    if all((poses == poses[:1]).all() for poses in seen):
        raise ModelError(f"{name}: expected poses that change while it is held, got the same one all the time")
    return tuple(
        observe(recording, name, episode.grippers, episode.start, episode.end, com, gravity=chosen.gravity)
        for episode in usable
    )


def _oriented(recording: Recording, name: str) -> bool:
    if name not in recording.object_poses:
        raise ModelError(f"object poses: expected a stream for {name}, got {sorted(recording.object_poses) or 'none'}")
    return bool(np.any(np.isfinite(recording.object_poses[name].quaternion)))


def _body(geometry: BodyGeometry, oriented: bool) -> MassProperties:
    """Return mass properties; a body of unknown orientation is taken as the point that is observed."""
    body = mass_properties(geometry.footprint)
    return body if oriented else replace(body, com=np.zeros(2))


def _target(geometry: BodyGeometry, likelihood: WindowedLikelihood, options: FitOptions) -> Target:
    """Put prior, likelihood and what is not learned together."""
    prior = table2_prior(geometry, options.model_class, _priors(options))
    ties = {"mu_y": "mu_x"} if options.model_class == "hinge" else {}
    prior = Prior({name: part for name, part in prior.parts.items() if name not in ties})
    mass = UNKNOWN_MASS if math.isnan(geometry.nominal_mass) else geometry.nominal_mass
    radius = 1.0 if options.model_class == "hinge" else math.nan
    base = BodyParameters(mass=mass, hinge_radius=radius)
    usual = LEFT_OUT_BESIDE_GROUND if "mu_ground" in prior.names else LEFT_OUT_FORCE
    return Target(prior.names, prior, likelihood, base, ties, options.left_out_force or usual)


def _priors(options: FitOptions) -> PriorOptions:
    """Return the priors; what a door weighs at its handle is not known from what it weighs on scales."""
    mass = options.priors.mass
    if options.model_class != "hinge" or mass.sigma >= DOOR_MASS_SPREAD:
        return options.priors
    return options.priors.model_copy(update={"mass": mass.model_copy(update={"sigma": DOOR_MASS_SPREAD})})


def _fit_object(rng: np.random.Generator, recording: Recording, name: str, options: FitOptions) -> ObjectFit:
    geometry = recording.bodies[name]
    motions = motions_of(recording, name, options)
    _check_felt(name, motions)
    body = _body(geometry, motions[0].oriented)
    parts = split(motions, options)
    likelihood = WindowedLikelihood(body, parts.fitted, with_drag=options.likelihood == "windowed")
    target = _target(geometry, likelihood, options)
    chains = _sample(rng, target, parts.searched, options)
    posterior = _posterior(name, target, chains.position, options)
    noise = np.exp(chains.position[..., len(target.names) :])
    heldout = _heldout(rng, parts, posterior, geometry, body)
    if heldout is not None:
        posterior = replace(posterior, heldout_rmse=heldout.after.rmse_position)
    notes = notes_on(posterior, target.prior, motions, rng)
    if likelihood.with_drag:
        notes += note_on_left_out(noise, target.left_out_force)
    return ObjectFit(replace(posterior, notes=notes), noise, chains.acceptance, heldout, motions, body)


def _check_felt(name: str, motions: Sequence[Motion]) -> None:
    if max(float(np.abs(motion.wrench).max()) for motion in motions) < 1e-9:
        raise ModelError(f"{name}: expected a force while it was held, got zero throughout; was the wrist sensor on?")


def _sample(rng: np.random.Generator, target: Target, motions: Sequence[Motion], options: FitOptions) -> mcmc.Chains:
    """Find modes and run chains from them."""
    lengths = tuple(length for length in SHORT_WINDOWS if length < options.window)
    keep, iterations = STAGE_KEEP[-len(lengths) - 1 :], STAGE_ITERATIONS[-len(lengths) - 1 :]
    plan = SearchPlan(options.search_draws, keep, lengths, iterations)
    modes = find_modes(rng, target, motions, plan)
    _, log_det = np.linalg.slogdet(modes.covariance)
    mass = modes.point.log_density + 0.5 * log_det
    share = np.exp(mass - mass.max())
    chosen = modes.take(np.sort(rng.choice(len(share), size=options.chains, p=share / share.sum())))
    density = FrozenTarget(target, chosen.point.position, chosen.point.linear).density
    physics = len(target.names)
    blocks = (mcmc.Block(tuple(range(physics))), mcmc.Block(tuple(range(physics, target.dimension)), keeps_memo=True))
    state = mcmc.init(density, chosen.point.position, chosen.covariance, blocks)
    return mcmc.run(rng, state, density, blocks, burn_in=options.burn_in, draws=options.draws, thin=options.thin)


def _posterior(name: str, target: Target, position: Array, options: FitOptions) -> Posterior:
    """Name the draws of positions (C, n, D), tied parameters included."""
    names = free_columns(options.model_class)
    columns = {known: position[..., k] for k, known in enumerate(target.names)}
    columns |= {known: wrap(column, 2 * math.pi) for known, column in columns.items() if known in ANGLES}
    columns |= {copy: columns[source] for copy, source in target.ties.items()}
    return Posterior(name, options.model_class, names, np.stack([columns[known] for known in names], -1), target.base)


def _heldout(
    rng: np.random.Generator, parts: Split, posterior: Posterior, geometry: BodyGeometry, body: MassProperties
) -> Heldout | None:
    if parts.heldout is None:
        return None
    return heldout_error(parts.kind, parts.heldout, posterior.thinned(100, rng).rows(), geometry, body)
