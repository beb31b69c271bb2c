"""What a fit learned in the form of a model's file, which simulator, planner, diagnosis and export read."""

from __future__ import annotations

import math
from dataclasses import asdict

import numpy as np

from pbrl_bag.types import BodyGeometry
from pbrl_model.fitting.fit import ObjectFit
from pbrl_model.model_file import SavedModel, Shape, learned
from pbrl_model.parameters import UNITS, BodyParameters

DRAWS = 200
"""Draws of the posterior that a file keeps, at most."""
ABOVE_ZERO = ("mass", "mu_x", "mu_y", "mu_ground")
"""Parameters whose logarithm is learned from, where a model is the start of something else."""


def fitted_model(rng: np.random.Generator, found: ObjectFit, geometry: BodyGeometry) -> SavedModel:
    """Return what was learned of one object as a model's file has it.

    Args:
        rng: chooses the draws that are kept.
        found: the object's fit.
        geometry: what is known of the body.
    """
    posterior = found.posterior.canonical()
    kept, base = posterior.thinned(DRAWS, rng).flat, asdict(posterior.base)
    neutral = asdict(BodyParameters(mass=1.0))
    nominal, feet = geometry.nominal_mass, geometry.casters if len(geometry.casters) else geometry.footprint
    parameters = {}
    for k, (name, mean) in enumerate(zip(posterior.names, posterior.mean().tolist(), strict=True)):
        draws = kept[:, k]
        parameters[name] = learned(UNITS[name], draws, mean, positive=name in ABOVE_ZERO and bool((draws > 0.0).all()))
    return SavedModel(
        object=posterior.object,
        shape=Shape(
            footprint=tuple((float(x), float(y)) for x, y in geometry.footprint),
            feet=tuple((float(x), float(y)) for x, y in feet),
            com=(float(found.body.com[0]), float(found.body.com[1])),
            inertia_per_mass=found.body.inertia_per_mass,
            nominal_mass=nominal if math.isfinite(nominal) else None,
        ),
        parameters=parameters,
        fixed={
            name: value
            for name, value in base.items()
            if name not in posterior.names and math.isfinite(value) and value != neutral[name]
        },
        clock=(float(found.motions[0].time[0]), float(found.motions[-1].time[-1])),
        notes=posterior.notes,
    )
