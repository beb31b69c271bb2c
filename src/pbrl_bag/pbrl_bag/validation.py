"""Turns pydantic's report on a file of settings into one line that a user can act on."""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from typing import get_args

from pydantic import BaseModel, ValidationError


def explain(error: ValidationError, model: type[BaseModel]) -> str:
    """Return the first problem of `error` as one line: key, what was expected, what was got.

    Args:
        error: what pydantic raised.
        model: the class that was validated; an unknown key is answered with its nearest known one.
    """
    problems = error.errors(include_url=False)
    first = next((p for p in problems if p["type"] == "extra_forbidden"), problems[0])
    where = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        text = _unknown_key(model, first["loc"], where)
    elif first["type"] == "missing":
        text = f"{where}: expected this key, got nothing; add it"
    else:
        message = first["msg"].removeprefix("Value error, ")
        got = "" if first["type"] == "value_error" else f", got {str(first['input'])[:60]!r}"
        text = f"{where}: {message}{got}" if where else f"{message}{got}"
    others = len(problems) - 1
    return text + (f" (and {others} more)" if others else "")


def nearest(name: str, known: list[str]) -> str:
    """Return a sentence that names the known name nearest to `name`, or all of them."""
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"did you mean {close[0]!r}?" if close else f"known: {', '.join(sorted(known))}"


def _unknown_key(model: type[BaseModel], location: tuple[int | str, ...], where: str) -> str:
    """Say that a key is unknown, and which one it may have been meant to be."""
    known = sorted({key for found in _models_at(model, location[:-1]) for key in found.model_fields})
    return f"unknown key {where!r}: {nearest(str(location[-1]), known)}"


def _models_at(model: type[BaseModel], location: tuple[int | str, ...]) -> Iterator[type[BaseModel]]:
    """Yield the model classes that lie at a location inside `model`."""
    if not location:
        yield model
        return
    field = model.model_fields.get(str(location[0]))
    if field is None:
        return
    for inner in _models_in(field.annotation):
        direct = inner in (field.annotation, *get_args(field.annotation)) and not _is_container(field.annotation)
        yield from _models_at(inner, location[1:] if direct else location[2:])


def _is_container(annotation: object) -> bool:
    """Tell whether an annotation is a list, tuple or dictionary."""
    return getattr(annotation, "__origin__", None) in (list, tuple, dict)


def _models_in(annotation: object) -> Iterator[type[BaseModel]]:
    """Yield the model classes named in an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _models_in(argument)
