"""Settings of the priors, read from YAML such as `config/params/priors.yaml`. Unknown keys are errors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pbrl_bag.yaml_text import parse_yaml
from pbrl_model.distributions import Distribution, LogNormal, TruncatedNormal, Uniform, VonMises
from pbrl_model.errors import ModelError
from pbrl_model.parameters import MODEL_CLASSES, nearest

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]

LEARNED = tuple(dict.fromkeys(name for names in MODEL_CLASSES.values() for name in names))
"""Parameters that have a prior: those that some model class learns."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class MassOptions(_Strict):
    """Log-normal prior of the mass: around the nominal mass where there is one, wide where there is none."""

    sigma: Positive = 0.5  # for a body on a hinge this is 1.5, unless another is told
    unknown_median: Positive = 15.0  # [kg]
    unknown_sigma: Positive = 1.0


class FrictionOptions(_Strict):
    """Truncated normal prior on [0, 1] of both friction coefficients."""

    mean: Finite = 0.2
    sd: Positive = 0.4


class GroundOptions(_Strict):
    """Truncated normal prior on [0, 1] of the whole body's friction on the floor: most things pushed here roll."""

    mean: Finite = 0.0
    sd: Positive = 0.05


class WheelOptions(_Strict):
    """Prior of the wheel's place and turn; its support is the footprint's bounding box, grown by the margin."""

    spread: Positive = 1.0  # sd over half the box's side
    margin: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] = 0.0  # [m]
    theta_mean: Finite = 0.0  # [rad]
    theta_kappa: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] = 0.0


class HingeOptions(_Strict):
    """Prior of the hinge's place, around where the body was first seen, and of its radius."""

    sd: Positive = 1.0  # [m]
    reach: Positive = 2.0  # [m] the support ends this far from the body
    radius_median: Positive = 0.5  # [m]
    radius_sigma: Positive = 0.7


class LogNormalSpec(_Strict):
    """A log-normal, written out."""

    distribution: Literal["log_normal"]
    median: Positive
    sigma: Positive

    def build(self) -> Distribution:
        """Return the distribution."""
        return LogNormal(self.median, self.sigma)


class TruncatedNormalSpec(_Strict):
    """A truncated normal, written out."""

    distribution: Literal["truncated_normal"]
    mean: Finite
    sd: Positive
    lower: Finite
    upper: Finite

    def build(self) -> Distribution:
        """Return the distribution."""
        return TruncatedNormal(self.mean, self.sd, self.lower, self.upper)


class VonMisesSpec(_Strict):
    """A von Mises distribution, written out."""

    distribution: Literal["von_mises"]
    mean: Finite
    kappa: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]

    def build(self) -> Distribution:
        """Return the distribution."""
        return VonMises(self.mean, self.kappa)


class UniformSpec(_Strict):
    """A uniform distribution, written out."""

    distribution: Literal["uniform"]
    lower: Finite
    upper: Finite

    def build(self) -> Distribution:
        """Return the distribution."""
        return Uniform(self.lower, self.upper)


DistributionSpec = Annotated[
    LogNormalSpec | TruncatedNormalSpec | VonMisesSpec | UniformSpec, Field(discriminator="distribution")
]


class PriorOptions(_Strict):
    """All settings; `parameters` replaces the prior of a parameter by name."""

    mass: MassOptions = MassOptions()
    friction: FrictionOptions = FrictionOptions()
    ground: GroundOptions = GroundOptions()
    wheel: WheelOptions = WheelOptions()
    hinge: HingeOptions = HingeOptions()
    parameters: dict[str, DistributionSpec] = Field(default_factory=dict)


_SECTIONS = (MassOptions, FrictionOptions, WheelOptions, HingeOptions)
_SPECS = (LogNormalSpec, TruncatedNormalSpec, VonMisesSpec, UniformSpec)
_KEYS = {key for model in (PriorOptions, *_SECTIONS, *_SPECS) for key in model.model_fields}


def parse_prior_options(values: object, where: str = "priors") -> PriorOptions:
    """Check settings that have been read from a file.

    Args:
        values: mapping as YAML gives it; None: all defaults.
        where: what to call it in an error.

    Raises:
        ModelError: a key is unknown or a value is out of range.
    """
    try:
        options = PriorOptions.model_validate({} if values is None else values)
    except ValidationError as error:
        raise ModelError(f"{where}: {_one_line(error)}") from None
    for name, spec in options.parameters.items():
        if name not in LEARNED:
            raise ModelError(
                f"{where}: parameters: expected one of {', '.join(LEARNED)}, got {name!r}{nearest(name, LEARNED)}"
            )
        spec.build()
    return options


def load_prior_options(path: Path) -> PriorOptions:
    """Read the priors' settings from a YAML file.

    Raises:
        ModelError: the file cannot be read, a key is unknown or a value is out of range.
    """
    try:
        values = parse_yaml(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"{path}: expected readable YAML, got {' '.join(str(error).split())}") from None
    except ValueError as error:
        raise ModelError(f"{path}: {error}") from None
    return parse_prior_options(values, str(path))


def _one_line(error: ValidationError) -> str:
    first = error.errors()[0]
    place = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        return f"unknown key {place}{nearest(str(first['loc'][-1]), sorted(_KEYS))}"
    return f"{place or 'file'}: {first['msg']}, got {first['input']!r}"
