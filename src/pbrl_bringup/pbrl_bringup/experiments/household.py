"""The objects of thesis figure 25, read from YAML, and how transitions of them are gathered.

Transitions come from the pymunk world, learners simulate with the compiled kernel: the truth is of another engine. An
episode starts at rest anywhere in an empty room; the robot then pushes several times in a row with random wrenches,
each held for a while, so that most pushes find the object moving. Nothing is touched.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pbrl_bag.types import BodyGeometry
from pbrl_bag.yaml_text import parse_yaml
from pbrl_bringup.errors import BringupError
from pbrl_bringup.paths import config_file
from pbrl_model.errors import ModelError
from pbrl_model.geometry import check_polygon, mass_properties
from pbrl_model.parameters import BodyParameters
from pbrl_model.rollout import com_to_origin
from pbrl_model.transitions.data import Transitions
from pbrl_model.world import BodySpec, PhysicsWorld

Array = NDArray[np.float64]

DT = 0.01  # [s] step of the world
PUSH_STEPS = 30  # steps that a wrench is held
PUSHES = 4  # in a row, before the object is stopped
ROOM = 2.0  # [m] half side of the square in which episodes start

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Point = tuple[Finite, Finite]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class PushOptions(_Strict):
    """Bounds of the random pushes: force along each axis of the world [N], torque [N m]."""

    force: Positive
    torque: Positive


class ObjectOptions(_Strict):
    """What is known of an object."""

    footprint: Annotated[list[Point], Field(min_length=3)]
    push: PushOptions


class WheelTruth(_Strict):
    """A wheel: place and turn in the object's frame, friction along and across its rolling direction."""

    position: Point
    turn: Finite = 0.0
    along: Share
    across: Share


class Truth(_Strict):
    """What is true of an object."""

    mass: Positive
    wheel: WheelTruth | None = None
    pivot: Point | None = None


class HouseholdFile(_Strict):
    """A whole file."""

    objects: Annotated[dict[str, ObjectOptions], Field(min_length=1)]
    concealed: dict[str, Truth]


@dataclass(frozen=True)
class HouseholdObject:
    """One object.

    Attributes:
        geometry: all that learners are given; no nominal mass.
        truth: wheel and anchor in the object's frame; what has a pivot is pinned to the middle of the room.
        push: bounds of fx, fy [N] and tau [N m], (3,).
    """

    geometry: BodyGeometry
    truth: BodyParameters
    push: Array

    @property
    def radius_of_gyration(self) -> float:
        """Return the lever [m] by which its turns count like motions."""
        return float(np.sqrt(mass_properties(self.geometry.footprint).inertia_per_mass))


def load_household(name: str = "household") -> Mapping[str, HouseholdObject]:
    """Read the objects of a file or of a name in `config/experiments`.

    Raises:
        BringupError: there is no such file, or it says something that cannot be used; one line.
    """
    path = config_file("experiments", name)
    try:
        return parse_household(parse_yaml(path.read_text(encoding="utf-8")))
    except (OSError, UnicodeDecodeError, ValueError, ModelError) as error:
        raise BringupError(f"{path}: {' '.join(str(error).split())}") from None


def parse_household(values: object) -> Mapping[str, HouseholdObject]:
    """Make objects of what a file says.

    Raises:
        ModelError: a key is unknown or a value cannot be used; one line naming it.
    """
    try:
        options = HouseholdFile.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise ModelError(f"{place or 'file'}: {first['msg']}, got {first['input']!r}") from None
    if set(options.objects) != set(options.concealed):
        odd = sorted(set(options.objects) ^ set(options.concealed))
        raise ModelError(f"expected every object in both `objects` and `concealed`, got {', '.join(odd)} in one")
    return {name: _object(name, each, options.concealed[name]) for name, each in options.objects.items()}


def _object(name: str, known: ObjectOptions, told: Truth) -> HouseholdObject:
    geometry = BodyGeometry(name, check_polygon(known.footprint), 0.8, float("nan"), True, np.zeros(3))
    truth = BodyParameters(told.mass)
    if told.wheel is not None:
        (x, y), wheel = told.wheel.position, told.wheel
        truth = replace(truth, wheel_x=x, wheel_y=y, wheel_theta=wheel.turn, mu_x=wheel.along, mu_y=wheel.across)
    if told.pivot is not None:
        truth = replace(truth, anchor_x=told.pivot[0], anchor_y=told.pivot[1], hinge_radius=0.0)
    return HouseholdObject(geometry, truth, np.array([known.push.force, known.push.force, known.push.torque]))


def gather(rng: np.random.Generator, thing: HouseholdObject, n: int) -> Transitions:
    """Push an object n times, without noise.

    Returns:
        n transitions of one body, in the order in which they happened.
    """
    states, ends, wrenches = np.empty((n, 1, 6)), np.empty((n, 1, 6)), np.empty((n, 3))
    world: PhysicsWorld | None = None
    for push in range(n):
        if world is None or push % PUSHES == 0:
            world = _at_rest(rng, thing)
        wrenches[push] = rng.uniform(-thing.push, thing.push)
        states[push, 0] = world.com_state(thing.geometry.name)
        for _ in range(PUSH_STEPS):
            world.apply_wrench(thing.geometry.name, wrenches[push])
            world.step()
        ends[push, 0] = world.com_state(thing.geometry.name)
    return Transitions(states, np.zeros(n, dtype=np.int64), wrenches, np.full(n, DT * PUSH_STEPS), ends)


def _at_rest(rng: np.random.Generator, thing: HouseholdObject) -> PhysicsWorld:
    """Return a world with the object at rest somewhere in the room; a hinged one turned about its hinge."""
    truth = thing.truth
    place = rng.uniform([-ROOM, -ROOM, -np.pi], [ROOM, ROOM, np.pi])
    if truth.has_hinge:
        hinge = np.array([truth.hinge_x, truth.hinge_y, place[2]])
        place = com_to_origin(hinge, np.array([truth.anchor_x, truth.anchor_y]))
    world = PhysicsWorld(DT)
    world.add_body(BodySpec(thing.geometry.name, thing.geometry.footprint, truth, place))
    return world
