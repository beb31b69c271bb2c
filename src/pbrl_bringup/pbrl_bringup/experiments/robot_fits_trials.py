"""One trial of the robot fits: record two pushes in Bullet, learn from one, predict both, score against the scene."""

from __future__ import annotations

import math
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bullet_sim.catalogue import OnCasters
from bullet_sim.scene import Scene, load_scene
from pbrl_bag import read_recording
from pbrl_bringup.benches.wheel import locked_contacts
from pbrl_bringup.errors import BringupError
from pbrl_bringup.simulate import simulate_push
from pbrl_control.planar import placed
from pbrl_control.push_plan import load_plan
from pbrl_model.fitting.episodes import motions_of
from pbrl_model.fitting.fit import FitOptions, fit_recording
from pbrl_model.geometry import MassProperties, mass_properties
from pbrl_model.posterior import Posterior
from pbrl_model.predict import predict, unlearned
from pbrl_model.sensing.motion import Motion
from pbrl_model.symmetry import THETA_PERIOD, wrap

Array = NDArray[np.float64]

HELDOUT_SEED = 1000
"""Added to the seed of the world of the held-out push: its casters stand otherwise."""


@dataclass(frozen=True)
class Case:
    """One object of figure 30.

    Attributes:
        name: as people say it.
        scene: of the simulator.
        push: learned from.
        heldout: predicted.
    """

    name: str
    scene: str
    push: str
    heldout: str


@dataclass(frozen=True)
class EndError:
    """How far the last predicted pose of a whole push is from the last recorded one.

    Attributes:
        position: of the body's frame [m].
        yaw: [rad], not wrapped: a body that is predicted to spin once too often is not right.
        corners: root mean square over the outline's corners [m], which knows of both.
    """

    position: float
    yaw: float
    corners: float


@dataclass(frozen=True)
class Found:
    """Where the learned wheel is, beside what really holds the body; for scoring alone.

    Attributes:
        x: posterior mean of the wheel's place in the body's frame [m].
        y: as `x`.
        theta: direction in which it rolls [rad], of period pi.
        mass: posterior mean [kg].
        distance: to what holds the body [m]: the nearest locked caster's swivel axis, or the line of the fixed wheels'
            axle, which all points of it constrain alike; NaN where nothing holds it.
        contact: to where a locked caster touches the floor, up to its trail off its axis [m]; NaN where none is locked.
        turn: between the directions of the wheel and of the fixed wheels [rad]; NaN where there are none.
    """

    x: float
    y: float
    theta: float
    mass: float
    distance: float
    contact: float
    turn: float


@dataclass(frozen=True)
class Trial:
    """One case, seed and loss.

    Attributes:
        case: its name.
        seed: of simulation and fit.
        loss: the likelihood.
        found: the wheel.
        expected: errors without learning, on the recording and on the held-out push.
        learned: errors with what was learned, likewise.
        notes: what the fit says the data do not say.
        seconds: of the fit.
    """

    case: str
    seed: int
    loss: str
    found: Found
    expected: tuple[EndError, EndError]
    learned: tuple[EndError, EndError]
    notes: tuple[str, ...]
    seconds: float


@dataclass(frozen=True)
class Overlay:
    """What is drawn of a trial: poses (n, 3) at the times of the recorded ones.

    Attributes:
        recorded: of the body's frame in `world`.
        expected: without learning.
        learned: with it.
        outline: (k, 2) of the body in its frame [m].
        wheel: x, y [m] and rolling direction [rad] in the body's frame.
        holding: (k, 2) casters that are locked, or fixed, in the body's frame [m].
        fixed: whether they are fixed wheels, which roll along the body's x.
    """

    recorded: Array
    expected: Array
    learned: Array
    outline: Array
    wheel: tuple[float, float, float]
    holding: Array
    fixed: bool


def bag_of(case: Case, seed: int, held: bool, out: Path) -> Path:
    """Return where the recording of a push is."""
    return out / "bags" / f"{case.scene}_{'heldout' if held else 'learn'}_{seed}"


def record(case: Case, seed: int, held: bool, out: Path) -> Path:
    """Simulate one push; return the recording.

    Raises:
        BringupError: the push was not done.
    """
    plan, bag = load_plan(case.heldout if held else case.push), bag_of(case, seed, held, out)
    shutil.rmtree(bag, ignore_errors=True)
    made = simulate_push(load_scene(case.scene), plan, seed + HELDOUT_SEED * held, bag)
    if made.phase != "done":
        raise BringupError(f"seed {seed}: expected the push {plan.name} to be done, it failed: {made.status}")
    return bag


def run_trial(case: Case, options: FitOptions, out: Path) -> tuple[Trial, Overlay]:
    """Fit one recording with one loss, predict it and the held-out push, and score both."""
    scene, name, seed = load_scene(case.scene), load_plan(case.push).object, options.seed
    recordings = [read_recording(bag_of(case, seed, held, out)) for held in (False, True)]
    fit = fit_recording(recordings[0], options)
    posterior, geometry = fit.objects[name].posterior, recordings[0].bodies[name]
    motions = [motions_of(recording, name)[0] for recording in recordings]
    body = mass_properties(geometry.footprint)
    expected = [predicted(motion, unlearned(geometry).to_vector()[None], body) for motion in motions]
    learned = [predicted(motion, posterior.rows(), body) for motion in motions]
    found = score(scene, posterior, seed)

    def errors(paths: list[Array]) -> tuple[EndError, EndError]:
        first, second = (
            end_error(path, motion.pose, geometry.footprint) for path, motion in zip(paths, motions, strict=True)
        )
        return first, second

    trial = Trial(
        case.name, seed, options.likelihood, found, errors(expected), errors(learned), posterior.notes, fit.seconds
    )
    holding, fixed = holding_casters(scene, name)
    wheel = (found.x, found.y, found.theta)
    return trial, Overlay(motions[0].pose, expected[0], learned[0], geometry.footprint, wheel, holding, fixed)


def predicted(motion: Motion, rows: Array, body: MassProperties) -> Array:
    """Return the mean open-loop prediction (n, 3) at the times of the recorded poses."""
    path = predict(motion, rows, body).mean
    return np.stack([np.interp(motion.pose_time, motion.time, column) for column in path.T], -1)


def end_error(path: Array, recorded: Array, outline: Array) -> EndError:
    """Compare the last poses of two paths (n, 3)."""
    first, second = path[-1], recorded[-1]
    corners = placed(outline, first) - placed(outline, second)
    return EndError(
        float(np.hypot(*(first - second)[:2])),
        float(abs(first[2] - second[2])),
        float(np.sqrt(np.mean(np.sum(corners**2, axis=-1)))),
    )


def holding_casters(scene: Scene, name: str) -> tuple[Array, bool]:
    """Return the places (k, 2) [m] of what holds a body, and whether that are fixed wheels; for scoring alone."""
    body = scene.bodies[name]
    if not isinstance(body, OnCasters):
        raise BringupError(f"{name}: expected a body on casters, got a {body.kind}")
    fixed, locked = scene.concealed.fixed_wheels.get(name, ()), scene.concealed.locked_casters.get(name, ())
    return np.array([body.swivels[caster] for caster in fixed or locked]).reshape(-1, 2), bool(fixed)


def score(scene: Scene, posterior: Posterior, seed: int) -> Found:
    """Measure how far the learned wheel is from what holds the body; reads what the learner was not told."""
    name, summary = posterior.object, posterior.summary()
    x, y, theta, mass = (float(summary[key]["mean"]) for key in ("wheel_x", "wheel_y", "wheel_theta", "mass"))
    place = np.array([x, y])
    holding, fixed = holding_casters(scene, name)
    distance = contact = turn = math.nan
    if fixed:  # the body's y axis is parallel to the axle
        distance, turn = float(abs(x - holding[0, 0])), float(abs(wrap(np.array(theta), THETA_PERIOD)))
    elif len(holding):
        distance = float(np.hypot(*(holding - place).T).min())
        contact = float(np.hypot(*(locked_contacts(scene, name, seed) - place).T).min())
    return Found(x, y, theta, mass, distance, contact, turn)
