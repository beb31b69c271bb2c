"""Settings of a diagnosis."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pbrl_mismatch.effects.registry import EFFECTS, effect_named
from pbrl_mismatch.errors import MismatchError
from pbrl_model.parameters import nearest

Share = Annotated[float, Field(gt=0.0, lt=1.0)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
KINDS = ("free", "caster", "wheel", "ground", "wheel+ground", "hinge")


class DiagnoseOptions(BaseModel):
    """Settings of `diagnose`.

    Attributes:
        objects: names to diagnose; empty: every object that was held.
        without: effects that the library is to do without.
        baseline: kinds of body that are no mismatch: "free", "caster" (one that is locked), "wheel" (one whose friction
            has two axes), "ground" (friction of the whole body), "wheel+ground", "hinge" (a door); the best of them is
            the baseline.
        models: files of learned or repaired models; an object that one of them is of has it for its baseline.
        level: a p-value below this is a mismatch.
        windows: lengths of the windows of the search, growing [s].
        block: length of what is held out at a time [s].
        every: one block of so many is held out.
        draws: of an effect's prior for each three of its parameters that are not solved for, compared with what is
            lacking along the recorded path; a quarter of them where more moves than the body. As many again are drawn
            about the best.
        candidates: how many of those are climbed from along the path.
        shortlist: effects at most that go on from the path to simulated windows, by evidence.
        keep: from how many points an effect is climbed over windows of each length.
        iterations: of a climb, for each length of window.
        survivors: effects at most that go on to each next length of window, by evidence.
        sensor_floor: size of the wrist sensor's own error in motion [N].
        mass_spread: how well the nominal mass is known, as a standard deviation of its logarithm.
        inertia_spread: the same of the inertia that the footprint suggests.
        delay_spread: delay of poses that is no fault [s].
        grasp_spread: how well the direction of a grasp is known, and with it the wrench's, as a standard deviation
            [rad]; 0: exactly.
        outline_spread: how well each side of the footprint is known, and with it where the middle is, as a standard
            deviation [m]; 0: exactly.
        none_odds: prior odds that nothing was left out against any effect.
        most_together: effects at most that are sought together.
        workers: threads of the search; the bytes do not depend on it.
        seed: of every random draw.

    Raises:
        MismatchError: an option is unknown or out of range.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    objects: tuple[str, ...] = ()
    without: tuple[str, ...] = ()
    baseline: tuple[str, ...] = ("free", "caster", "wheel")
    models: tuple[Path, ...] = ()
    level: Share = 0.05
    windows: tuple[Positive, ...] = (1.0, 2.0)
    block: Positive = 4.0
    every: Annotated[int, Field(ge=2, le=20)] = 4
    draws: Annotated[int, Field(ge=8, le=100_000)] = 120
    candidates: Annotated[int, Field(ge=1, le=1000)] = 4
    shortlist: Annotated[int, Field(ge=1, le=1000)] = 10
    keep: tuple[Annotated[int, Field(ge=1, le=200)], ...] = (2, 1)
    iterations: tuple[Annotated[int, Field(ge=1, le=200)], ...] = (6, 8)
    survivors: tuple[Annotated[int, Field(ge=1, le=1000)], ...] = (4,)
    sensor_floor: Positive = 0.15
    mass_spread: Positive = 0.1
    inertia_spread: Positive = 0.1
    delay_spread: Positive = 0.02
    grasp_spread: NotNegative = 0.0
    outline_spread: NotNegative = 0.0
    none_odds: Positive = 1.0
    most_together: Annotated[int, Field(ge=1, le=3)] = 2
    workers: Annotated[int, Field(ge=1, le=256)] = 2
    seed: Annotated[int, Field(ge=0)] = 0

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(str(part) for part in first["loc"])
            if first["type"] == "extra_forbidden":
                hint = nearest(place, list(type(self).model_fields))
                raise MismatchError(f"diagnose options: unknown option {place!r}{hint}") from None
            raise MismatchError(f"diagnose options: {place}: {first['msg']}, got {first['input']!r}") from None
        for kind in self.baseline:
            if kind not in KINDS:
                raise MismatchError(f"diagnose options: expected baselines among {', '.join(KINDS)}, got {kind!r}")
        if not self.baseline:
            raise MismatchError(f"diagnose options: expected a baseline, one of {', '.join(KINDS)}, got none")
        for name in self.without:
            effect_named(name)
        stages = {len(self.windows), len(self.keep), len(self.iterations)}
        if (
            len(stages) != 1
            or len(self.survivors) != len(self.windows) - 1
            or not self.windows
            or list(self.windows) != sorted(self.windows)
        ):
            raise MismatchError(
                "diagnose options: expected windows that grow, as many of keep and iterations, one survivor fewer, got "
                f"{self.windows}, {self.keep}, {self.iterations}, {self.survivors}"
            )

    @property
    def effects(self) -> tuple[str, ...]:
        """Return the names of the library's effects that are used."""
        return tuple(name for name in EFFECTS if name not in self.without)
