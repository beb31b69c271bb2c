"""A learned model's file as what is concealed in a scene: the simulator shows the physics that a diagnosis found.

Only the file's words are shared with those who write it. Forces come from the bodies here, so that what is shown is the
thing and not the learner's law: a cord, a tile, ballast.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import ConfigDict, Field

from bullet_sim.catalogue import Body, Fixture
from bullet_sim.concealed.from_model import MAKERS, body_itself
from bullet_sim.concealed.told import Sensor, Told
from bullet_sim.errors import SimError, nearest
from bullet_sim.settings import Settings, Vector3, parse_settings


class _Loose(Settings):
    """Takes from a file what it knows, and leaves the rest: draws, footprint, notes."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


class LearnedNumber(_Loose):
    """The most likely value of one parameter."""

    best: float


class LearnedEffect(_Loose):
    """One effect by its name, what was learned of it and what was not."""

    effect: str
    parameters: dict[str, LearnedNumber]
    fixed: dict[str, float] = Field(default_factory=dict)


class LearnedWith(_Loose):
    """The force sensor that the model was learned with, and its axes in the body's frame."""

    gripper: str
    turn: tuple[Vector3, Vector3, Vector3]


class ModelFile(_Loose):
    """What a simulator needs of a model's file."""

    format: Literal["pbrl_model/model/1"]
    object: str
    parameters: dict[str, LearnedNumber]
    fixed: dict[str, float] = Field(default_factory=dict)
    effects: tuple[LearnedEffect, ...] = ()
    clock: tuple[float, float] = (0.0, 0.0)
    sensor: LearnedWith | None = None


def read_model(path: Path) -> ModelFile:
    """Read a model's file.

    Raises:
        SimError: no such file, not JSON, or not a model; one line.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise SimError(f"{path}: expected a model's file, got {type(error).__name__}") from error
    except (ValueError, RecursionError) as error:
        raise SimError(f"{path}: expected JSON, got {' '.join(str(error).split())}") from error
    return parse_settings(data, ModelFile, str(path))


def concealed_of(path: Path, bodies: Mapping[str, Body], name: str | None = None) -> dict[str, Any]:
    """Return the part of `concealed` that makes a body of a scene behave as a model says.

    Args:
        path: of the model.
        bodies: of the scene.
        name: of the body; None: as the model has it.

    Raises:
        SimError: the file cannot be used, the scene has no such body, or an effect cannot be made from it; one line.
    """
    model = read_model(path)
    target = name or model.object
    if target not in bodies:
        raise SimError(f"{path}: no body {target!r} in this scene; {nearest(target, bodies)}")
    body = bodies[target]
    if isinstance(body, Fixture):
        raise SimError(f"{path}: expected a body that can move, got {target!r}, which is a fixture")
    values = {name: each.best for name, each in model.parameters.items()} | model.fixed
    for effect in model.effects:
        if effect.effect not in MAKERS:
            raise SimError(
                f"{path}: {effect.effect}: expected an effect that a simulator can make from numbers "
                f"({', '.join(MAKERS)}), got one that it does not know"
            )
        values |= {name: each.best for name, each in effect.parameters.items()} | effect.fixed
    sensor = None if model.sensor is None else Sensor(model.sensor.gripper, np.array(model.sensor.turn))
    told = Told(target, body, values, tuple(effect.effect for effect in model.effects), sensor, model.clock[0])
    try:
        found = body_itself(told)
        for effect in model.effects:
            for key, setting in MAKERS[effect.effect](told).items():
                found[key] = _joined(found.get(key), setting)
    except KeyError as error:
        raise SimError(f"{path}: expected a parameter {error}, got none") from error
    except ValueError as error:
        raise SimError(f"{path}: {error}") from error
    return found


def _joined(first: Any, second: Any) -> Any:
    """Return two settings of one key as one."""
    if isinstance(second, list):
        return [*(first or []), *second]
    return second if first is None or not isinstance(second, dict) else {**first, **second}
