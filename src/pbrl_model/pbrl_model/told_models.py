"""Models of files as what is known of objects before anything is heard: a fit's posterior, a diagnosis's model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pbrl_model.arviz_bridge import load_posterior
from pbrl_model.errors import ModelError
from pbrl_model.model_file import SIMULATES_ALL, SavedModel, load_model, posterior_of, unsaid, without
from pbrl_model.parameters import HINGE_COLUMNS, KERNEL_COLUMNS, BodyParameters
from pbrl_model.posterior import Posterior

TOGETHER = (("wheel_x", "wheel_y"), HINGE_COLUMNS)
"""What a place consists of."""


@dataclass(frozen=True)
class ToldModel:
    """What a file says of one object.

    Attributes:
        path: of the file.
        posterior: the body's own parameters; notes say which effects are not among them.
        left_out: names of these effects.
        until: end of the data that it was learned from, on their recording's clock [s]; 0 where the file does not say.
    """

    path: Path
    posterior: Posterior
    left_out: tuple[str, ...] = ()
    until: float = 0.0


def told_models(paths: Sequence[Path]) -> dict[str, ToldModel]:
    """Return what files say, by object.

    Args:
        paths: `posterior_NAME.nc` of fit, or `model_NAME.json` of fit or diagnose.

    Raises:
        ModelError: a file is missing or none of a model, or two are of one object.
    """
    found: dict[str, ToldModel] = {}
    for path in paths:
        told = told_model(path)
        name = told.posterior.object
        if name in found:
            raise ModelError(f"{path}: expected one file of an object, got a second of {name!r} ({found[name].path})")
        found[name] = told
    return found


def told_model(path: Path) -> ToldModel:
    """Return what one file says of its object.

    Effects that `pbrl_model` has no word for are left out: the body's own parameters are as they are beside them.

    Raises:
        ModelError: it is missing or none of a model.
    """
    if path.suffix.lower() != ".json":
        return ToldModel(path, _whole(path, load_posterior(path)))
    model = load_model(path)
    left_out = unsaid(model)
    try:
        posterior = posterior_of(without(model, left_out))
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from None
    if left_out:
        posterior = replace(posterior, notes=(*posterior.notes, _not_in_it(model, left_out)))
    return ToldModel(path, _whole(path, posterior), left_out, model.clock[1])


def _not_in_it(model: SavedModel, left_out: Sequence[str]) -> str:
    names, beside = " and ".join(left_out), "it" if len(left_out) == 1 else "them"
    return f"without {names} of {model.object}, which {SIMULATES_ALL} simulates: parameters are as beside {beside}"


def _whole(path: Path, posterior: Posterior) -> Posterior:
    """Return a posterior whose draws hold what was not learned, too, where it is not what it is when nothing is said.

    A message carries draws alone, and half a place is none.
    """
    base, neutral = posterior.base.to_vector(), BodyParameters(mass=1.0).to_vector()
    needed = {name for group in TOGETHER if set(group) & set(posterior.names) for name in group}
    told = {
        name: float(value)
        for name, value, off in zip(KERNEL_COLUMNS, base, neutral, strict=True)
        if name not in posterior.names and (name in needed or (np.isfinite(value) and value != off))
    }
    unknown = [name for name, value in told.items() if not np.isfinite(value)]
    if unknown:
        raise ModelError(f"{path}: expected {', '.join(unknown)} beside {', '.join(posterior.names)}, got none")
    columns = [np.full((*posterior.draws.shape[:2], 1), value) for value in told.values()]
    return replace(
        posterior, names=(*posterior.names, *told), draws=np.concatenate([posterior.draws, *columns], axis=-1)
    )
