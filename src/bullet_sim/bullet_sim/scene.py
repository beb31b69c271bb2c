"""A scene: room, furniture, robot start, goal, sensors, and what is true but not told.

Everything is in `world` (x, y, theta) or in a body's own frame: x forward, y left, origin where the body's
tag is glued. Files are `config/scenes/*.yaml`; a fault in one is a `SimError` naming file, key and remedy.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from pydantic import Field, model_validator
from shapely.geometry import Point, Polygon

from bullet_sim.camera_settings import CameraSettings
from bullet_sim.catalogue import Body
from bullet_sim.concealed.checks import check_concealed
from bullet_sim.concealed.options import Concealed
from bullet_sim.errors import SimError, nearest
from bullet_sim.faults import Faults
from bullet_sim.model_file import concealed_of
from bullet_sim.placing import placed_footprint
from bullet_sim.settings import (
    Fraction,
    NonNegative,
    Outline,
    Positive,
    Settings,
    Vector3,
    parse_settings,
    read_settings,
)

TagSource = Literal["noise", "rendered"]

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,99}")


class Room(Settings):
    """The floor and its walls.

    Attributes:
        outline: corners [m] of the free floor in `world`.
        wall_height: [m].
        floor_friction: factor on every sliding friction against this floor; 1 is the hard office floor.
    """

    outline: Outline
    wall_height: Positive = 1.0
    floor_friction: Annotated[float, Field(gt=0, le=2)] = 1.0


class Posture(Settings):
    """Joint angles [rad] of Krang's upper body; the right arm mirrors the left where it is not given."""

    waist: float
    torso: float = 0.0
    left: tuple[float, float, float, float, float, float, float]
    right: tuple[float, float, float, float, float, float, float] | None = None


class RobotStart(Settings):
    """Where the robot's `base` stands at the start, and its posture: a name the robot knows, or joint angles."""

    pose: Vector3 = (0.0, 0.0, 0.0)
    posture: str | Posture = "square_table_push"


class Goal(Settings):
    """Where an object is wanted: pose (x, y, theta) and the slack around it [m], [rad]."""

    object: str
    pose: Vector3
    position_tolerance: Positive = 0.05
    yaw_tolerance: Positive = 0.10


class TagSettings(Settings):
    """Overhead cameras that read tags; defaults of the noise are an estimate for one ceiling camera.

    Attributes:
        source: `noise`: poses with the errors below; `rendered`: pictures of `sensors.cameras`, in which tags are still
            to be found. Then there is nothing to say here but rate and latency.
        rate: [Hz].
        sigma_xy: white noise of x and y [m].
        sigma_z: white noise of the height [m].
        sigma_yaw: white noise of the heading [rad].
        sigma_tilt: white noise of roll and pitch [rad]: a flat tag seen from above shows them worse than its yaw.
        latency: from capture to publication [s].
        dropout: probability that one reading of one tag fails.
        bias: amplitude [m] of the smooth error over the floor (calibration, lens, height).
        bias_length: distance [m] over which that error changes.
    """

    source: TagSource = "noise"
    rate: Annotated[float, Field(ge=0.1, le=200)] = 15.0
    sigma_xy: NonNegative = 0.003
    sigma_z: NonNegative = 0.006
    sigma_yaw: NonNegative = float(np.deg2rad(0.5))
    sigma_tilt: NonNegative = float(np.deg2rad(1.0))
    latency: Annotated[float, Field(ge=0, le=2)] = 0.075
    dropout: Fraction = 0.02
    bias: NonNegative = 0.008
    bias_length: Positive = 1.0

    @model_validator(mode="after")
    def _says_what_counts(self) -> Self:
        more = sorted(self.model_fields_set - {"source", "rate", "latency"})
        if self.source == "rendered" and more:
            raise ValueError(
                f"expected no {more[0]} where tags are rendered: errors come from the pictures; leave it out"
            )
        return self


class WristSettings(Settings):
    """Wrist force-torque sensor, in its own axes with y along the gripper; defaults: Mini45 SI-290-10 on Krang.

    Attributes:
        rate: [Hz]; at most one reading a physics step, which simulators see to.
        force_noise: white noise [N].
        torque_noise: white noise [N m].
        force_bias: bound [N] of the constant offset of each run.
        torque_bias: bound [N m] of the constant offset of each run.
        force_resolution: quantisation step [N].
        torque_resolution: quantisation step [N m].
        force_range: where the sensor saturates [N].
        torque_range: where the sensor saturates [N m].
    """

    rate: Annotated[float, Field(ge=0.1, le=1000)] = 100.0
    force_noise: tuple[NonNegative, NonNegative, NonNegative] = (0.06, 0.11, 0.06)
    torque_noise: tuple[NonNegative, NonNegative, NonNegative] = (0.006, 0.009, 0.006)
    force_bias: NonNegative = 1.5
    torque_bias: NonNegative = 0.05
    force_resolution: NonNegative = 1 / 8
    torque_resolution: NonNegative = 1 / 376
    force_range: tuple[Positive, Positive, Positive] = (290.0, 580.0, 290.0)
    torque_range: tuple[Positive, Positive, Positive] = (10.0, 10.0, 10.0)


class Sensors(Settings):
    """What the robot senses with."""

    tags: TagSettings = TagSettings()
    wrist_ft: WristSettings = WristSettings()
    cameras: CameraSettings = CameraSettings()


class Scene(Settings):
    """One scene, known and concealed parts together.

    Attributes:
        keep_out: corners of each place that nothing of robot or load may enter [m], `world`; no thing, and in nobody's
            way in Bullet.
        faults: what goes wrong with messages and clocks on purpose, see `bullet_sim.faults`.
        models: file of a learned model by the body that is to behave so; read by `load_scene` into `concealed`. A path
            that is not absolute is taken from the scene's file.
    """

    name: str = "scene"
    room: Room
    robot: RobotStart = RobotStart()
    bodies: dict[str, Body] = Field(default_factory=dict)
    goal: Goal | None = None
    sensors: Sensors = Sensors()
    concealed: Concealed = Concealed()
    keep_out: tuple[Outline, ...] = ()
    faults: Faults = Faults()
    models: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _names_meet(self) -> Self:
        for name in self.bodies:
            if not NAME.fullmatch(name):
                raise ValueError(
                    f"bodies: expected a name of letters, digits and underscores that starts with a letter (it becomes "
                    f"part of topics), got {name[:60]!r}"
                )
        if self.goal is not None:
            self._known_body(self.goal.object, "goal.object")
        check_concealed(self.concealed, self.bodies)
        return self

    @model_validator(mode="after")
    def _stands_free(self) -> Self:
        floor = Polygon(self.room.outline).buffer(1e-6)
        if not floor.contains(Point(self.robot.pose[:2])):
            raise ValueError(f"robot.pose: expected a start in the room, got {list(self.robot.pose)}")
        for number, corners in enumerate(self.keep_out):
            if f"keep_out_{number}" in self.bodies:
                raise ValueError(f"bodies.keep_out_{number}: expected another name: keep_out.{number} is told by it")
            if Polygon(corners).distance(Point(self.robot.pose[:2])) <= 0.0:
                raise ValueError(f"keep_out.{number}: expected a place where the robot does not start")
        placed: dict[str, Polygon] = {}
        for name, body in self.bodies.items():
            shape = placed_footprint(body)
            if not floor.contains(shape):
                raise ValueError(f"bodies.{name}: expected a place inside the room, got pose {list(body.pose)}")
            for other, place in placed.items():
                spans = (body.levels, self.bodies[other].levels)
                meet = max(low for low, _ in spans) < min(high for _, high in spans)
                if meet and shape.intersection(place).area > 1e-6:
                    raise ValueError(f"bodies.{name}: expected a place of its own, got one that overlaps {other}")
            placed[name] = shape
        return self

    def _known_body(self, name: str, place: str) -> None:
        if name not in self.bodies:
            raise ValueError(f"{place}: no body {name!r} in this scene; {nearest(name, self.bodies)}")


def load_scene(path: str | Path) -> Scene:
    """Read a scene.

    Args:
        path: a YAML file, or the bare name of a scene that comes with the workspace.

    Raises:
        SimError: no such scene, or a fault in it; one line naming file, key and nearest known key.
    """
    file = Path(path)
    if file.suffix not in (".yaml", ".yml") and not file.exists():
        file = _shipped(str(path))
    scene = read_settings(file, Scene)
    for body, model in scene.models.items():
        scene = with_model(scene, file.parent / model, body)
    return scene if "name" in scene.model_fields_set else scene.model_copy(update={"name": file.stem})


def with_model(scene: Scene, path: Path, body: str | None = None) -> Scene:
    """Return a scene in which a body behaves as a learned model says.

    Args:
        scene: where it stands.
        path: file of the model.
        body: its name in the scene; None: as the model has it.

    Raises:
        SimError: the file cannot be used, such a thing cannot be in this scene, or it is concealed there already.
    """
    told = scene.concealed.model_dump(exclude_unset=True)
    for key, value in concealed_of(path, scene.bodies, body).items():
        if isinstance(value, list):
            told[key] = [*told.get(key, ()), *value]
        elif key == "floor_slope" and told.get(key):
            raise SimError(f"{path}: concealed.{key}: expected a scene that does not say it, got one that does")
        elif key == "floor_slope":
            told[key] = value
        elif set(value) & set(told.get(key, {})):
            name = next(iter(set(value) & set(told[key])))
            raise SimError(f"{path}: concealed.{key}.{name}: expected a scene that does not say it, got one that does")
        else:
            told[key] = {**told.get(key, {}), **value}
    return parse_settings({**scene.model_dump(exclude_unset=True), "concealed": told}, Scene, str(path))


def with_tags(scene: Scene, source: TagSource) -> Scene:
    """Return a scene whose tags come from `source`, at the rate and with the latency that it says already."""
    if source == scene.sensors.tags.source:
        return scene
    said = scene.sensors.tags.model_dump(include={"rate", "latency"}, exclude_unset=True)
    sensors = scene.sensors.model_copy(update={"tags": TagSettings(source=source, **said)})
    return scene.model_copy(update={"sensors": sensors})


def scene_folder() -> Path:
    """Give the folder of the scenes that come with the workspace; raise SimError where it is not built."""
    try:
        return Path(get_package_share_directory("pbrl_config")) / "scenes"
    except PackageNotFoundError as error:
        raise SimError(
            "scenes: expected the package pbrl_config, found none; build and source the workspace"
        ) from error


def _shipped(name: str) -> Path:
    known = {file.stem: file for file in scene_folder().glob("*.yaml")}
    if name not in known:
        raise SimError(f"scene {name!r}: expected a file or the name of a scene; {nearest(name, known)}")
    return known[name]
