"""What a diagnosis found, as the page draws it: places of what was left out, and the force that the model lacks."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from pbrl_bringup.diagnosis.residuals import RESIDUALS
from pbrl_bringup.errors import BringupError

Array = NDArray[np.float64]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Point = tuple[Finite, Finite]
Interval = tuple[Finite, Finite]

WORLD = "world"
"""Frame of places that stay where they are; those that move with an object are in its frame, others are not drawn."""


class _Part(BaseModel):
    """What is read of a report; the rest of it is for others."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class Place(_Part):
    """Where an effect is: outline or point [m], and the region that holds its middle with 95 %."""

    frame: str
    shape: tuple[Point, ...]
    uncertainty: tuple[Point, ...] = ()


class Named(_Part):
    """One effect."""

    effect: str
    probability: Finite
    where: Place | None = None
    when: tuple[Interval, ...] | None = None


class Unnamed(_Part):
    """What is left out and has no name: when it is surely there [s]."""

    when: tuple[Interval, ...] = ()


class Found(_Part):
    """What was found on one object."""

    mismatch: bool
    unknown: bool = False
    effects: tuple[Named, ...] = ()
    unknown_description: Unnamed | None = None

    @property
    def acting(self) -> tuple[Interval, ...]:
        """Return when what is named acts, or what has no name is surely there [s]."""
        named = tuple(moment for effect in self.effects for moment in effect.when or ())
        return named + (self.unknown_description.when if self.unknown_description else ())


class Report(_Part):
    """report.json of diagnose."""

    objects: dict[str, Found]


class Lacking(_Part):
    """The wrench that a model lacks: times of the recording [s], forces [N], moment [N m], standard deviations."""

    time: tuple[Finite, ...]
    wrench: tuple[tuple[Finite, Finite, Finite], ...]
    sd: tuple[tuple[Finite, Finite, Finite], ...]

    @model_validator(mode="after")
    def _fits(self) -> Lacking:
        if not len(self.time) == len(self.wrench) == len(self.sd) or np.any(np.diff(self.time) <= 0.0):
            raise ValueError("expected as many wrenches as times, and increasing times")
        return self


class Residuals(_Part):
    """residual.json beside it."""

    objects: dict[str, Lacking]


@dataclass(frozen=True)
class Diagnosed:
    """A report, and the residuals beside it, if they are there."""

    report: Mapping[str, Found]
    residuals: Mapping[str, Lacking]


def read_diagnosed(path: Path) -> Diagnosed:
    """Read report.json of diagnose, and residual.json beside it.

    Raises:
        BringupError: a file is missing, cut off or of another form.
    """
    beside = path.parent / RESIDUALS
    return Diagnosed(_read(path, Report).objects, _read(beside, Residuals).objects if beside.is_file() else {})


def regions_of(report: Mapping[str, Found], objects: list[str], origin: float) -> list[dict[str, Any]]:
    """Return places in the form of the page's data.

    Args:
        report: what was found, by object.
        objects: names of the objects on the page; what is told of others is left out.
        origin: time at which the page's clock is zero [s].
    """
    return [
        {
            "effect": f"{named.effect} {100 * named.probability:.0f} %",
            "of": objects.index(name),
            "object": None if named.where.frame == WORLD else objects.index(name),
            "shape": [list(p) for p in named.where.shape],
            "uncertainty": [list(p) for p in named.where.uncertainty],
            "when": [[a - origin, b - origin] for a, b in named.when or ()],
        }
        for name, found in report.items()
        if name in objects
        for named in found.effects
        if named.where is not None and named.where.shape and named.where.frame in (WORLD, name)
    ]


def sentences(report: Mapping[str, Found]) -> list[str]:
    """Return what was found, a sentence an object."""
    told = []
    for name, found in report.items():
        effects = " and ".join(f"{each.effect} ({100 * each.probability:.0f} %)" for each in found.effects)
        if not found.mismatch:
            told.append(f"{name}: model and recording agree")
        elif effects:
            told.append(f"{name}: left out is {effects}")
        else:
            told.append(f"{name}: something is left out, and it is not known what")
    return told


def _read(path: Path, kind: type[Any]) -> Any:
    try:
        return kind.model_validate(json.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise BringupError(f"{path}: expected a report of diagnose, got: {error.strerror}") from error
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in fault["loc"])
        raise BringupError(f"{path}: {where}: expected a report of diagnose: {fault['msg']}") from None
    except (ValueError, RecursionError) as error:
        raise BringupError(f"{path}: expected JSON, got {' '.join(str(error).split())}") from None
