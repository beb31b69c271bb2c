"""A scene for the PR2: that of any robot, and with it a map, what is not in the map, people, and places to go to.

Files are `config/offices/*.yaml`; a fault in one is a `SimError` naming file, key and remedy.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Self, get_args

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from pydantic import Field, model_validator

from bullet_sim.catalogue import Body
from bullet_sim.concealed.options import GRIPPERS
from bullet_sim.errors import SimError, nearest
from bullet_sim.scene import NAME, RobotStart, Scene
from bullet_sim.settings import NonNegative, Positive, Settings, Vector2, Vector3, read_settings
from pr2_cart_sim.postures import DEFAULT_POSTURE
from pr2_cart_sim.sensor_settings import BoardSource, Pr2Sensors

WALL_HEIGHT = 2.4


class Pr2Start(RobotStart):
    """Where the robot's `base` stands at the start, and its posture.

    Attributes:
        torso: height of the torso's lift [m]; None: that of the posture.
        holds: name of a body whose edge both grippers hold from the start; None: none.
    """

    posture: str = DEFAULT_POSTURE
    torso: Annotated[float, Field(ge=0, le=0.33)] | None = None
    holds: str | None = None


class Person(Settings):
    """Somebody who walks.

    Attributes:
        route: places (n, 2) [m] in `world`, walked to and fro; one alone: somebody who stands.
        speed: [m/s].
        pause: mean time spent at each end of the route [s].
        radius: of the body [m]; ellipses are this wide and `depth` deep.
        depth: half the body's depth [m].
        height: [m].
        legs: whether the legs are apart and swing, as a laser low over the floor sees them.
    """

    route: tuple[Vector2, ...] = Field(min_length=1)
    speed: Annotated[float, Field(gt=0, le=3)] = 1.1
    pause: NonNegative = 3.0
    radius: Annotated[float, Field(ge=0.1, le=0.6)] = 0.25
    depth: Annotated[float, Field(ge=0.05, le=0.6)] = 0.16
    height: Annotated[float, Field(ge=0.5, le=2.4)] = 1.72
    legs: bool = True


class Manners(Settings):
    """How people behave towards the robot.

    Attributes:
        social: whether they stop before they walk into it or its cart; otherwise they walk until they touch it.
        margin: how far away they stop [m].
        patience: how long they wait there before they turn back [s].
        step_in_rate: how often one who is near steps in front of the robot while it moves [1/min].
        step_in_within: how near [m] somebody has to be for that.
        step_in_ahead: where they step, ahead of what leads, robot or cart [m].
        stand: how long they stand there [s].
    """

    social: bool = True
    margin: Positive = 0.40
    patience: Positive = 6.0
    step_in_rate: NonNegative = 0.0
    step_in_within: Positive = 4.0
    step_in_ahead: Positive = 1.2
    stand: NonNegative = 4.0


class OfficeScene(Scene):
    """One scene for the PR2, known and concealed parts together.

    Attributes:
        map: the map's YAML file, as ROS's map server has it; a path that is not absolute is taken from the scene's
            file. None: nothing but the room's outline.
        wall_height: of what the map has occupied [m].
        clutter: what stands around and is neither told nor in the map.
        people: by name.
        goals: places (x, y, theta) for the robot's `base` to go to, by name.
    """

    robot: Pr2Start = Pr2Start()
    sensors: Pr2Sensors = Pr2Sensors()
    map: str | None = None
    wall_height: Positive = WALL_HEIGHT
    clutter: dict[str, Body] = Field(default_factory=dict)
    people: dict[str, Person] = Field(default_factory=dict)
    manners: Manners = Manners()
    goals: dict[str, Vector3] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _parts_meet(self) -> Self:
        for name in (*self.clutter, *self.people, *self.goals):
            if not NAME.fullmatch(name):
                raise ValueError(
                    f"expected a name of letters, digits and underscores that starts with a letter, got {name[:60]!r}"
                )
        if self.models:
            raise ValueError("models: expected none in an office, got some; only Krang's scenes have learned ones")
        for effect in ("pose_bias", "time_offset"):
            for name in getattr(self.concealed, effect):
                if effect == "pose_bias" or name not in GRIPPERS:
                    raise ValueError(
                        f"concealed.{effect}.{name}: expected no fault of a tag: there are none in an office"
                    )
        twice = [name for name in self.clutter if name in self.bodies]
        if twice:
            raise ValueError(f"clutter.{twice[0]}: expected a name of its own, bodies has it too")
        if self.robot.holds is not None:
            self._known_body(self.robot.holds, "robot.holds")
        if self.clutter:
            self.furnished()
        return self

    def furnished(self) -> Scene:
        """Give the scene as it is built: with the clutter among its bodies."""
        parts = {name: getattr(self, name) for name in Scene.model_fields}
        return Scene(**(parts | {"bodies": {**self.bodies, **self.clutter}, "models": {}}))


def load_office(path: str | Path) -> OfficeScene:
    """Read a scene.

    Args:
        path: a YAML file, or the bare name of an office that comes with the workspace.

    Raises:
        SimError: no such scene, or a fault in it; one line naming file, key and nearest known key.
    """
    file = Path(path)
    if file.suffix not in (".yaml", ".yml") and not file.exists():
        file = _shipped(str(path))
    scene = read_settings(file, OfficeScene)
    changes: dict[str, object] = {}
    if scene.map is not None:
        changes["map"] = str(file.resolve().parent / scene.map)
    if "name" not in scene.model_fields_set:
        changes["name"] = file.stem
    return scene.model_copy(update=changes)


def with_board(scene: OfficeScene, source: str) -> OfficeScene:
    """Return a scene whose checkerboard is seen by `source`: `noise`, `rendered` or `off`.

    Raises:
        SimError: another word.
    """
    known = get_args(BoardSource)
    if source not in known:
        raise SimError(f"checkerboard: expected {', '.join(known)}, got {source!r}; {nearest(source, known)}")
    board = scene.sensors.checkerboard.model_copy(update={"source": source})
    return scene.model_copy(update={"sensors": scene.sensors.model_copy(update={"checkerboard": board})})


def office_folder() -> Path:
    """Give the folder of the offices that come with the workspace; raise SimError where it is not built."""
    try:
        return Path(get_package_share_directory("pbrl_config")) / "offices"
    except PackageNotFoundError as error:
        raise SimError(
            "offices: expected the package pbrl_config, found none; build and source the workspace"
        ) from error


def _shipped(name: str) -> Path:
    known = {file.stem: file for file in office_folder().glob("*.yaml")}
    if name not in known:
        raise SimError(f"office {name!r}: expected a file or the name of an office; {nearest(name, known)}")
    return known[name]
