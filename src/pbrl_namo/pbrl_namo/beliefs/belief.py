"""What is believed of one thing's physics: draws of its parameters, all with the same weight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_control.constraints.classes import DEFAULTS, ConstraintSettings, ModelClass, classify
from pbrl_control.constraints.object_model import MAY_BE_NAN, NOT_NEGATIVE, ObjectModel, check_parameters
from pbrl_control.errors import ControlError
from pbrl_control.planar import Array
from pbrl_model.errors import ModelError
from pbrl_model.parameters import KERNEL_COLUMNS, BodyParameters, expand
from pbrl_namo.beliefs.furniture import furniture_rows
from pbrl_namo.beliefs.settings import BeliefSettings
from pbrl_namo.beliefs.stops import Stop
from pbrl_namo.errors import NamoError
from pbrl_namo.scene import Movable

CLASSIFIED = 200  # draws at most; that many tell a probability to a few per cent
UNKNOWN_MASS = 15.0  # [kg] of a thing whose mass neither draws nor a person tell


@dataclass(frozen=True)
class ObjectBelief:
    """Draws from what is believed of one thing.

    Attributes:
        footprint: (k, 2) outline in its own frame [m]; density is taken as uniform (thesis 5.3.1).
        rows: (n, 12) parameters in the order of `KERNEL_COLUMNS`, read-only.
        stops: where it is not to go again, for something was met there.

    Raises:
        NamoError: the rows have another shape, there are none, or one is no body's.
    """

    footprint: Array
    rows: Array
    stops: tuple[Stop, ...] = ()

    def __post_init__(self) -> None:
        rows = np.array(self.rows, dtype=float)
        if rows.ndim != 2 or rows.shape[1] != len(KERNEL_COLUMNS) or not len(rows):
            raise NamoError(f"belief: expected draws (n, {len(KERNEL_COLUMNS)}) with n >= 1, got shape {rows.shape}")
        rows.flags.writeable = False
        object.__setattr__(self, "rows", rows)
        try:
            shape = ObjectModel.uniform(BodyParameters(mass=1.0), self.footprint)
            for row in rows[_suspect(rows)]:
                check_parameters(BodyParameters.from_vector(row))
        except ControlError as error:
            raise NamoError(f"belief: {error}") from error
        object.__setattr__(self, "_shape", shape)

    def models(self, rng: np.random.Generator, count: int) -> list[ObjectModel]:
        """Return the models of `count` worlds (thesis 6.2.1, step 1).

        Systematic: draws at equal distances from a random first one. Kinds that lie together in the rows are had in
        their shares, so that fewer worlds tell a ratio as well; rows that lie in no order are as good as independent.

        Raises:
            NamoError: fewer than one is asked for.
        """
        if count < 1:
            raise NamoError(f"belief: expected at least one world, got {count}")
        chosen = ((np.arange(count) + rng.random()) / count * len(self.rows)).astype(int)
        shape: ObjectModel = self.__dict__["_shape"]
        return [
            ObjectModel(BodyParameters.from_vector(row), shape.footprint, shape.com, shape.inertia_per_mass)
            for row in self.rows[np.minimum(chosen, len(self.rows) - 1)]
        ]

    def classes(self, pose: Array | None = None, settings: ConstraintSettings = DEFAULTS) -> Mapping[ModelClass, float]:
        """Return the probability of each model class (thesis figure 40).

        Args:
            pose: (3,) of the thing in `world` [m, rad]; needed where it may hang on a hinge at a distance.
            settings: what counts as a constraint.

        Raises:
            ControlError: a pose is needed and there is none.
        """
        models = self.models(np.random.default_rng(0), min(CLASSIFIED, len(self.rows)))
        found = [classify(model, pose, settings) for model in models]
        return {each: found.count(each) / len(found) for each in ModelClass}


def _suspect(rows: Array) -> NDArray[np.bool_]:
    """Say which rows (n,) some number of is not as any body's: `check_parameters` then says what is wrong."""
    finite = np.isfinite(rows) | (np.isnan(rows) & (np.array(KERNEL_COLUMNS) == MAY_BE_NAN))
    negative = (rows < 0.0) & np.isin(KERNEL_COLUMNS, NOT_NEGATIVE)
    fine: NDArray[np.bool_] = (finite & ~negative).all(axis=1) & (rows[:, KERNEL_COLUMNS.index("mass")] > 0.0)
    return ~fine


def prior_belief(movable: Movable, rng: np.random.Generator, settings: BeliefSettings | None = None) -> ObjectBelief:
    """Return what is believed of a thing that nobody has pushed: a mixture over what furniture is like.

    Args:
        movable: its outline and the mass that a person would guess.
        rng: of every draw.
        settings: what furniture is like.

    Raises:
        NamoError: the mass is not above zero, or no kind of furniture has a weight.
    """
    settings = settings or BeliefSettings()
    return ObjectBelief(movable.footprint, furniture_rows(movable.footprint, movable.mass, rng, settings))


def belief_of_draws(movable: Movable, names: Sequence[str], samples: Array) -> ObjectBelief:
    """Return the belief that a posterior's draws make, as `/object_models` carries them.

    What was not learned is as of a body without wheel, hinge and friction; a mass that was not learned is the guessed
    one.

    Args:
        movable: the thing.
        names: K names among `KERNEL_COLUMNS`.
        samples: (n, K), or flat in row-major order.

    Raises:
        NamoError: a name is unknown or twice there, shapes do not fit, or a draw is not physical.
    """
    values = np.asarray(samples, dtype=float)
    width = len(names)
    if not width or len(set(names)) != width:
        raise NamoError(f"belief: expected each parameter's name once, got {list(names)}")
    if values.ndim == 1:
        if not values.size or values.size % width:
            raise NamoError(
                f"belief: expected samples in rows of {width} ({', '.join(names)}), got {values.size} numbers"
            )
        values = values.reshape(-1, width)
    if values.ndim != 2 or not len(values) or not np.isfinite(values).all():
        raise NamoError(f"belief: expected finite samples (n, {width}) with n >= 1, got shape {values.shape}, or NaN")
    guess = movable.mass if np.isfinite(movable.mass) else UNKNOWN_MASS
    try:
        rows = expand(values, names, BodyParameters(mass=guess))
    except ModelError as error:
        raise NamoError(f"belief: {error}") from error
    return ObjectBelief(movable.footprint, rows)
