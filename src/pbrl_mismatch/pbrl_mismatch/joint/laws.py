"""What may oppose a pull at a door: force laws along the path, by the names of the library.

A law is a shape over the cells of a pull, times a strength [N or the like]. Strengths enter the force linearly and are
solved for; places and widths do not and are searched. One that is `positive` opposes the motion or draws the door shut.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.joint.pull import Pull

Array = NDArray[np.float64]

DEGREE = math.pi / 180.0
EDGE = 0.5 * DEGREE
"""How sharp the border of a stiff stretch is [rad]."""
STARTS = 24
SENSOR_BIAS = 0.5
"""Of a wrist sensor, as one component's standard deviation [N]."""


@dataclass(frozen=True)
class Unknown:
    """A place or a width, with a Gaussian prior in its coordinate.

    Attributes:
        name: as reported.
        unit: as reported.
        centre: most likely value.
        spread: standard deviation, or that of the logarithm where `positive`.
        positive: the coordinate is the logarithm.
    """

    name: str
    unit: str
    centre: float
    spread: float
    positive: bool = False

    @property
    def mean(self) -> float:
        """Return the prior's mean in the coordinate."""
        return math.log(self.centre) if self.positive else self.centre

    def value(self, coordinate: float) -> float:
        """Return the value of a coordinate."""
        return math.exp(min(max(coordinate, -30.0), 30.0)) if self.positive else coordinate


@dataclass(frozen=True)
class Strength:
    """What a law's shape is multiplied by: a Gaussian of mean zero, cut at zero where it is `positive`."""

    name: str
    unit: str
    spread: float
    positive: bool = True


Shape = Callable[[Pull, Array], Array]
"""Of a pull with n cells and the law's unknowns (values, not coordinates): (n, k), a column for each strength."""


@dataclass(frozen=True)
class Law:
    """One form of an effect.

    Attributes:
        effect: name in the library.
        form: which form of it, for people.
        equation: the force along the path, as text.
        unknowns: places and widths, scaled by a pull.
        strengths: what the shape is multiplied by, scaled by a pull.
        shape: (n, k) columns.
        starts: (m, unknowns) values from which to search.
        place: (from, to) [rad] of where it acts most, of its values, or None where it is everywhere.
        multiplies: the shape is a factor (n, 1) of all other forces.
    """

    effect: str
    form: str
    equation: str
    unknowns: Callable[[Pull], tuple[Unknown, ...]]
    strengths: Callable[[Pull], tuple[Strength, ...]]
    shape: Shape
    starts: Callable[[Pull], Array]
    place: Callable[[Mapping[str, float]], tuple[float, float]] | None = None
    multiplies: bool = False


def _nothing(pull: Pull) -> tuple[Unknown, ...]:
    return ()


def _newtons(name: str, *, signed: bool = False) -> Callable[[Pull], tuple[Strength, ...]]:
    return lambda pull: (Strength(name, "N", pull.strength, positive=not signed),)


def _angle(pull: Pull, name: str) -> Unknown:
    return Unknown(name, "rad", float(pull.angle.min()) + 0.4 * pull.reach, 0.4 * pull.reach)


def _width(name: str, degrees: float = 4.0) -> Unknown:
    return Unknown(name, "rad", degrees * DEGREE, 0.9, positive=True)


def _grid(pull: Pull, *widths: tuple[float, ...]) -> Array:
    """Return places along the way with every combination of widths [degrees]."""
    places = np.linspace(pull.angle.min(), pull.angle.max(), STARTS)
    axes = np.meshgrid(places, *(np.array(each) * DEGREE for each in widths), indexing="ij")
    return np.column_stack([axis.ravel() for axis in axes])


def _alone(pull: Pull) -> Array:
    return np.empty((1, 0))


def _bump(pull: Pull, value: Array) -> Array:
    return np.exp(-0.5 * ((pull.angle - value[0]) / value[1]) ** 2)[:, None]


def _lopsided(pull: Pull, value: Array) -> Array:
    away = pull.angle - value[0]
    return np.exp(-0.5 * (away / np.where(away < 0.0, value[1], value[2])) ** 2)[:, None]


def _fading(pull: Pull, value: Array) -> Array:
    away = pull.angle - value[0]
    return np.where(away < 0.0, np.exp(-0.5 * (away / value[1]) ** 2), 1.0 / (1.0 + (away / value[2]) ** 2))[:, None]


def _breakaway(pull: Pull, value: Array) -> Array:
    return (pull.sense * np.exp(-pull.travelled / value[0]))[:, None]


def _spring(pull: Pull, value: Array) -> Array:
    return (pull.hinge.radius * np.maximum(pull.angle - value[0], 0.0))[:, None]


def _along_path(pull: Pull, value: Array) -> Array:
    turn = pull.hinge.zero + pull.hinge.sense * pull.angle
    return pull.hinge.sense * np.column_stack([-np.sin(turn), np.cos(turn)])


def _against_path(pull: Pull, value: Array) -> Array:
    return -_along_path(pull, value)


def _stretch(pull: Pull, value: Array) -> Array:
    rise, fall = (_smooth_step((pull.angle - edge) / EDGE) for edge in (value[0], value[0] + value[1]))
    return (pull.sense * (rise - fall))[:, None]


def _taken_up(pull: Pull, value: Array) -> Array:
    return _smooth_step((pull.travelled - value[0]) / value[1])[:, None]


def _smooth_step(x: Array) -> Array:
    return 0.5 + 0.5 * np.tanh(0.5 * x)


def _around(value: Mapping[str, float]) -> tuple[float, float]:
    rise = value.get("detent_rise", value["detent_width"])
    return value["detent_angle"] - rise, value["detent_angle"] + value["detent_width"]


def _per_metre(pull: Pull) -> tuple[Strength, ...]:
    return (Strength("tether_stiffness", "N/m", 2.0 * pull.strength / (pull.hinge.radius * pull.reach)),)


def _components(name: str, spread: float | None = None) -> Callable[[Pull], tuple[Strength, ...]]:
    """Return strengths in world axes, of a known spread [N] or of one that the pull suggests."""
    return lambda pull: tuple(
        Strength(f"{name}_{axis}", "N", 0.5 * pull.strength if spread is None else spread, positive=False)
        for axis in "xy"
    )


def _damping(pull: Pull) -> tuple[Strength, ...]:
    usual = float(np.sqrt(np.mean(pull.speed**2)))
    return (Strength("drag", "N s/m", pull.strength / max(usual, 1e-3)),)


def _detent(form: str, equation: str, shape: Shape, *, two_sided: bool = True) -> Law:
    sides, widths = (
        (("detent_rise", "detent_width"), ((0.7, 3.0), (0.7, 3.0, 15.0)))
        if two_sided
        else (("detent_width",), ((0.7, 2.0, 6.0, 15.0),))
    )
    return Law(
        "detent",
        form,
        equation,
        lambda pull: (_angle(pull, "detent_angle"), *(_width(side) for side in sides)),
        _newtons("detent_force"),
        shape,
        lambda pull: _grid(pull, *widths),
        _around,
    )


FRICTION = Law(
    "", "constant friction", "F = F_c sign(v)", _nothing, _newtons("friction"), lambda p, v: p.sense[:, None], _alone
)
"""What the baseline has."""

LAWS: tuple[Law, ...] = (
    _detent("bump", "F = F_0 exp(-(a - a_0)^2 / 2 w^2)", _bump, two_sided=False),
    _detent("lopsided", "F = F_0 exp(-(a - a_0)^2 / 2 w^2), w being the rise before a_0", _lopsided),
    _detent("fading", "F = F_0 / (1 + ((a - a_0) / w)^2), before a_0 as lopsided", _fading),
    Law(
        "breakaway_friction",
        "start of the motion",
        "F = F_b exp(-way / w)",
        lambda pull: (_width("breakaway_way"),),
        _newtons("breakaway_force"),
        _breakaway,
        lambda pull: np.array([[0.5], [2.0], [8.0]]) * DEGREE,
    ),
    Law("viscous_drag", "along the path", "F = c v", _nothing, _damping, lambda p, v: p.speed[:, None], _alone),
    Law(
        "tether",
        "spring",
        "F = k R (a - a_s) beyond a_s",
        lambda pull: (_angle(pull, "tether_angle"),),
        _per_metre,
        _spring,
        _grid,
        lambda value: (value["tether_angle"], math.inf),
    ),
    Law("floor_slope", "weight", "F = -t(a) . f", _nothing, _components("slope_force"), _against_path, _alone),
    Law("wrench_bias", "bias", "F = t(a) . b", _nothing, _components("wrench_bias", SENSOR_BIAS), _along_path, _alone),
    Law(
        "floor_patch",
        "stiff stretch",
        "F = F_p sign(v) from a_p to a_p + w",
        lambda pull: (_angle(pull, "patch_angle"), Unknown("patch_width", "rad", 15.0 * DEGREE, 0.6, True)),
        _newtons("patch_friction"),
        _stretch,
        lambda pull: _grid(pull, (6.0, 15.0, 35.0)),
        lambda value: (value["patch_angle"], value["patch_angle"] + value["patch_width"]),
    ),
    Law(
        "grasp_compliance",
        "play",
        "all forces times 1 / (1 + exp(-(way - p) / w)): nothing is felt before the play is taken up",
        lambda pull: (
            Unknown("grasp_play", "rad", 1.5 * DEGREE, 1.0, positive=True),
            Unknown("grasp_take_up", "rad", 0.3 * DEGREE, 0.8, positive=True),
        ),
        lambda pull: (),
        _taken_up,
        lambda pull: np.array([[p, w] for p in (0.7, 1.5, 2.5, 4.0) for w in (0.1, 0.4)]) * DEGREE,
        multiplies=True,
    ),
)
"""What is tried. Several forms of one effect share its prior."""

ALIKE = {"floor_slope": ("external_force",)}
"""Other names for the same force along a path."""


def laws_of(without: tuple[str, ...] = ()) -> tuple[Law, ...]:
    """Return the library less what it is to do without.

    Raises:
        MismatchError: nothing is left.
    """
    kept = tuple(law for law in LAWS if law.effect not in without)
    if not kept:
        raise MismatchError("joint: expected at least one effect that a door may have, got --without for all of them")
    return kept
