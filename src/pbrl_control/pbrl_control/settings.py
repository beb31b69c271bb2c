"""Settings of the body controller, read from `config/params/body_controller.yaml`."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from pbrl_bag.yaml_text import parse_yaml
from pbrl_control.errors import ControlError

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Arm = tuple[Finite, Finite, Finite, Finite, Finite, Finite, Finite]
Planar = tuple[Finite, Finite, Finite]
Corners = Annotated[tuple[tuple[Finite, Finite], ...], Field(min_length=3)]


def _ascending(pair: tuple[float, float]) -> tuple[float, float]:
    if not pair[0] < pair[1]:
        raise ValueError(f"expected a lower and a higher number, got {pair[0]} and {pair[1]}")
    return pair


Range = Annotated[tuple[Finite, Finite], AfterValidator(_ascending)]


class Section(BaseModel):
    """A part of a settings file: frozen, and no key that is not known."""

    model_config = ConfigDict(extra="forbid", frozen=True)


Model = TypeVar("Model", bound=Section)


class BaseSettings(Section):
    """Limits of the differential base, and how it keeps what the arms carry in the middle of their workspace."""

    speed: Positive = 0.35  # [m/s]
    forward_speed: Positive = 0.17  # [m/s] forwards: from more it would tip, were it to be at rest within 0.3 s
    yaw_rate: Positive = 0.5  # [rad/s]
    acceleration: Positive = 0.5  # [m/s^2]
    yaw_acceleration: Positive = 1.0  # [rad/s^2]
    steering: Literal["predictive", "waypoint", "none"] = "predictive"
    horizon: Annotated[float, Field(ge=0.5, le=20.0)] = 6.0  # [s] that predictive steering looks ahead
    apart_forward: Positive = 0.08  # [m] away from home that counts as much as one of the next two
    apart_sideways: Positive = 0.08  # [m]
    apart_yaw: Positive = 0.5  # [rad]
    turn_limit: Positive = 0.6  # [rad] yaw of a gripper from its home that arms can still do
    effort: Positive = 10.0  # of going as fast as the base can beyond what carries the object, in the same coin
    last_weight: Positive = 4.0  # of the end of the horizon
    waypoint_far: Positive = 0.05  # [m] eps_ang of thesis (45)
    waypoint_aside: Positive = 0.01  # [rad] eps_lin of thesis (46)
    waypoint_gain: NotNegative = 0.5  # [1/s]
    waypoint_turn: NotNegative = 0.5  # [1/s]


class ArmSettings(Section):
    """How gripper twists become joint velocities."""

    velocity_fraction: Annotated[float, Field(gt=0.0, le=1.0)] = 0.95  # of the description's velocity limits
    acceleration: Positive = 1.7  # [rad/s^2]
    joint_margin: NotNegative = 0.03  # [rad] kept from the stops
    level_gain: NotNegative = 3.0  # [1/s] roll and pitch feedback
    height_gain: NotNegative = 2.0  # [1/s] height feedback while an object is held
    posture_gain: NotNegative = 0.5  # [1/s] null-space draw to the nominal posture
    posture_speed: NotNegative = 0.1  # [rad/s] at most, for that draw
    stow_speed: Positive = 0.3  # [rad/s] of an arm that has nothing to do, on its way to its stowed posture


class ProgramSettings(Section):
    """Weights and borders of the whole-body program. Weights are against 1 for a gripper's speed squared."""

    share: Positive = 2e-3  # of doing all of the asked twist now, against a speed error as long as the twist itself
    base_forward: Positive = 4e-4  # of the base's speed beside the steering's
    base_yaw: Positive = 2e-4  # [m^2/rad^2] of its yaw rate
    joints: Positive = 2e-7  # [m^2/rad^2] of rates of an arm that works, beside the draw to its posture
    idle_joints: Positive = 1e-2  # [m^2/rad^2] of one that does not
    angular_length: Positive = 0.5  # [m] at which an angular speed of a gripper counts as a linear one
    border_rate: Positive = 2.0  # [1/s] speed towards a border of the workspace is at most this times the way left
    reach_x: Range = (0.45, 0.95)  # [m] workspace of the plates in `base`
    reach_y: Range = (-0.15, 0.45)  # [m] of the left ones; right mirrored
    grip_force: Positive = 150.0  # [N] horizontal, against which a gripper does not go on
    grip_slow: Positive = 10.0  # [1/s] at twice that force its speed against it goes down this fast, and comes back
    grip_resume: Positive = 1.0  # [1/s] this fast; quick ones would ring with rubber and delays


class PseudoInverseSettings(Section):
    """The thesis's way (equations 42 to 44), beside the program."""

    bias: Annotated[float, Field(ge=0.0, le=1.0)] = 1.0  # c_n of (44): 1 lets the base do what it can
    singular_threshold: Positive = 0.05  # smallest singular value of the Jacobian below which damping sets in
    damping: Positive = 0.08


class ComplianceAxis(Section):
    """One axis of a grip: `v = F / damping + slow part - centring * x`, x what it gave way so far.

    Without the slow part and with nothing forgotten this is the admittance of Krang's own push program, of stiffness
    centring * damping. The slow part is a leaky integral of the force: for steady forces the grip gives way as if its
    damping were smaller by the factor 1 + leak / yielding.
    """

    damping: Positive  # [N s/m] or [N m s/rad]
    centring: NotNegative = 0.0  # [1/s]
    forget: Positive | None = None  # [s] after which what it gave way is where it belongs; none: never
    yielding: Positive | None = None  # [s]; none: no slow part
    leak: Positive = 1.0  # [s]
    dead_band: NotNegative = 0.0  # [N] or [N m]


class ComplianceSettings(Section):
    """Force compliance of a grip, in the gripper's planar axes: stiff along, nearly free across and about.

    Where it is known what moving the object takes, it is yielded to what was not expected, and firmly in each axis:
    else furniture that resists would not move across the grip at all.
    """

    longitudinal: ComplianceAxis = ComplianceAxis(damping=2500.0, centring=0.3, forget=2.0, dead_band=2.0)
    lateral: ComplianceAxis = ComplianceAxis(
        damping=2500.0, centring=0.05, forget=2.0, yielding=0.3, leak=3.0, dead_band=2.0
    )
    yaw: ComplianceAxis = ComplianceAxis(damping=6.0, centring=0.05, forget=2.0, yielding=0.5, leak=2.0, dead_band=0.3)
    firm_lateral: ComplianceAxis = ComplianceAxis(damping=2500.0, centring=0.3, forget=2.0, dead_band=2.0)
    firm_yaw: ComplianceAxis = ComplianceAxis(damping=30.0, centring=0.3, forget=2.0, dead_band=0.3)
    vertical: ComplianceAxis = ComplianceAxis(damping=4000.0, dead_band=4.0)
    bias_time: Positive = 0.3  # [s] over which a sensor's bias is averaged before a grip closes
    speed: Positive = 0.2  # [m/s] most that compliance adds
    yaw_rate: Positive = 0.5  # [rad/s] most that compliance adds


class WatchSettings(Section):
    """When a stream that control needs cannot be trusted any more."""

    lost: Positive = 1.0  # [s] without a tag of what is held: it may be hidden for a moment
    link: Positive = 0.14  # [s] without any tag at all, joint positions or a wrench: nobody sends any more
    frozen: Positive = 1.0  # [s] of motion with the same sample again and again


class FenceSettings(Section):
    """Places that neither the robot nor what it holds may enter.

    Attributes:
        keep_out: corners of each [m], `world`; /scene tells others, under names that begin with `keep_out_`.
        clear: nearest that anything is sent to them [m].
        graze: into those that /scene tells, which are wider than they are, one may come as far as this [m].
        ahead: time for which a command is looked ahead: until what it leads to could have been braked [s].
    """

    keep_out: tuple[Corners, ...] = ()
    clear: Positive = 0.02
    graze: NotNegative = 0.04
    ahead: Positive = 0.3


class ControllerSettings(Section):
    """Everything the body controller can be told."""

    timeout: Positive = 0.07  # [s] a command older than this is no command
    method: Literal["program", "pseudo-inverse"] = "program"
    program: ProgramSettings = ProgramSettings()
    pseudo_inverse: PseudoInverseSettings = PseudoInverseSettings()
    base: BaseSettings = BaseSettings()
    arm: ArmSettings = ArmSettings()
    compliance: ComplianceSettings = ComplianceSettings()
    watch: WatchSettings = WatchSettings()
    fence: FenceSettings = FenceSettings()
    home: Planar = (0.74, 0.16, 0.0)  # x, y, yaw of the left gripper in `base` [m, rad]; right: mirrored
    nominal: Arm = (0.94, -1.13, -0.04, -1.65, 0.0, 1.20, 0.05)  # [rad] left; right: negated
    stowed: Arm = (1.9, -1.13, 0.0, -2.0, 0.12, 1.49, -0.06)  # [rad] left; right: negated
    stow_idle_arm: bool = True


def load_section(path: Path, model: type[Model], what: str) -> Model:
    """Read a YAML file into a section; raise ControlError with one line for whatever is wrong with it."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ControlError(f"{what} {path}: expected a readable YAML file, got {error}") from error
    return parse_section(text, model, f"{what} {path}")


def parse_section(text: str, model: type[Model], where: str) -> Model:
    """Read YAML text into a section; raise ControlError that starts with `where`."""
    try:
        content = parse_yaml(text)
    except ValueError as error:
        raise ControlError(f"{where}: {error}") from error
    if not isinstance(content, dict):
        raise ControlError(f"{where}: expected keys and values, got {type(content).__name__}")
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise ControlError(f"{where}: {_first_complaint(error, model)}") from error


def _first_complaint(error: ValidationError, model: type[Section]) -> str:
    """Return the first thing pydantic objects to, in one line, with the nearest known key."""
    first = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"])
    if first["type"] != "extra_forbidden":
        return f"{key}: {' '.join(str(first['msg']).split())}, got {str(first['input'])[:60]!r}"
    known = _keys(model)
    near = difflib.get_close_matches(str(first["loc"][-1]), known, n=1)
    hint = f"did you mean {near[0]!r}?" if near else f"known keys are {', '.join(sorted(known))}"
    return f"{key}: expected a known key, got {str(first['loc'][-1])[:60]!r}; {hint}"


def _keys(model: type[BaseModel]) -> set[str]:
    """Return every key of a section and of the sections in it."""
    found = set(model.model_fields)
    for info in model.model_fields.values():
        for part in (info.annotation, *getattr(info.annotation, "__args__", ())):
            if isinstance(part, type) and issubclass(part, BaseModel):
                found |= _keys(part)
    return found
