"""Posteriors to and from pbrl_msgs, in pairs; no node needed."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from pbrl_msgs.msg import ObjectModel, ObjectModels

from pbrl_model.errors import ModelError
from pbrl_model.parameters import UNITS, BodyParameters, column_indices
from pbrl_model.posterior import Posterior


def posterior_to_msg(posterior: Posterior) -> ObjectModel:
    """Return the posterior as a message; every wheel as its one representative (see `symmetry`)."""
    canonical = posterior.canonical()
    flat = canonical.flat
    return ObjectModel(
        object=canonical.object,
        model_class=canonical.model_class,
        parameters=list(canonical.names),
        units=list(canonical.units),
        mean=canonical.mean().tolist(),
        sd=canonical.sd().tolist(),
        draws=len(flat),
        samples=flat.ravel().tolist(),
        log_evidence=canonical.log_evidence,
        heldout_rmse=canonical.heldout_rmse,
        notes=list(canonical.notes),
    )


def posterior_from_msg(message: ObjectModel) -> Posterior:
    """Return the posterior that a message carries, as one chain; what was not learned has its default.

    Raises:
        ModelError: a name is unknown, a unit is another, or the lengths do not fit.
    """
    names = tuple(message.parameters)
    label = f"ObjectModel of {message.object!r}"
    column_indices(names)
    units = tuple(UNITS[name] for name in names)
    if tuple(message.units) != units:
        raise ModelError(f"{label}: expected units {', '.join(units)}, got {', '.join(message.units)}")
    if len(message.samples) != message.draws * len(names):
        raise ModelError(
            f"{label}: expected {message.draws} draws of {len(names)} parameters, got {len(message.samples)} samples"
        )
    return Posterior(
        object=message.object,
        model_class=message.model_class,
        names=names,
        draws=np.array(message.samples, dtype=float).reshape(1, message.draws, len(names)),
        base=BodyParameters(mass=1.0),
        log_evidence=message.log_evidence,
        heldout_rmse=message.heldout_rmse,
        notes=tuple(message.notes),
    )


def models_to_msg(posteriors: Iterable[Posterior], stamp: object, frame: str = "world") -> ObjectModels:
    """Return posteriors as one message.

    Args:
        posteriors: one for each object.
        stamp: builtin_interfaces/Time, the end of the last data used.
        frame: in which hinges are given.
    """
    message = ObjectModels(models=[posterior_to_msg(posterior) for posterior in posteriors])
    message.header.stamp = stamp
    message.header.frame_id = frame
    return message


def models_from_msg(message: ObjectModels) -> dict[str, Posterior]:
    """Return posteriors by object.

    Raises:
        ModelError: one of them is malformed.
    """
    return {model.object: posterior_from_msg(model) for model in message.models}
