"""Mapping files: which topic or column of a foreign recording plays which role.

A mapping is YAML. It names the source of each role (`object_poses`, `gripper_poses`, `wrenches`
or `joint_efforts`, `grasps`), the frames and units they come in, and the geometry of the bodies; it serves bags (by
`topic`) and CSV files (by column) alike. See config/mappings/ for commented examples.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from pbrl_bag.errors import BagError
from pbrl_bag.outline import fault_of_name, fault_of_outline
from pbrl_bag.validation import explain
from pbrl_bag.yaml_text import parse_yaml

Column = str | float  # a column's name, or a constant
Vector3 = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class _Strict(BaseModel):
    """Immutable; an unknown key is an error; NaN is no number."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class FramePose(_Strict):
    """Pose of one frame in another."""

    position: Vector3 = (0.0, 0.0, 0.0)  # [m]
    quaternion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)  # x y z w

    @model_validator(mode="after")
    def _unit(self) -> FramePose:
        norm = sum(value * value for value in self.quaternion) ** 0.5
        if abs(norm - 1.0) > 1e-3:
            raise ValueError(f"quaternion: expected length 1, got {norm:.4g}; order is x y z w")
        return self


class TimeColumn(_Strict):
    """The column of a CSV file that holds time."""

    column: str
    unit: Literal["s", "ms", "us", "ns"] = "s"


class PoseSource(_Strict):
    """Where the pose of a body or gripper comes from: a topic, or columns.

    Topics may carry PoseStamped, PoseWithCovarianceStamped, TransformStamped, Odometry, TFMessage
    (then `child_frame` says which transform), or PoseArray (then `index` says which pose).
    """

    topic: str | None = None
    child_frame: str | None = None
    index: int | None = Field(default=None, ge=0)
    position: tuple[Column, Column, Column] | None = None
    orientation: tuple[Column, Column, Column, Column] | None = None  # quaternion x y z w
    yaw: Column | None = None
    unit: Literal["m", "cm", "mm"] = "m"
    angle_unit: Literal["rad", "deg"] = "rad"
    frame: str | None = None  # the frame that the values are given in; default: `world`
    offset: FramePose = FramePose()  # pose of the body's (gripper's) frame in the frame that is observed
    ignore_orientation: bool = False  # the topic's orientation means nothing
    clock_offset: float = 0.0  # [s] added to its times

    @model_validator(mode="after")
    def _one_source(self) -> PoseSource:
        if (self.topic is None) == (self.position is None):
            raise ValueError("expected either `topic` or `position` (three columns), got both or neither")
        if self.orientation is not None and self.yaw is not None:
            raise ValueError("expected `orientation` or `yaw`, got both")
        if self.topic is not None and (self.orientation is not None or self.yaw is not None):
            raise ValueError("`orientation` and `yaw` name columns: they do not go with `topic`")
        if self.index is not None and self.topic is None:
            raise ValueError("`index` says which pose of a PoseArray: it goes with `topic`")
        return self


class WrenchSource(_Strict):
    """Where the wrench of a gripper comes from: a WrenchStamped topic, or columns.

    `sign` multiplies force and torque: -1 turns what is felt by the sensor into what acts on the
    object. `exerted_on` then says what the result is: "gripper" (raw: weight, bias and world on the
    sensor) or "object" (compensated: gripper on object). `axes`: "sensor", or a frame of the world.
    """

    topic: str | None = None
    force: tuple[Column, Column, Column] | None = None
    torque: tuple[Column, Column, Column] | None = None
    unit: Literal["N", "lbf", "kgf"] = "N"
    torque_unit: Literal["N m", "lbf in"] = "N m"
    sign: Literal[-1, 1] = 1
    exerted_on: Literal["gripper", "object"]
    axes: str = "sensor"
    ignore_torque: bool = False  # the topic's torque means nothing
    clock_offset: float = 0.0  # [s] added to its times

    @model_validator(mode="after")
    def _one_source(self) -> WrenchSource:
        if (self.topic is None) == (self.force is None):
            raise ValueError("expected either `topic` or `force` (three columns), got both or neither")
        if self.topic is not None and self.torque is not None:
            raise ValueError("`torque` names columns: it does not go with `topic`")
        return self


class EffortSource(_Strict):
    """What a gripper feels by the efforts of its arm's joints, on a topic of sensor_msgs/JointState.

    Poorer than a wrist sensor: friction in the gears is in it, and where the arm is stretched nothing is felt along it.
    `tip` is the link whose pose `gripper_poses` tells; the wrench is at its origin, in its axes, and raw as a
    sensor's: what it shows before a grip closes is taken out.
    """

    topic: str
    joints: tuple[str, ...] = Field(min_length=1)  # whose efforts are measured, on the way from the root to the tip
    tip: str
    urdf: Path | None = None  # file; relative to the mapping's folder
    description: str | None = None  # in its place: the topic of the bag that has it, std_msgs/String
    efforts: Literal["total", "external"] = "total"  # external: the driver has taken gravity and motion out
    sign: Literal[-1, 1] = 1  # total: torque of the motor on the joint; external: of the world on it
    noise: Positive | tuple[Positive, ...] | None = None  # [N m] how far off an effort is; default: as judged
    gravity: Vector3 = (0.0, 0.0, -9.81)  # [m/s^2] in the axes of the URDF's root
    inertia: bool = False  # also take out what the arm's own motion takes
    ignore_torque: bool = False  # the hand exerts a force at a point and no torque
    clock_offset: float = 0.0  # [s] added to its times

    @model_validator(mode="after")
    def _one_description(self) -> EffortSource:
        if (self.urdf is None) == (self.description is None):
            raise ValueError("expected either `urdf` (a file) or `description` (a topic), got both or neither")
        if len(set(self.joints)) != len(self.joints):
            raise ValueError(f"joints: expected each once, got {', '.join(self.joints)}")
        if isinstance(self.noise, tuple) and len(self.noise) != len(self.joints):
            raise ValueError(f"noise: expected one number, or {len(self.joints)} as joints, got {len(self.noise)}")
        return self

    def urdf_text(self) -> str:
        """Return the text of the file `urdf`.

        Raises:
            BagError: it cannot be read.
        """
        assert self.urdf is not None, "the bag has it"
        try:
            return self.urdf.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise BagError(f"{self.urdf}: expected the URDF that a mapping names, got: {error}") from error


class GraspSource(_Strict):
    """A grasp that is known though no topic tells of it.

    `start` and `end` are seconds after the first sample of the recording; left out: from the first
    sample on, to the last.
    """

    gripper: Literal["left", "right"]
    object: str
    contact: tuple[float, float] = (0.0, 0.0)  # [m] in the object's frame
    start: float | None = None
    end: float | None = None

    @model_validator(mode="after")
    def _order(self) -> GraspSource:
        if self.start is not None and self.end is not None and self.end <= self.start:
            raise ValueError(f"expected end > start, got start {self.start} and end {self.end}")
        return self


class BodySource(_Strict):
    """The known geometry of a body.

    `pose` left out: where it was first observed; then `theta` gives the heading if none is observed.
    """

    footprint: tuple[tuple[float, float], ...] = Field(min_length=3)  # [m] counter-clockwise, body's frame
    height: Positive  # [m]
    nominal_mass: Positive | None = None  # [kg]
    movable: bool = True
    pose: Vector3 | None = None  # x [m], y [m], theta [rad] in world
    theta: float | None = None  # [rad]
    casters: tuple[tuple[float, float], ...] = ()  # [m]

    @model_validator(mode="after")
    def _is_an_outline(self) -> BodySource:
        if fault := fault_of_outline(self.footprint):
            raise ValueError(f"footprint: {fault}")
        return self


class Mapping(_Strict):
    """How to read a foreign recording. Keys of the dictionaries: body names, "left" or "right"."""

    description: str = ""
    contract: bool = False  # also take the topics of the contract; what is named here comes first
    world: str = "world"  # the frame id that stands for `world`
    frames: dict[str, FramePose] = {}  # fixed frames: their pose in world
    time: TimeColumn | None = None  # CSV only
    delimiter: str = Field(default=",", min_length=1, max_length=1)
    bodies: dict[str, BodySource] = {}
    room: tuple[tuple[float, float], ...] = ()
    object_poses: dict[str, PoseSource] = {}
    gripper_poses: dict[Literal["left", "right"], PoseSource] = {}
    wrenches: dict[Literal["left", "right"], WrenchSource] = {}
    joint_efforts: dict[Literal["left", "right"], EffortSource] = {}  # where there is no wrench; bags only
    grasps: tuple[GraspSource, ...] = ()
    grasp_topic: str | None = None  # a topic of pbrl_msgs/Grasps
    scene_topic: str | None = None  # a topic of pbrl_msgs/Scene
    max_speed: Positive = 5.0  # [m/s] beyond it a pose stream jumps
    max_turn_rate: Positive = 12.0  # [rad/s]

    @model_validator(mode="before")
    @classmethod
    def _without_empty_sections(cls, data: Any) -> Any:
        """Take a key with nothing but comments under it as one that is not there."""
        return {key: value for key, value in data.items() if value is not None} if isinstance(data, dict) else data

    @model_validator(mode="after")
    def _names_agree(self) -> Mapping:
        for name in (*self.bodies, *self.object_poses):
            if fault := fault_of_name(name):
                raise ValueError(f"bodies: {fault}")
        known = {self.world, *self.frames}
        for role, source in (*self.object_poses.items(), *self.gripper_poses.items()):
            if source.frame is not None and source.frame not in known:
                raise ValueError(f"{role}: frame: expected one of {sorted(known)}, got {source.frame!r}")
        for role, wrench in self.wrenches.items():
            if wrench.axes not in {"sensor", *known}:
                raise ValueError(f"{role}: axes: expected one of {sorted({'sensor', *known})}, got {wrench.axes!r}")
        for role in set(self.wrenches) & set(self.joint_efforts):
            raise ValueError(f"{role}: expected `wrenches` or `joint_efforts`, got both; a sensor is the better one")
        if self.scene_topic is None and not self.contract:
            for name in {*self.object_poses, *(grasp.object for grasp in self.grasps)} - set(self.bodies):
                raise ValueError(f"body {name!r} has no geometry: describe it under `bodies`")
        return self


def load_mapping(path: Path | str) -> Mapping:
    """Read a mapping file.

    Raises:
        BagError: the file is missing, is not YAML, or a key or value is not understood; the message
            names the file, the key, and the nearest known one.
    """
    path = Path(path)
    try:
        data = parse_yaml(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BagError(f"{path}: expected a mapping file, {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise BagError(f"{path}: expected YAML, got: {error}") from error
    except ValueError as error:
        raise BagError(f"{path}: {error}") from error
    if not isinstance(data, dict):
        raise BagError(f"{path}: expected a mapping of keys to values, got {type(data).__name__}; see config/mappings/")
    try:
        mapping = Mapping.model_validate(data)
    except ValidationError as error:
        raise BagError(f"{path}: {explain(error, Mapping)}") from error
    beside = {
        side: each if each.urdf is None else each.model_copy(update={"urdf": path.parent / each.urdf})
        for side, each in mapping.joint_efforts.items()
    }
    return mapping.model_copy(update={"joint_efforts": beside})
