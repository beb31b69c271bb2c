"""What was learned online, on disk: one file for each object, enough to serve it and to go on from it.

A file is written beside its place and then moved there, so that it is whole at any moment. It is a NumPy archive of
arrays and one text, JSON, that says what they are.
"""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import BodyGeometry
from pbrl_model.errors import ModelError
from pbrl_model.fitting.options import FitOptions
from pbrl_model.inference.cloud import Cloud
from pbrl_model.online.cloud import Tracked
from pbrl_model.online.memory import Learned, target_of
from pbrl_model.parameters import BodyParameters
from pbrl_model.posterior import Posterior
from pbrl_model.sensing.motion import Motion
from pbrl_model.sensing.windows import Windows

Array = NDArray[np.float64]

FORMAT = "pbrl object model"
VERSION = 1
OPTIONS = ("model_class", "likelihood", "priors", "window", "left_out_force", "gravity")
"""Of the fit: with others the particles would be of another posterior, so learning goes on with these."""
COUNTS = ("oriented", "since", "delay", "searched", "updates", "episodes", "seen")
"""Fields of `Learned` that are written as they are."""
ARRAYS = ("steps", "wrench", "initial", "pose", "noise", "start")
"""Fields of `Windows` that must be of one length."""


@dataclass(frozen=True)
class Stored:
    """What one file holds: what is published, and what learning goes on from, with the options of the fit."""

    learned: Learned
    posterior: Posterior
    fit: FitOptions


def file_of(folder: Path, name: str) -> Path:
    """Return where an object's state is kept."""
    return folder / f"{quote(name, safe=' ')}.npz"


def prepare(folder: Path) -> None:
    """Make the folder if it is missing.

    Raises:
        ModelError: it cannot be made or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ModelError(
            f"{folder}: expected a folder to keep models in, got {error.strerror}; give another (state)"
        ) from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise ModelError(
            f"{folder}: expected a folder that can be written to; change its rights or give another (state)"
        )


def save(folder: Path, stored: Stored) -> None:
    """Write one object's state.

    Raises:
        ModelError: the disk is full, or the folder is gone.
    """
    arrays: dict[str, np.ndarray] = {}
    learned, posterior = stored.learned, stored.posterior
    head: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "options": stored.fit.model_dump(mode="json", include=set(OPTIONS)),
        "geometry": _pack(learned.geometry, "geometry", arrays),
        "posterior": _pack(posterior, "posterior", arrays, leave_out=("base",)),
        "base": _pack(posterior.base, "base", arrays),
        "motions": [_pack(motion, f"motion{k}", arrays) for k, motion in enumerate(learned.motions)],
        "windows": None if learned.windows is None else _pack(learned.windows, "windows", arrays),
        "cloud": None if learned.tracked is None else _pack(learned.tracked.cloud, "cloud", arrays),
        "counts": {name: getattr(learned, name) for name in COUNTS},
    }
    path = file_of(folder, learned.geometry.name)
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    arrays["head"] = np.frombuffer(json.dumps(head).encode(), dtype=np.uint8)
    try:
        with beside.open("wb") as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]
            file.flush()
            os.fsync(file.fileno())
        beside.replace(path)
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise ModelError(f"{path}: expected to write the state of an object, got {error.strerror}") from None


def load_all(folder: Path) -> dict[str, Stored]:
    """Read every object of a folder; files of other kinds than *.npz are not looked at.

    Raises:
        ModelError: a file is damaged or is something else.
    """
    found = [load(path) for path in sorted(folder.glob("*.npz"))]
    return {stored.posterior.object: stored for stored in found}


def load(path: Path) -> Stored:
    """Read one object's state.

    Raises:
        ModelError: the file is damaged or is something else.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        head = json.loads(bytes(arrays["head"]).decode())
        kind, version = head["format"], head["version"]
    except (OSError, ValueError, KeyError, EOFError, TypeError, zipfile.BadZipFile) as error:
        raise _wrong(path, f"something that cannot be read ({' '.join(str(error).split())})") from None
    if kind != FORMAT or version != VERSION:
        raise _wrong(path, f"{kind!r} of version {version!r}")
    try:
        stored = _unpacked(head, arrays)
        _check(stored)
    except (KeyError, ValueError, TypeError, IndexError, ModelError) as error:
        raise _wrong(path, f"one whose parts do not fit ({' '.join(str(error).split())})") from None
    return stored


def _wrong(path: Path, got: str) -> ModelError:
    return ModelError(
        f"{path}: expected the state of an object (version {VERSION}), got {got}; move the file away or give another "
        "folder (state)"
    )


def _unpacked(head: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Stored:
    fit = FitOptions(**{name: head["options"][name] for name in OPTIONS})
    geometry = BodyGeometry(**_unpack(BodyGeometry, head["geometry"], "geometry", arrays))
    base = BodyParameters(**_unpack(BodyParameters, head["base"], "base", arrays))
    posterior = Posterior(**_unpack(Posterior, head["posterior"], "posterior", arrays, leave_out=("base",)), base=base)
    motions = [Motion(**_unpack(Motion, one, f"motion{k}", arrays)) for k, one in enumerate(head["motions"])]
    counts: dict[str, Any] = {name: head["counts"][name] for name in COUNTS} | {"since": tuple(head["counts"]["since"])}
    learned = Learned(geometry, motions=tuple(motions), **counts)
    if head["windows"] is not None:
        learned = replace(learned, windows=Windows(**_unpack(Windows, head["windows"], "windows", arrays)))
    if head["cloud"] is not None and learned.windows is not None:
        cloud = Cloud(**_unpack(Cloud, head["cloud"], "cloud", arrays))
        target = target_of(learned, learned.windows, fit)
        learned = replace(learned, tracked=Tracked(cloud, target))
    return Stored(learned, posterior, fit)


def _check(stored: Stored) -> None:
    """Raise a ModelError where particles and windows do not fit to each other."""
    learned = stored.learned
    for motion in learned.motions:
        if len(motion.time) != len(motion.wrench) + 1 or len(motion.state) != len(motion.time):
            raise ModelError(f"a motion of {len(motion.time)} times has {len(motion.wrench)} wrenches")
    if learned.windows is not None and len({len(getattr(learned.windows, name)) for name in ARRAYS}) != 1:
        raise ModelError("windows of different numbers")
    if learned.tracked is None:
        return
    cloud, target = learned.tracked.cloud, learned.tracked.target
    count = len(cloud.log_weight)
    if cloud.position.shape != (count, target.dimension) or len(cloud.base) != count or len(cloud.group) != count:
        raise ModelError(f"expected {count} particles of {target.dimension} numbers, got {cloud.position.shape}")
    if not (np.isfinite(cloud.position).all() and np.isclose(np.exp(cloud.log_weight).sum(), 1.0)):
        raise ModelError("particles or weights that are not finite")


def _pack(item: Any, prefix: str, arrays: dict[str, np.ndarray], leave_out: tuple[str, ...] = ()) -> dict[str, Any]:
    """Put a dataclass's arrays beside the others; return the rest of it."""
    rest = {}
    for entry in fields(item):
        value = getattr(item, entry.name)
        if entry.name in leave_out:
            continue
        if isinstance(value, np.ndarray):
            arrays[f"{prefix}.{entry.name}"] = value
        else:
            rest[entry.name] = value
    return rest


def _unpack(
    kind: type, rest: Mapping[str, Any], prefix: str, arrays: Mapping[str, np.ndarray], leave_out: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Return a dataclass's fields by name; lists were tuples."""
    names = [entry.name for entry in fields(kind) if entry.name not in leave_out]
    values = {name: arrays[f"{prefix}.{name}"] if f"{prefix}.{name}" in arrays else rest[name] for name in names}
    return {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
