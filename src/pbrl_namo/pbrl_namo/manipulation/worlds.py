"""Sampled worlds: what one thing may be like, and what it then is free to do (thesis 6.2.1 step 1, figure 40)."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_control.constraints.classes import ConstraintSettings, Freedom, ModelClass, hinge_centre
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.constraints.twist import projection
from pbrl_control.errors import ControlError
from pbrl_control.planar import Array
from pbrl_namo.beliefs.belief import ObjectBelief
from pbrl_namo.errors import NamoError

PHYSICS = (
    "mass",
    "inertia_per_mass",
    "com_x",
    "com_y",
    "mu_ground",
    "wheel_x",
    "wheel_y",
    "axis_x",
    "axis_y",
    "mu_x",
    "mu_y",
    "hinges",
    "anchor_x",
    "anchor_y",
    "line_x",
    "line_y",
)
"""Columns of what the kernel for grip forces knows of a world. Axis: direction of the wheel's x axis. Hinges: 0 without
a distance joint, 1 for a bar along the line, 2 for a pivot at the anchor."""


@dataclass(frozen=True)
class Worlds:
    """One thing in each of some worlds.

    Attributes:
        models: its physics, world by world.
        freedoms: what it is free to do.
        projections: (w, 3, 3) from wanted to allowed twists of its origin in its axes; zero of a static one.
        physics: (w, 16) in the columns of `PHYSICS`.
    """

    models: tuple[ObjectModel, ...]
    freedoms: tuple[Freedom, ...]
    projections: Array
    physics: Array

    @classmethod
    def sample(
        cls, belief: ObjectBelief, pose: Array, rng: np.random.Generator, count: int, settings: ConstraintSettings
    ) -> Worlds:
        """Draw worlds.

        Args:
            belief: of the thing.
            pose: (3,) of it in `world` [m, rad].
            rng: of the draw.
            count: how many.
            settings: what counts as a constraint.

        Raises:
            NamoError: a draw cannot be, for instance a hinge at the very place of its anchor.
        """
        models = tuple(belief.models(rng, count))
        try:
            freedoms = tuple(Freedom.of(model, pose, settings) for model in models)
            physics = np.array([physics_of(model, pose) for model in models])
        except ControlError as error:
            raise NamoError(f"belief: {error}") from error
        projections = np.array([projection(model, each) for model, each in zip(models, freedoms, strict=True)])
        return cls(models, freedoms, projections, physics)

    def __len__(self) -> int:
        return len(self.models)

    def only(self, world: int) -> Worlds:
        """Return one of them."""
        one = slice(world, world + 1)
        return Worlds(self.models[one], self.freedoms[one], self.projections[one], self.physics[one])

    def classes(self) -> list[ModelClass]:
        """Return the model class in each world."""
        return [freedom.model_class for freedom in self.freedoms]

    def usual(self) -> NDArray[np.bool_]:
        """Say which worlds (w,) are of the class that most are of in which the thing can be moved; none if in none."""
        classes = self.classes()
        kinds = Counter(each for each in classes if each != ModelClass.STATIC)
        most = kinds.most_common(1)[0][0] if kinds else None
        return np.array([each == most for each in classes], dtype=bool)

    def typical(self) -> int:
        """Return the world in the middle of the usual ones, by the point that the thing turns about.

        Raises:
            NamoError: the thing can be moved in none.
        """
        usual = np.flatnonzero(self.usual())
        if not len(usual):
            raise NamoError("worlds: expected one in which the thing can be moved, got none")
        anchors = np.array([self.freedoms[w].anchor for w in usual])
        return int(usual[np.argmin(np.hypot(*(anchors - np.median(anchors, axis=0)).T))])

    def mobile(self) -> float:
        """Return the share of worlds in which the thing can be moved at all."""
        return float(np.mean([each != ModelClass.STATIC for each in self.classes()]))


def physics_of(model: ObjectModel, pose: Array) -> list[float]:
    """Return a row (16,) of `PHYSICS`; the pose (3,) is of the thing in `world`."""
    parameters = model.parameters
    hinges, line = 0.0, np.zeros(2)
    anchor = np.array([parameters.anchor_x, parameters.anchor_y])
    if parameters.has_hinge:
        hinges = 2.0 if parameters.hinge_radius == 0.0 else 1.0
        if hinges == 1.0:
            line = (hinge_centre(model, pose) - anchor) / parameters.hinge_radius
    axis = model.wheel_axes[0]
    return [
        parameters.mass,
        model.inertia_per_mass,
        *model.com,
        parameters.mu_ground,
        parameters.wheel_x,
        parameters.wheel_y,
        *axis,
        parameters.mu_x,
        parameters.mu_y,
        hinges,
        *anchor,
        *line,
    ]
