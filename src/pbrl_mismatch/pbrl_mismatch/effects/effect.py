"""What an effect is: its law in words, the columns it switches on, what is believed of them, where it would show."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.kernels.columns import COLUMN, UNIT

Array = NDArray[np.float64]
Values = Mapping[str, float]
Site = Literal["world", "body"]


@dataclass(frozen=True)
class Parameter:
    """One column that is learned, with a Gaussian prior in its coordinate.

    Attributes:
        column: its name in `kernels.columns`.
        centre: most likely value [the column's unit].
        spread: standard deviation [the column's unit], or of the logarithm where `positive`.
        positive: the coordinate is the logarithm.
        furthest: from the mean in the coordinate that it can be at all.
    """

    column: str
    centre: float
    spread: float
    positive: bool = False
    furthest: float = math.inf

    def __post_init__(self) -> None:
        if self.column not in COLUMN:
            raise MismatchError(f"parameter: expected a column of the kernel, got {self.column!r}")
        if not (self.spread > 0.0 and math.isfinite(self.centre) and (self.centre > 0.0 or not self.positive)):
            raise MismatchError(
                f"{self.column}: expected a finite centre and a spread above zero, got {self.centre} and {self.spread}"
            )

    @property
    def unit(self) -> str:
        """Return its unit."""
        return UNIT[self.column]

    @property
    def mean(self) -> float:
        """Return the prior's mean in the coordinate."""
        return math.log(self.centre) if self.positive else self.centre


def plain(column: str, centre: float, spread: float) -> Parameter:
    """Return a parameter that may be of either sign."""
    return Parameter(column, centre, spread)


def on_body(column: str, centre: float, half: float, share: float) -> Parameter:
    """Return a coordinate of a point of the body: within half a side of the footprint, the spread a share of that."""
    return Parameter(column, centre, share * half, furthest=half)


def positive(column: str, centre: float, spread: float) -> Parameter:
    """Return a parameter that is above zero; `spread` is that of its logarithm."""
    return Parameter(column, centre, spread, positive=True)


@dataclass(frozen=True)
class Scene:
    """What priors are scaled by.

    Attributes:
        middle: (2,) of the floor that the body swept [m].
        reach: (2,) half the sides of the swept floor's bounding box [m].
        centroid: (2,) middle of the footprint's bounding box in the body's frame [m].
        com: (2,) nominal centre of mass in the body's frame [m].
        half: (2,) half the sides of the footprint's bounding box [m].
        mass: of the body as it was told, or else as the baseline has it [kg].
        force: root mean square of the force felt [N].
        speed: root mean square speed while it moved [m/s].
        start: of the recording [s].
        seconds: until its end [s].
    """

    middle: Array
    reach: Array
    centroid: Array
    com: Array
    half: Array
    mass: float
    force: float
    speed: float
    start: float
    seconds: float

    @property
    def size(self) -> float:
        """Return half the diagonal of the footprint [m]."""
        return float(np.hypot(*self.half))


@dataclass(frozen=True)
class Where:
    """A place that an effect has.

    Attributes:
        frame: "world", in which the object's poses are told, or "body", the object's own; a report calls that by the
            object's name.
        shape: (k, 2) outline [m].
    """

    frame: Site
    shape: Array


@dataclass(frozen=True)
class Effect:
    """One thing that may have been left out of a model.

    Attributes:
        name: part of the contract.
        summary: one sentence.
        equation: the law, as text.
        shows: which motion shows it, and what it is confused with.
        parameters: what it adds to the parameter row, given the scene.
        variants: sub-models, each the columns that are free in it; the others of `fixed` or off.
        fixed: columns that are given a value while the effect is on.
        fixed_in: others that are given one in some variants alone, by the variant's number.
        where: the place it has, from its parameters, or None.
        place: columns of the middle of that place.
        direction: the frame in which its force keeps its direction, or what it follows.
        angles: columns that live on a circle.
        linear: columns that the effect's wrench is proportional to, all together.
        touches: columns x, y and radius of a disc that touches the footprint, where the effect is a contact.
        pulls: columns x and y of a place in the world, then of the point of the body that is drawn to it.
        cord: column of the length below which nothing pulls.
        rhythm: columns of a frequency and of its phase.
        region: columns of a rectangle on the floor in which feet are held: x, y, half of length and width, and angle.
        pins: columns x and y of a place about which the body can only turn.
        moments: columns of the times at which it comes or goes.
        lasts: columns of the moment from which it is there, whether it is felt or not, and of what is 1 where it was
            there until then.
        remembers: whether more moves than the body, so that its past matters.
        second: whether a baseline may have one such thing already, and stands between the two.
        sticks: whether it is dry friction, which a body at rest does not show the strength of.
        exact: whether its law is what happens, and no idealisation of it as laws of friction and contacts are: what it
            leaves beyond noise, another thing does.
        limit: name of the effect that it is the same as where what it adds to that is nothing.
    """

    name: str
    summary: str
    equation: str
    shows: str
    parameters: Callable[[Scene], tuple[Parameter, ...]]
    variants: tuple[tuple[str, ...], ...]
    fixed: Mapping[str, float] = field(default_factory=dict)
    fixed_in: Mapping[int, Mapping[str, float]] = field(default_factory=dict)
    where: Callable[[Values, Scene], Where | None] | None = None
    place: tuple[str, str] | None = None
    direction: str | None = None
    angles: tuple[str, ...] = ()
    linear: tuple[str, ...] = ()
    touches: tuple[str, str, str] | None = None
    pulls: tuple[str, ...] = ()
    cord: str | None = None
    rhythm: tuple[str, str] | None = None
    region: tuple[str, str, str, str, str] | None = None
    pins: tuple[str, str] | None = None
    moments: tuple[str, ...] = ()
    lasts: tuple[str, str] | None = None
    remembers: bool = False
    second: bool = False
    sticks: bool = False
    exact: bool = False
    limit: str | None = None

    @property
    def of_history(self) -> bool:
        """Tell whether what it does follows from all that was before: of contacts and what moves besides the body."""
        return self.remembers or self.touches is not None

    def chosen(self, scene: Scene, variant: int) -> tuple[Parameter, ...]:
        """Return the parameters that are free in one variant."""
        known = {parameter.column: parameter for parameter in self.parameters(scene)}
        return tuple(known[column] for column in self.variants[variant])

    def given(self, variant: int) -> Mapping[str, float]:
        """Return the columns that have a fixed value in one variant."""
        return {**self.fixed, **self.fixed_in.get(variant, {})}


def disc(frame: Site, x: float, y: float, radius: float) -> Where:
    """Return a disc as an outline of sixteen corners."""
    angle = np.arange(16) * (2.0 * np.pi / 16)
    return Where(frame, np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], -1))


def rectangle(frame: Site, x: float, y: float, half_length: float, half_width: float, theta: float) -> Where:
    """Return a turned rectangle as an outline."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [half_length, half_width]
    c, s = np.cos(theta), np.sin(theta)
    return Where(frame, corners @ np.array([[c, s], [-s, c]]) + [x, y])
