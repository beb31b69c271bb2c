"""The repaired model: from a fitted hypothesis to a file, from the file back to the simulation that it was fitted with.

The file is `pbrl_model.model_file`'s; what its effects do is in `kernels`. Here the two meet: parameters go by the
names of `kernels.columns`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbrl_mismatch.data.cuts import Cuts
from pbrl_mismatch.data.simulation import poses
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.effects.registry import EFFECTS, effect_named
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.kernels.columns import COLUMN, COLUMNS, UNIT, neutral_row
from pbrl_mismatch.kernels.motion_kernel import simulate_serial
from pbrl_mismatch.kernels.places import PIVOT_OFF_X, PIVOT_OFF_Y
from pbrl_mismatch.search.fitted import Fitted
from pbrl_model.errors import ModelError
from pbrl_model.model_file import LearnedEffect, LearnedParameter, SavedModel, Sensor, Shape, learned, load_model
from pbrl_model.parameters import nearest
from pbrl_model.rollout import DT, com_to_origin, plain

Array = NDArray[np.float64]

DRAWS = 200
"""Draws of the posterior that a file keeps."""
OF_SENSORS = ("wrench_bias", "wrench_frame", "time_offset", "pose_bias", "grasp_compliance")
"""Effects on what is sensed: a wrench that really acts knows nothing of them."""
ROUNDS, SETTLED = 60, 1e-9
"""Rounds in which headings and levers follow the motion; a change below this [m] or [rad] ends them."""


def saved_model(
    rng: np.random.Generator, fitted: Fitted, track: Track, notes: Sequence[str] = (), *, draws: int = DRAWS
) -> SavedModel:
    """Return a fitted hypothesis in the form of a model's file.

    Args:
        rng: source of the draws: some of the fit's own, or Gaussian in its coordinates where it has none.
        fitted: baseline or hypothesis with effects.
        track: that it was fitted to.
        notes: what must not be read into it.
        draws: how many.
    """
    hypothesis, peak = fitted.hypothesis, fitted.peak
    names = (*hypothesis.told, *hypothesis.effects)
    if fitted.draws is not None:
        chosen = fitted.draws[rng.choice(len(fitted.draws), draws, replace=len(fitted.draws) < draws)]
    else:
        values, vectors = np.linalg.eigh(peak.covariance(0))
        unit = rng.standard_normal((draws, len(values)))
        chosen = peak.coordinates[0] + (unit * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    rows = hypothesis.rows(chosen)
    owners = {column: name for name in names for column in _columns(name)}
    found: dict[str, dict[str, LearnedParameter]] = {name: {} for name in ("", *names)}
    for parameter in hypothesis.parameters:
        k = COLUMN[parameter.column]
        told = learned(parameter.unit, rows[:, k], float(fitted.row[k]), positive=parameter.positive)
        found[owners.get(parameter.column, "")][parameter.column] = told
    fixed: dict[str, dict[str, float]] = {name: {} for name in found}
    for column, value, neutral in zip(COLUMNS, hypothesis.base.tolist(), neutral_row().tolist(), strict=True):
        if value != neutral and np.isfinite(value) and column not in hypothesis.columns:
            fixed[owners.get(column, "")][column] = value
    effects = [LearnedEffect(effect=name, parameters=found[name], fixed=fixed[name]) for name in names]
    return SavedModel(
        object=track.object,
        shape=_shape(track),
        parameters=found[""],
        fixed=fixed[""],
        effects=tuple(effects),
        clock=(float(track.clock[0]), float(track.clock[-1])),
        notes=tuple(notes),
        sensor=_sensor(track),
    )


def _sensor(track: Track) -> Sensor | None:
    if track.sensor is None:
        return None
    gripper, turn = track.sensor
    x, y, z = ((float(row[0]), float(row[1]), float(row[2])) for row in turn)
    return Sensor(gripper=gripper, turn=(x, y, z))


def _columns(name: str) -> set[str]:
    """Return the columns that an effect may learn or fix."""
    effect = EFFECTS[name]
    learned_columns = {column for variant in effect.variants for column in variant}
    return learned_columns.union(*(effect.given(k) for k in range(len(effect.variants))))


def _shape(track: Track) -> Shape:
    mass = track.nominal_mass
    return Shape(
        footprint=tuple((float(x), float(y)) for x, y in track.outline),
        feet=tuple((float(x), float(y)) for x, y in track.feet),
        com=(float(track.body[1]), float(track.body[2])),
        inertia_per_mass=float(track.body[0]),
        nominal_mass=float(mass) if np.isfinite(mass) else None,
    )


def load_repaired(path: Path) -> SavedModel:
    """Read a model's file and see that every effect and parameter in it can be simulated here.

    Raises:
        MismatchError: the file is missing, of another form, or has an effect or parameter that is not known.
    """
    try:
        model = load_model(path)
    except ModelError as error:
        raise MismatchError(str(error)) from None
    try:
        rows_of(model)
    except MismatchError as error:
        raise MismatchError(f"{path}: {error}") from None
    return model


def rows_of(model: SavedModel, *, draws: bool = False) -> Array:
    """Return kernel rows of a model: (1, WIDTH) of its best values, or (n, WIDTH) of its draws.

    Raises:
        MismatchError: an effect or parameter is not known, or has another unit.
    """
    for name in model.names:
        effect_named(name)
    parameters, fixed = model.all_parameters(), model.all_fixed()
    for name in (*parameters, *fixed):
        if name not in COLUMN:
            raise MismatchError(f"expected parameters that the kernel knows, got {name!r}{nearest(name, COLUMNS)}")
    for name, parameter in parameters.items():
        if parameter.unit != UNIT[name]:
            raise MismatchError(f"{name}: expected the unit {UNIT[name]}, got {parameter.unit!r}")
    count = len(parameters["mass"].draws) if draws else 1
    rows = np.tile(neutral_row(), (count, 1))
    for name, value in fixed.items():
        rows[:, COLUMN[name]] = value
    for name, parameter in parameters.items():
        rows[:, COLUMN[name]] = parameter.draws if draws else parameter.best
    return rows


def simulate_recorded(model: SavedModel, cuts: Cuts) -> Array:
    """Simulate windows of a recording with the recorded wrench: the simulation that the fit was made with.

    Args:
        model: of the object that the windows are of.
        cuts: W windows.

    Returns:
        (W, N, 3) poses of the body's frame at the recorded poses' times, as tags would see them.
    """
    return np.asarray(poses(rows_of(model), cuts)[0])


def predict_repaired(
    model: SavedModel,
    initial: ArrayLike,
    wrench: ArrayLike,
    *,
    contact: ArrayLike | None = None,
    body_wrench: bool = False,
    measured: bool = False,
    draws: bool = False,
    dt: float = DT,
    clock: float = 0.0,
) -> Array:
    """Predict a motion from a start and a sequence of wrenches, with every effect of the model.

    Args:
        model: as loaded.
        initial: (6,) state of the nominal centre of mass [m, m, rad, m/s, m/s, rad/s].
        wrench: (T, 3) [N, N, N m], constant over each step.
        contact: (2,) where the wrench is given [m], body's frame; None: at the nominal centre of mass.
        body_wrench: the force is in the body's axes, as of a gripper that holds it; False: in world axes.
        measured: the wrench is what a sensor said, whose faults are in the model; False: what really acts.
        draws: simulate every draw of the posterior; False: the best values alone.
        dt: [s].
        clock: time of the first step on the clock of the model [s]: for loads that come on, and for rhythms.

    Returns:
        (P, T + 1, 3) poses of the body's frame, P of 1 or the number of draws.

    Raises:
        MismatchError: a shape does not fit, a value is not finite, or a sensor's faults are asked for in world axes.
    """
    start, force = _checked(initial, wrench, dt)
    at = np.array(model.shape.com) if contact is None else np.asarray(contact, dtype=float)
    if at.shape != (2,) or not np.isfinite(at).all():
        raise MismatchError(f"predict: expected a contact of two finite numbers [m], got {at.tolist()}")
    rows = rows_of(model, draws=draws)
    if not measured:
        _without_sensors(rows)
    elif not body_wrench and any(name in OF_SENSORS for name in model.names):
        raise MismatchError("predict: expected a measured wrench in the body's axes, got world axes; set body_wrench")
    rows[:, [PIVOT_OFF_X, PIVOT_OFF_Y]] = 0.0  # A pin is at rest where a prediction begins.
    lever = at - np.array(model.shape.com)
    return np.stack([_predicted(row[None], model, start, force, lever, body_wrench, dt, clock) for row in rows])


def _checked(initial: ArrayLike, wrench: ArrayLike, dt: float) -> tuple[Array, Array]:
    start, force = plain(initial), plain(wrench)
    if start.shape != (6,) or force.ndim != 2 or force.shape[1:] != (3,) or len(force) == 0:
        raise MismatchError(
            f"predict: expected a state of 6 numbers and wrenches (T, 3), got shapes {start.shape} and {force.shape}"
        )
    if not (np.isfinite(start).all() and np.isfinite(force).all() and np.isfinite(dt) and dt > 0.0):
        raise MismatchError("predict: expected finite states, wrenches and a step above zero [s], got others")
    return start, force


def _without_sensors(rows: Array) -> None:
    """Set what belongs to sensors to what it is when nothing is wrong with them."""
    neutral = neutral_row()
    for column in {"delay"}.union(*(_columns(name) for name in OF_SENSORS)):
        rows[:, COLUMN[column]] = neutral[COLUMN[column]]


def _predicted(
    row: Array, model: SavedModel, start: Array, force: Array, lever: Array, turning: bool, dt: float, clock: float
) -> Array:
    """Return (T + 1, 3) poses of one row.

    The kernel takes levers and turns from a recorded motion. Here that is the motion which comes out: it is found by
    repeating, which ends because what a step does depends only on the steps before it.
    """
    shape, count = model.shape, len(force)
    com = np.array(shape.com)
    track = {
        "felt": force,
        "clock": clock + dt * np.arange(count),
        "body": np.array([shape.inertia_per_mass, *com, dt]),
        "outline": np.array(shape.footprint),
        "feet": np.array(shape.feet),
    }
    pivot, held = com_to_origin(start[:3], com), dt * np.arange(count)
    place, out = np.arange(count + 1, dtype=float)[None], np.empty((1, 1, count + 1, 3))
    span, told = np.array([[0, count, 0, count - 1]]), start[None, None]
    heading, last = np.full(count, start[2]), np.full((count + 1, 3), np.inf)
    for _ in range(ROUNDS):
        c, s = np.cos(heading), np.sin(heading)
        arm = np.column_stack([c * lever[0] - s * lever[1], s * lever[0] + c * lever[1]])
        turn = np.column_stack([c, s]) if turning else np.tile([1.0, 0.0], (count, 1))
        seen = np.zeros((count, 6))
        seen[:, 2] = heading
        simulate_serial(
            row,
            told,
            np.zeros((1, 1, 1, 3)),
            track["felt"],
            np.column_stack([turn, arm, held]),
            seen,
            track["clock"],
            span,
            pivot[None],
            track["body"],
            track["outline"],
            track["feet"],
            place,
            np.ones((1, 1), dtype=np.bool_),
            out,
        )
        found = out[0, 0]
        if not np.isfinite(found).all():
            raise MismatchError(f"predict: the motion of {model.object} is not finite; dt {dt:g} s may be too long")
        if np.abs(found - last).max() < SETTLED:
            return found.copy()
        last, heading = found.copy(), found[:-1, 2]
    raise MismatchError(f"predict: the motion of {model.object} did not settle in {ROUNDS} rounds; shorten it")
