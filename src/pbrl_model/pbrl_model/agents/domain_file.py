"""Domains read from YAML such as `config/experiments/shopping_cart.yaml`. Unknown keys are errors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pbrl_bag.yaml_text import parse_yaml
from pbrl_model.agents.domain import ActionSet, Domain, Goal, Physics, Scene, Thing, centred
from pbrl_model.errors import ModelError
from pbrl_model.geometry import check_polygon
from pbrl_model.parameters import BodyParameters, nearest

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Point = tuple[Finite, Finite]
Outline = Annotated[list[Point], Field(min_length=3)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class RoomOptions(_Strict):
    """The floor, and walls that stand on it; corners in world [m]."""

    outline: Outline
    walls: list[Outline] = Field(default_factory=list)


class GoalOptions(_Strict):
    """Where the centre of an object's frame is wanted; without a heading any will do."""

    position: Point
    heading: Finite | None = None
    position_tolerance: Positive = 0.05
    heading_tolerance: Positive = 0.1


class ObjectOptions(_Strict):
    """What is known of an object: footprint in its own frame, pose of that frame in world."""

    footprint: Outline
    start: tuple[Finite, Finite, Finite]
    goal: GoalOptions | None = None


class WheelOptions(_Strict):
    """A wheel: place and turn in the object's frame, friction along and across its rolling direction."""

    position: Point
    turn: Finite = 0.0
    along: Share = 0.0
    across: Share = 1.0


class PhysicsOptions(_Strict):
    """What is true of an object and not told: `pivot` is a point of its frame that is pinned to the floor."""

    mass: Positive
    floor_friction: Share = 0.1
    wheel: WheelOptions | None = None
    pivot: Point | None = None
    restitution: Share = 0.0
    contact_friction: NonNegative = 0.3


class ActionOptions(_Strict):
    """Every combination of the forward forces [N], the sideways forces [N], the torques [N m] and the durations [s]."""

    forward: list[Finite]
    sideways: list[Finite] = [0.0]
    torque: list[Finite]
    duration: list[Positive]


class DomainOptions(_Strict):
    """A whole file."""

    name: str
    room: RoomOptions
    objects: Annotated[dict[str, ObjectOptions], Field(min_length=1)]
    actions: ActionOptions | None = None
    noise: NonNegative = 0.0
    steps: Annotated[int, Field(ge=1)] = 50
    jitter: tuple[NonNegative, NonNegative, NonNegative] = (0.0, 0.0, 0.0)
    concealed: dict[str, PhysicsOptions]


_MODELS = (
    DomainOptions,
    RoomOptions,
    GoalOptions,
    ObjectOptions,
    WheelOptions,
    PhysicsOptions,
    ActionOptions,
)
_KEYS = sorted({key for model in _MODELS for key in model.model_fields})


def load_domain(path: Path) -> Domain:
    """Read a domain.

    Raises:
        ModelError: the file cannot be read, a key is unknown, or a value cannot be used; one line.
    """
    try:
        values = parse_yaml(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"{path}: expected readable YAML, got {' '.join(str(error).split())}") from None
    except ValueError as error:
        raise ModelError(f"{path}: {error}") from None
    return parse_domain(values, str(path))


def parse_domain(values: object, where: str = "domain") -> Domain:
    """Check what a file says and build the domain.

    Raises:
        ModelError: a key is unknown or a value cannot be used; one line naming the key.
    """
    try:
        options = DomainOptions.model_validate(values)
    except ValidationError as error:
        raise ModelError(f"{where}: {_one_line(error)}") from None
    for name in (*options.concealed, *options.objects):
        if name not in options.objects or name not in options.concealed:
            missing = "concealed" if name in options.objects else "objects"
            known = options.concealed if missing == "concealed" else options.objects
            raise ModelError(
                f"{where}: expected every object in both `objects` and `concealed`, got {name!r} not in "
                f"`{missing}`{nearest(name, known)}"
            )
    try:
        return _domain(options)
    except ModelError as error:
        raise ModelError(f"{where}: {error}") from None


def _domain(options: DomainOptions) -> Domain:
    things, truth = [], {}
    for name, each in options.objects.items():
        footprint, com = _centred(name, each)
        things.append(Thing(name, footprint, _of_com(each.start, com), _goal(each.goal, com)))
        truth[name] = _physics(options.concealed[name], com, things[-1])
    walls = tuple(check_polygon(wall) for wall in options.room.walls)
    scene = Scene(options.name, check_polygon(options.room.outline), walls, tuple(things))
    return Domain(scene, truth, _actions(options.actions), options.noise, options.steps, options.jitter)


def _centred(name: str, each: ObjectOptions) -> tuple[np.ndarray, np.ndarray]:
    try:
        return centred(each.footprint)
    except ModelError as error:
        raise ModelError(f"objects.{name}: {error}") from None


def _of_com(pose: tuple[float, float, float], com: np.ndarray) -> np.ndarray:
    """Return the pose of the centre of mass of a body whose frame is at `pose`."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([pose[0] + c * com[0] - s * com[1], pose[1] + s * com[0] + c * com[1], pose[2]])


def _goal(options: GoalOptions | None, com: np.ndarray) -> Goal | None:
    if options is None:
        return None
    if options.heading is None:  # the place of the centre of mass: without a heading there is no frame to place
        pose = np.array([*options.position, np.nan])
    else:
        pose = _of_com((*options.position, options.heading), com)
    return Goal(pose, options.position_tolerance, options.heading_tolerance)


def _physics(options: PhysicsOptions, com: np.ndarray, thing: Thing) -> Physics:
    values = {"mass": options.mass, "mu_ground": options.floor_friction}
    if options.wheel is not None:
        wheel = options.wheel
        values |= {
            "wheel_x": wheel.position[0] - com[0],
            "wheel_y": wheel.position[1] - com[1],
            "wheel_theta": wheel.turn,
            "mu_x": wheel.along,
            "mu_y": wheel.across,
        }
    if options.pivot is not None:
        anchor = np.array(options.pivot) - com
        hinge = _of_com((thing.start[0], thing.start[1], thing.start[2]), anchor)
        values |= {"hinge_x": hinge[0], "hinge_y": hinge[1], "hinge_radius": 0.0}
        values |= {"anchor_x": anchor[0], "anchor_y": anchor[1]}
    parameters = BodyParameters(**{name: float(value) for name, value in values.items()})
    return Physics(parameters, options.restitution, options.contact_friction)


def _actions(options: ActionOptions | None) -> ActionSet | None:
    if options is None:
        return None
    levels = (options.forward, options.sideways, options.torque, options.duration)
    grid = np.array(np.meshgrid(*levels, indexing="ij")).reshape(4, -1).T
    pushing = grid[np.abs(grid[:, :3]).max(axis=1) > 0.0]
    return ActionSet(pushing[:, :3], pushing[:, 3])


def _one_line(error: ValidationError) -> str:
    fault = min(error.errors(), key=lambda each: each["type"] != "extra_forbidden")
    place = ".".join(str(part) for part in fault["loc"])
    if fault["type"] == "extra_forbidden":
        return f"unknown key {place}{nearest(str(fault['loc'][-1]), _KEYS)}"
    return f"{place or 'file'}: {fault['msg']}, got {fault['input']!r}"
