"""From a posterior to one model to act on, and how sure its class is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from pbrl_control.constraints.classes import DEFAULTS, ConstraintSettings, ModelClass, classify
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.planar import Array
from pbrl_model.parameters import BodyParameters
from pbrl_model.posterior import Posterior
from pbrl_model.symmetry import wheel_features

DRAWS = 200  # classified at most; that many tell a probability to a few per cent


@dataclass(frozen=True)
class ClassBelief:
    """What a posterior says of an object's model class.

    Attributes:
        model: the draw to act on: of the likeliest class the one nearest to that class's mean. A mean over all draws
            may be a wheel that no draw has, half-way between two modes.
        probabilities: share of the draws in each class; they add to one.
    """

    model: ObjectModel
    probabilities: Mapping[ModelClass, float]

    @property
    def model_class(self) -> ModelClass:
        """The likeliest class; the more constrained one of two alike."""
        return _likeliest(self.probabilities)

    @classmethod
    def of(
        cls,
        posterior: Posterior,
        footprint: ArrayLike,
        pose: Array | None = None,
        settings: ConstraintSettings = DEFAULTS,
    ) -> Self:
        """Classify draws of a posterior and choose one.

        Args:
            posterior: of the object, as `pbrl_model` publishes it.
            footprint: (k, 2) outline in the object's frame [m]; density is taken as uniform.
            pose: (3,) of the object in `world` [m, rad]; needed where it hangs on a hinge at a distance.
            settings: what counts as a constraint.

        Raises:
            ControlError: the footprint is no polygon, a draw is not physical, or a pose is needed and there is none.
        """
        rows = posterior.rows()
        chosen = np.linspace(0, len(rows) - 1, min(DRAWS, len(rows))).astype(int)
        models = [ObjectModel.uniform(BodyParameters.from_vector(row), footprint) for row in rows[chosen]]
        classes = np.array([classify(model, pose, settings).value for model in models])
        probabilities = {each: float(np.mean(classes == each.value)) for each in ModelClass}
        of_class = np.flatnonzero(classes == _likeliest(probabilities).value)
        features = wheel_features(posterior.flat[chosen[of_class]], posterior.names)
        return cls(models[of_class[_most_typical(features)]], probabilities)


def _most_typical(features: Array) -> int:
    """Return which row (n, K) is nearest to the mean of all, each column over its standard deviation."""
    spread = features.std(axis=0)
    away = (features - features.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)
    return int(np.argmin((away**2).sum(axis=1)))


def _likeliest(probabilities: Mapping[ModelClass, float]) -> ModelClass:
    freedom = (ModelClass.STATIC, ModelClass.FIXED_POINT, ModelClass.ANISOTROPIC, ModelClass.UNCONSTRAINED)
    return max(freedom, key=lambda each: probabilities[each])
