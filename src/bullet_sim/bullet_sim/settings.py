"""Settings as frozen pydantic models, and their faults as one line naming file, key and nearest known key."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError
from shapely.geometry import Polygon
from shapely.validation import explain_validity

from bullet_sim.errors import SimError, nearest
from bullet_sim.yaml_text import parse_yaml


class Settings(BaseModel):
    """Base of every settings model: unknown keys, NaN and infinities are refused, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, validate_default=True)


Model = TypeVar("Model", bound=Settings)

MOST = 1e4  # metres, kilograms, newtons: nothing in a room has more of them, and Bullet does not survive it
Positive = Annotated[float, Field(gt=0, le=MOST)]
NonNegative = Annotated[float, Field(ge=0, le=MOST)]
Stiffness = Annotated[float, Field(ge=1, le=1e5)]  # N/m; beyond that springs between bodies and room shake
Fraction = Annotated[float, Field(ge=0, lt=1)]
Coordinate = Annotated[float, Field(ge=-MOST, le=MOST)]
Vector2 = tuple[Coordinate, Coordinate]
Vector3 = tuple[Coordinate, Coordinate, Coordinate]


def _counter_clockwise(points: tuple[Vector2, ...]) -> tuple[Vector2, ...]:
    if len(points) < 3:
        raise ValueError(f"expected a polygon of at least 3 corners, got {len(points)}")
    polygon = Polygon(points)
    if not polygon.is_valid:
        raise ValueError(f"expected a polygon that does not cross itself, got one with {explain_validity(polygon)}")
    if polygon.area < 1e-4:
        raise ValueError(f"expected a polygon of at least 1 cm2, got {polygon.area:.2g} m2")
    return points if polygon.exterior.is_ccw else points[::-1]


Outline = Annotated[tuple[Vector2, ...], AfterValidator(_counter_clockwise)]
"""Corners (k, 2) [m] of a simple polygon, brought into counter-clockwise order."""


def read_settings(path: Path, model: type[Model]) -> Model:
    """Read a YAML file into a settings model.

    Args:
        path: the file.
        model: what it has to hold.

    Raises:
        SimError: no such file, not YAML, or settings the model refuses; one line.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SimError(f"{path}: expected a readable YAML file, got {type(error).__name__}") from error
    try:
        data = parse_yaml(text)
    except ValueError as error:
        raise SimError(f"{path}: {error}") from error
    return parse_settings(data, model, str(path))


def parse_settings(data: Any, model: type[Model], origin: str) -> Model:
    """Check plain data against a settings model.

    Args:
        data: what YAML gives.
        model: what it has to hold.
        origin: where the data is from, for messages.

    Raises:
        SimError: one line for the first fault, with its key path and the nearest known key.
    """
    if not isinstance(data, Mapping):
        raise SimError(f"{origin}: expected keys {', '.join(model.model_fields)}, got {type(data).__name__}")
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise SimError(f"{origin}: {_explain(error, model)}") from error


_TELLING = {"extra_forbidden": 0, "string_type": 2, "model_type": 2}
"""Faults in the order of what they tell: a misspelt key explains a missing one, an unchosen alternative nothing."""


def _explain(error: ValidationError, model: type[Settings]) -> str:
    """Put the first fault of a validation into one line."""
    faults = error.errors(include_url=False)
    fault = min(faults, key=lambda each: _TELLING.get(each["type"], 1))
    steps = _written_steps(model, fault["loc"])
    place = ".".join(str(step) for step, _ in steps)
    more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
    if fault["type"] == "extra_forbidden":
        holder = steps[-1][1]
        known = holder.model_fields if isinstance(holder, type) and issubclass(holder, BaseModel) else ()
        return f"{place}: unknown key; {nearest(str(steps[-1][0]), known)}{more}"
    if fault["type"] == "missing":
        return f"{place}: expected a value, got none; add it{more}"
    if fault["type"] == "union_tag_invalid":
        expected = [word.strip(" '") for word in fault["ctx"]["expected_tags"].split(",")]
        return f"{place}.kind: unknown kind {fault['ctx']['tag']!r}; {nearest(fault['ctx']['tag'], expected)}{more}"
    what = fault["msg"].removeprefix("Value error, ").replace("Input should be", "expected")
    got = fault.get("input")
    shown = "" if fault["type"] == "value_error" else f", got {_short(got)}"
    return f"{place}{': ' if place else ''}{' '.join(what.split())}{shown}{more}"


def _short(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def _written_steps(model: type[Settings], location: tuple[int | str, ...]) -> list[tuple[int | str, Any]]:
    """Follow a fault's location as (step, type that holds the step), without the steps pydantic adds for unions."""
    steps: list[tuple[int | str, Any]] = []
    holder: Any = model
    for step in location:
        choices = [_plain(choice) for choice in _alternatives(holder)]
        tagged = [choice for choice in choices if _tag(choice) == step]
        if len(choices) > 1 and tagged:
            holder = tagged[0]
            continue
        if len(choices) > 1:
            named = [choice for choice in choices if getattr(choice, "__name__", "") == step]
            if named or not any(_child(choice, step) for choice in choices):
                holder = named[0] if named else holder
                continue
            choices = [choice for choice in choices if _child(choice, step)]
        holder = choices[0]
        steps.append((step, holder))
        holder = _child(holder, step)
    return steps


def _alternatives(annotation: Any) -> tuple[Any, ...]:
    plain = _plain(annotation)
    return get_args(plain) if get_origin(plain) in (Union, UnionType) else (plain,)


def _plain(annotation: Any) -> Any:
    return _plain(get_args(annotation)[0]) if get_origin(annotation) is Annotated else annotation


def _tag(choice: Any) -> str | None:
    if isinstance(choice, type) and issubclass(choice, BaseModel) and "kind" in choice.model_fields:
        kinds = get_args(choice.model_fields["kind"].annotation)
        return str(kinds[0]) if kinds else None
    return None


def _child(holder: Any, step: int | str) -> Any:
    """Give the type found one step below `holder`, None where that is unknown."""
    if isinstance(holder, type) and issubclass(holder, BaseModel):
        field = holder.model_fields.get(str(step))
        return field.annotation if field else None
    arguments = [argument for argument in get_args(holder) if argument is not Ellipsis]
    return arguments[-1] if arguments else None
