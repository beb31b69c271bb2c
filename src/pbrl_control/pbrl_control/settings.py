"""Settings of the body controller, read from `config/params/body_controller.yaml`."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Annotated, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pbrl_bag.yaml_text import parse_yaml
from pbrl_control.errors import ControlError

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Arm = tuple[Finite, Finite, Finite, Finite, Finite, Finite, Finite]
Planar = tuple[Finite, Finite, Finite]


class Section(BaseModel):
    """A part of a settings file: frozen, and no key that is not known."""

    model_config = ConfigDict(extra="forbid", frozen=True)


Model = TypeVar("Model", bound=Section)


class BaseSettings(Section):
    """Limits of the differential base, and how it follows the arms."""

    speed: Positive = 0.35  # [m/s]
    yaw_rate: Positive = 0.5  # [rad/s]
    acceleration: Positive = 0.5  # [m/s^2]
    yaw_acceleration: Positive = 1.0  # [rad/s^2]
    bias: Annotated[float, Field(ge=0.0, le=1.0)] = 1.0  # c_n of thesis (44): 1 lets the base do what it can
    follow_forward: NotNegative = 1.0  # [1/s] base speed for each metre that an arm is away from its home
    follow_lateral: NotNegative = 0.3  # [1/s] the same sideways, by turning
    follow_yaw: NotNegative = 0.0  # [1/s] base turn for each radian of the gripper's yaw away from its home


class ArmSettings(Section):
    """How gripper twists become joint velocities."""

    velocity_fraction: Annotated[float, Field(gt=0.0, le=1.0)] = 0.95  # of the description's velocity limits
    acceleration: Positive = 1.7  # [rad/s^2]
    joint_margin: NotNegative = 0.03  # [rad] kept from the stops
    brake_rate: Positive = 4.0  # [1/s] a joint's speed towards its stop is at most this times the way left
    singular_threshold: Positive = 0.05  # smallest singular value below which damping sets in
    damping: Positive = 0.08
    level_gain: NotNegative = 3.0  # [1/s] roll and pitch feedback
    height_gain: NotNegative = 2.0  # [1/s] height feedback while an object is held
    posture_gain: NotNegative = 0.5  # [1/s] null-space draw to the nominal posture
    posture_speed: NotNegative = 0.1  # [rad/s] at most, for that draw
    stow_speed: Positive = 0.3  # [rad/s] of an arm that has nothing to do, on its way to its stowed posture


class ComplianceAxis(Section):
    """One axis of a grip: `v = centring * (home - x) + F / damping + slow part` (robots.md 1.5 for the form).

    The slow part is a leaky integral of the force: for steady forces the grip gives way as if its damping
    were smaller by the factor 1 + leak / yielding.
    """

    damping: Positive  # [N s/m] or [N m s/rad]
    centring: NotNegative = 0.0  # [1/s]
    yielding: Positive | None = None  # [s]; none: no slow part
    leak: Positive = 1.0  # [s]
    dead_band: NotNegative = 0.0  # [N] or [N m]


class ComplianceSettings(Section):
    """Force compliance of a grip, in the gripper's planar axes: stiff along, nearly free across and about."""

    longitudinal: ComplianceAxis = ComplianceAxis(damping=2500.0, centring=0.3, dead_band=2.0)
    lateral: ComplianceAxis = ComplianceAxis(damping=2500.0, centring=0.05, yielding=0.3, leak=3.0, dead_band=2.0)
    yaw: ComplianceAxis = ComplianceAxis(damping=6.0, centring=0.05, yielding=0.5, leak=2.0, dead_band=0.3)
    vertical: ComplianceAxis = ComplianceAxis(damping=4000.0, dead_band=4.0)
    bias_time: Positive = 0.3  # [s] over which a sensor's bias is averaged before a grip closes
    speed: Positive = 0.2  # [m/s] most that compliance adds
    yaw_rate: Positive = 0.5  # [rad/s] most that compliance adds


class ControllerSettings(Section):
    """Everything the body controller can be told."""

    timeout: Positive = 0.2  # [s] a command older than this is no command
    base: BaseSettings = BaseSettings()
    arm: ArmSettings = ArmSettings()
    compliance: ComplianceSettings = ComplianceSettings()
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
