"""Effects of one's own: a law as a plain function, its parameters with units and priors, and it is in the library.

The law is compiled and called from the kernel; it is searched for, weighed, held out and reported as every other effect
is. It knows time and the body's motion now and nothing of the past: what remembers (a load that swings, casters) needs
state, and so a law in `kernels`.
"""

from __future__ import annotations

import ctypes
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import cfunc, njit
from numba.core.errors import NumbaError
from numba.np.numpy_support import carray
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import NDArray

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, Values, Where, disc
from pbrl_mismatch.effects.registry import CONTRACT, EFFECTS, put, take_out
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.kernels.columns import COLUMN, forget_columns, name_columns
from pbrl_mismatch.kernels.own_kernel import LAW, LAWS, TABLE
from pbrl_model.parameters import nearest

Array = NDArray[np.float64]
Triple = tuple[float, float, float]
Law = Callable[[float, Triple, Triple, tuple[float, ...]], Triple]
"""(time [s], pose (x, y, theta) and twist (vx, vy, omega) of the body's frame in world, parameters in their order) to
the wrench (fx, fy, tau) on the body at the origin of its frame, world axes [N, N, N m]."""

_as_tuple: Any = to_fixed_tuple
NOMINAL = Scene(np.zeros(2), np.ones(2), np.zeros(2), np.zeros(2), np.array([0.5, 0.3]), 20.0, 10.0, 0.1, 0.0, 30.0)
"""A scene in which a law is tried before it is taken."""
TRIED, FACTOR, ALIKE = 64, 1.7, 1e-6
"""Draws of the prior for that; factor of the strengths; how exactly the wrench must follow."""


@dataclass(frozen=True)
class Prior:
    """What is believed of one parameter: Gaussian, in its logarithm where it is positive.

    Attributes:
        centre: most likely value [the parameter's unit].
        spread: standard deviation [the parameter's unit], or of the logarithm where it is positive.
        positive: whether it is above zero.
        furthest: from the centre that it can be at all, in the coordinate.
    """

    centre: float
    spread: float
    positive: bool = False
    furthest: float = math.inf


@dataclass(frozen=True)
class OwnEffect:
    """A law that the library does not have.

    Attributes:
        name: lower case with underscores; as reports call it. Parameters are reported as NAME_PARAMETER.
        summary: one sentence.
        law: see `Law`; a plain function of numbers that numba can compile.
        units: unit of each parameter, in the order in which the law takes them.
        priors: what is believed of each parameter, given the scene: middle and reach of the swept floor, middle of the
            footprint's box, centre of mass and half the box's sides, mass, force and speed that occurred, start and
            length in seconds.
        strength: parameters that the wrench is proportional to, all together: zero is no effect.
        equation: the law, as text.
        shows: which motion shows it.
        place: the two parameters that are a place on the floor, if any.
    """

    name: str
    summary: str
    law: Law
    units: Mapping[str, str]
    priors: Callable[[Scene], Mapping[str, Prior]]
    strength: tuple[str, ...]
    equation: str = ""
    shows: str = ""
    place: tuple[str, str] | None = None

    def __post_init__(self) -> None:
        words = [self.name, *self.units]
        if not all(re.fullmatch(r"[a-z][a-z0-9_]*", word) for word in words):
            raise MismatchError(f"own effect: expected names such as fan or width, got {', '.join(map(repr, words))}")
        if not self.strength:
            raise MismatchError(f"{self.name}: expected a strength that the wrench is proportional to, got none")
        for word in (*self.strength, *(self.place or ())):
            if word not in self.units:
                hint = nearest(word, self.units)
                raise MismatchError(f"{self.name}: expected one of {', '.join(self.units)}, got {word!r}{hint}")

    def column(self, parameter: str) -> str:
        """Return the name of a parameter in rows and reports."""
        return f"{self.name}_{parameter}"

    @property
    def switch(self) -> str:
        """Return the column that is 1 where the effect is on."""
        return f"{self.name}_on"


_compiled: dict[str, tuple[OwnEffect, Any]] = {}


def register_effect(own: OwnEffect) -> Effect:
    """Put a law of one's own into the library, beside the others; one of the same name from before is replaced.

    It holds for this process, from the next diagnosis on.

    Returns:
        The effect as the library has it.

    Raises:
        MismatchError: the name is taken, the law cannot be compiled, gives a wrench that is not finite or not
            proportional to its strength, a prior is missing, or there are too many effects of one's own.
    """
    if own.name in CONTRACT:
        raise MismatchError(f"effect: expected a name that the library does not have yet, got {own.name!r}")
    compiled = _compile(own)
    effect = Effect(
        name=own.name,
        summary=own.summary,
        equation=own.equation,
        shows=own.shows,
        parameters=lambda scene: _parameters(own, scene),
        variants=(tuple(own.column(each) for each in own.units),),
        fixed={own.switch: 1.0},
        where=None if own.place is None else lambda values, scene: _where(own, values),
        place=None if own.place is None else (own.column(own.place[0]), own.column(own.place[1])),
        direction="world",
        linear=tuple(own.column(each) for each in own.strength),
    )
    if own.name in _compiled:
        forget_effect(own.name)
    if len(_compiled) == LAWS:
        raise MismatchError(f"effect: expected at most {LAWS} of one's own, got {own.name!r} as one more; forget one")
    name_columns({own.switch: "1", **{own.column(name): unit for name, unit in own.units.items()}})
    try:
        _try(own, compiled, effect)
    except MismatchError:
        forget_columns((own.switch, *effect.variants[0]))
        raise
    _compiled[own.name] = (own, compiled)
    _enter()
    put(effect)
    return effect


def forget_effect(name: str) -> None:
    """Take an effect of one's own out of the library again.

    Raises:
        MismatchError: no such effect was added.
    """
    take_out(name)
    own, _ = _compiled.pop(name)
    _enter()
    forget_columns((own.switch, *(own.column(each) for each in own.units)))


def own_effects() -> tuple[str, ...]:
    """Return the names of the effects that were added."""
    return tuple(name for name in EFFECTS if name not in CONTRACT)


def _enter() -> None:
    """Tell the kernel which laws there are."""
    TABLE[:] = 0
    for k, (own, compiled) in enumerate(_compiled.values()):
        TABLE[1 + 2 * k], TABLE[2 + 2 * k] = compiled.address, COLUMN[own.switch]
    TABLE[0] = len(_compiled)


def _compile(own: OwnEffect) -> Any:
    count = len(own.units)
    try:
        law: Any = njit(own.law, error_model="numpy")

        @cfunc(LAW)
        def call(
            time: float, x: float, y: float, theta: float, vx: float, vy: float, omega: float, told: Any, out: Any
        ) -> None:
            parameters = _as_tuple(carray(told, (count,)), count)
            wrench = carray(out, (3,))
            wrench[0], wrench[1], wrench[2] = law(time, (x, y, theta), (vx, vy, omega), parameters)

    except (NumbaError, TypeError) as error:
        said = [line.strip() for line in str(error).splitlines() if line.strip()]
        raise MismatchError(
            f"{own.name}: expected a law of numbers that numba can compile, law(time, (x, y, theta), (vx, vy, omega), "
            f"({', '.join(own.units)})) to (fx, fy, tau), got: {' '.join(said[-3:])}"
        ) from None
    return call


def _parameters(own: OwnEffect, scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters, in the library's form."""
    priors = own.priors(scene)
    if set(priors) != set(own.units):
        raise MismatchError(f"{own.name}: expected priors of {', '.join(own.units)}, got of {', '.join(priors)}")
    return tuple(
        Parameter(own.column(name), each.centre, each.spread, each.positive, each.furthest)
        for name, each in ((name, priors[name]) for name in own.units)
    )


def _where(own: OwnEffect, values: Values) -> Where | None:
    assert own.place is not None
    return disc("world", values[own.column(own.place[0])], values[own.column(own.place[1])], 0.05)


def _try(own: OwnEffect, compiled: Any, effect: Effect) -> None:
    """Try a law at draws of its prior: it must be finite, and proportional to its strengths.

    Raises:
        MismatchError: it is not.
    """
    rng, parameters = np.random.default_rng(0), effect.parameters(NOMINAL)
    strengths = [k for k, name in enumerate(own.units) if name in own.strength]
    for _ in range(TRIED):
        unit = rng.standard_normal(len(parameters))
        values = np.array([each.mean + each.spread * u for each, u in zip(parameters, unit, strict=True)])
        values = np.array(
            [math.exp(v) if each.positive else v for each, v in zip(parameters, values.tolist(), strict=True)]
        )
        motion = (float(rng.uniform(0.0, 30.0)), *rng.normal(size=3).tolist(), *(0.2 * rng.normal(size=3)).tolist())
        once = _wrench(compiled, motion, values)
        values[strengths] *= FACTOR
        more = _wrench(compiled, motion, values)
        if not (np.isfinite(once).all() and np.isfinite(more).all()):
            raise MismatchError(
                f"{own.name}: expected a finite wrench at every draw of the priors, got {once.tolist()} at "
                f"{dict(zip(own.units, values.tolist(), strict=True))}"
            )
        if np.abs(more - FACTOR * once).max() > ALIKE * (1.0 + np.abs(more).max()):
            raise MismatchError(
                f"{own.name}: expected a wrench proportional to {', '.join(own.strength)}, got {once.tolist()} and, "
                f"{FACTOR} times as strong, {more.tolist()}"
            )


def _wrench(compiled: Any, motion: tuple[float, ...], values: Array) -> Array:
    out = np.full(3, np.nan)
    pointer = ctypes.POINTER(ctypes.c_double)
    compiled.ctypes(*motion, values.ctypes.data_as(pointer), out.ctypes.data_as(pointer))
    return out
