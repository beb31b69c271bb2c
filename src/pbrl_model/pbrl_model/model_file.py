"""A learned model as a JSON file: parameters with units, draws, and the effects that a diagnosis added.

The effects are named here and not simulated: `pbrl_mismatch.repaired` does that. What a model of `pbrl_model` can say
by itself (`IN_OUR_TERMS`) becomes a `Posterior` like any other.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from pbrl_model.errors import ModelError
from pbrl_model.parameters import KERNEL_COLUMNS, UNITS, WHEEL_COLUMNS, BodyParameters, nearest
from pbrl_model.posterior import Posterior

Array = NDArray[np.float64]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Axis = tuple[Finite, Finite, Finite]

FORMAT: Final = "pbrl_model/model/1"
IN_OUR_TERMS = ("second_wheel", "ground_friction")
"""Effects that a model of `pbrl_model` has a word for: one wheel, and friction of the whole body."""
SIMULATES_ALL = "pbrl_mismatch.repaired"
"""What simulates every effect; a name, because imports run the other way."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class LearnedParameter(_Strict):
    """One parameter.

    Attributes:
        unit: of all that follows.
        mean: of the posterior.
        sd: of the posterior.
        best: most likely value: what a single simulation is made with.
        positive: whether it is above zero and its logarithm is what was learned.
        draws: of the posterior, in the order of the draws of all others.
    """

    unit: str
    mean: Finite
    sd: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    best: Finite
    positive: bool = False
    draws: Annotated[tuple[Finite, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _above_zero(self) -> LearnedParameter:
        if self.positive and not (self.best > 0.0 and min(self.draws) > 0.0):
            raise ValueError("expected values above zero of a parameter that is positive")
        return self


class LearnedEffect(_Strict):
    """One effect: its parameters by name, and values that were not learned."""

    effect: str
    parameters: dict[str, LearnedParameter]
    fixed: dict[str, Finite] = Field(default_factory=dict)


class Shape(_Strict):
    """What is known of the body.

    Attributes:
        footprint: outline [m], counter-clockwise, body's frame.
        feet: points that carry the load [m].
        com: nominal centre of mass [m].
        inertia_per_mass: nominal moment of inertia about it, over the mass [m^2].
        nominal_mass: [kg]; None: nobody said.
    """

    footprint: Annotated[tuple[tuple[Finite, Finite], ...], Field(min_length=3)]
    feet: Annotated[tuple[tuple[Finite, Finite], ...], Field(min_length=1)]
    com: tuple[Finite, Finite]
    inertia_per_mass: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    nominal_mass: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] | None = None


class Sensor(_Strict):
    """The force sensor that a model was learned with: its faults are told in the axes that the body had then.

    Attributes:
        gripper: whose it is.
        turn: (3, 3) rotation from its axes to the body's when it first held the body.
    """

    gripper: Annotated[str, Field(min_length=1)]
    turn: tuple[Axis, Axis, Axis]


class SavedModel(_Strict):
    """A model of one object.

    Attributes:
        format: of the file.
        object: name of the body.
        shape: what is known of it.
        parameters: of the body itself, by name.
        fixed: values of the body itself that were not learned and are not what they are when nothing is said.
        effects: what was added.
        clock: the recording's first and last moment: times among the parameters are on this clock [s].
        notes: what must not be read into it, in sentences.
        sensor: None: several, or where it was is not known.
    """

    format: Literal["pbrl_model/model/1"] = FORMAT
    object: Annotated[str, Field(min_length=1)]
    shape: Shape
    parameters: dict[str, LearnedParameter]
    fixed: dict[str, Finite] = Field(default_factory=dict)
    effects: tuple[LearnedEffect, ...] = ()
    clock: tuple[Finite, Finite] = (0.0, 0.0)
    notes: tuple[str, ...] = ()
    sensor: Sensor | None = None

    @model_validator(mode="after")
    def _fits(self) -> SavedModel:
        counts = {len(parameter.draws) for parameter in self.all_parameters().values()}
        if len(counts) != 1:
            raise ValueError(f"expected parameters with draws, as many of each, got {sorted(counts) or 'none'}")
        if "mass" not in self.parameters:
            raise ValueError("parameters: expected at least the mass, got none")
        for name, parameter in self.parameters.items():
            if parameter.unit != UNITS.get(name, parameter.unit):
                raise ValueError(f"parameters.{name}.unit: expected {UNITS[name]}, got {parameter.unit!r}")
        if len(set(self.names)) != len(self.effects):
            raise ValueError(f"effects: expected each once, got {', '.join(self.names)}")
        return self

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the effects."""
        return tuple(each.effect for each in self.effects)

    def all_parameters(self) -> dict[str, LearnedParameter]:
        """Return the parameters of the body and of every effect by name."""
        found = dict(self.parameters)
        for each in self.effects:
            found |= each.parameters
        return found

    def all_fixed(self) -> dict[str, float]:
        """Return what was not learned, of the body and of every effect."""
        found = dict(self.fixed)
        for each in self.effects:
            found |= each.fixed
        return found


def save_model(model: SavedModel, path: Path) -> None:
    """Write a model; the file is there whole or not at all.

    Raises:
        ModelError: it cannot be written.
    """
    unfinished = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished.write_text(json.dumps(model.model_dump(mode="json"), indent=1) + "\n", encoding="utf-8")
        unfinished.replace(path)
    except OSError as error:
        raise ModelError(f"{path}: expected to write a model there, got {' '.join(str(error).split())}") from None


def load_model(path: Path) -> SavedModel:
    """Read what `save_model` wrote.

    Raises:
        ModelError: the file is missing, cut off or of another form.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"{path}: expected a model's file, got {type(error).__name__}") from None
    except (ValueError, RecursionError) as error:
        raise ModelError(f"{path}: expected JSON, got {' '.join(str(error).split())}") from None
    if not isinstance(data, Mapping) or data.get("format") != FORMAT:
        got = data.get("format") if isinstance(data, Mapping) else type(data).__name__
        raise ModelError(f"{path}: expected a model of format {FORMAT}, got {got!r}")
    try:
        return SavedModel.model_validate(data)
    except ValidationError as error:
        raise ModelError(f"{path}: {_first(error)}") from None


def _first(error: ValidationError) -> str:
    """Return the first fault in one line."""
    fault = error.errors(include_url=False)[0]
    place = ".".join(str(part) for part in fault["loc"])
    if fault["type"] == "extra_forbidden":
        hint = nearest(str(fault["loc"][-1]), list(SavedModel.model_fields))
        return f"{place}: unknown key{hint}"
    told = " ".join(fault["msg"].removeprefix("Value error, ").split())
    got = "" if fault["type"] in ("value_error", "missing") else f", got {str(fault['input'])[:40]!r}"
    return f"{place}{': ' if place else ''}{told}{got}"


def unsaid(model: SavedModel) -> tuple[str, ...]:
    """Return the names of the effects that `posterior_of` has no word for: two wheels are one too many."""
    wheels = "mu_x" in model.parameters
    return tuple(name for name in model.names if name not in IN_OUR_TERMS or (name == "second_wheel" and wheels))


def without(model: SavedModel, names: Sequence[str]) -> SavedModel:
    """Return a model without some of its effects; the body's own parameters stay as they were learned beside them."""
    return model.model_copy(update={"effects": tuple(each for each in model.effects if each.effect not in names)})


def posterior_of(model: SavedModel) -> Posterior:
    """Return a saved model as an ordinary posterior, with what that leaves out in its notes.

    Raises:
        ModelError: an effect is none that `pbrl_model` simulates.
    """
    others = [name for name in model.names if name not in IN_OUR_TERMS]
    if others:
        raise ModelError(
            f"model of {model.object!r}: expected no effect but {' or '.join(IN_OUR_TERMS)}, which is all that "
            f"pbrl_model simulates, got {', '.join(others)}; {SIMULATES_ALL} simulates every one"
        )
    columns = {name: np.array(each.draws) for name, each in model.parameters.items()}
    notes = list(model.notes)
    for effect in model.effects:
        own = {name: np.array(each.draws) for name, each in effect.parameters.items()}
        if effect.effect == "second_wheel":
            _become_wheel(model, columns, own)
        else:
            columns["mu_ground"] = columns.get("mu_ground", 0.0) + own["slide_mu"]
            notes.append("friction at the feet is taken for one of the whole body: alike while it does not turn")
    if "mu_x" in columns and model.fixed.get("mu_y", 0.0) < 0.0:
        columns["mu_y"] = columns["mu_x"]
    if "mu_x" in columns and "hinge_x" not in columns:
        columns.setdefault("wheel_theta", np.zeros_like(columns["mass"]))
    if model.fixed.get("cone", 0.0) > 0.0 or "second_wheel" in model.names:
        notes.append("the wheel's friction, limited by an ellipse when it was learned, is limited along each axis here")
    foreign = [name for name in columns if name not in KERNEL_COLUMNS]
    if foreign:
        notes.append(f"not used by pbrl_model: {', '.join(foreign)}")
    names = tuple(name for name in KERNEL_COLUMNS if name in columns)
    base = {name: value for name, value in model.fixed.items() if name in KERNEL_COLUMNS and name not in names}
    return Posterior(
        object=model.object,
        model_class=_class_of(names),
        names=names,
        draws=np.stack([columns[name] for name in names], -1)[None],
        base=BodyParameters(**{"mass": model.parameters["mass"].best, **base}),
        notes=tuple(notes),
    )


def _become_wheel(model: SavedModel, columns: dict[str, Array], own: Mapping[str, Array]) -> None:
    """Let a second wheel be the wheel of a body that has none."""
    if "mu_x" in columns:
        raise ModelError(
            f"model of {model.object!r}: expected one wheel, which is all that pbrl_model simulates, got second_wheel "
            f"beside another; {SIMULATES_ALL} simulates both"
        )
    for name in WHEEL_COLUMNS:
        columns[name] = own.get(f"wheel2_{name.removeprefix('wheel_')}", np.zeros_like(columns["mass"]))
    if "wheel2_mu_y" not in own:
        columns["mu_y"] = columns["mu_x"]


def _class_of(names: Sequence[str]) -> str:
    """Return the model class whose names these are."""
    if "hinge_x" in names:
        return "hinge"
    if "mu_ground" in names:
        return "wheel+ground"
    return "wheel" if "mu_x" in names else "free"


def learned(unit: str, draws: Array, best: float, *, positive: bool = False) -> LearnedParameter:
    """Return a parameter from its draws (n,), which give mean and standard deviation."""
    return LearnedParameter(
        unit=unit,
        mean=float(np.mean(draws)),
        sd=float(np.std(draws)),
        best=best,
        positive=positive,
        draws=tuple(map(float, draws)),
    )
