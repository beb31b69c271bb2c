"""All effects by name, in the order of the contract."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from pbrl_mismatch.effects import (
    breakaway_friction,
    caster_swivel,
    com_offset,
    detent,
    external_force,
    floor_patch,
    floor_slope,
    grasp_compliance,
    ground_friction,
    hidden_hinge,
    hidden_obstacle,
    payload_change,
    pose_bias,
    second_wheel,
    sloshing_load,
    tether,
    time_offset,
    unseen_body,
    viscous_drag,
    wrench_bias,
    wrench_frame,
)
from pbrl_mismatch.effects.effect import Effect
from pbrl_mismatch.errors import MismatchError
from pbrl_model.parameters import nearest

_MODULES = (
    second_wheel,
    caster_swivel,
    ground_friction,
    breakaway_friction,
    viscous_drag,
    floor_patch,
    floor_slope,
    com_offset,
    payload_change,
    sloshing_load,
    tether,
    detent,
    hidden_hinge,
    hidden_obstacle,
    unseen_body,
    external_force,
    grasp_compliance,
    wrench_bias,
    wrench_frame,
    time_offset,
    pose_bias,
)

_EFFECTS = {module.EFFECT.name: module.EFFECT for module in _MODULES}
CONTRACT = tuple(_EFFECTS)
"""Names of the library's own effects."""
EFFECTS: Mapping[str, Effect] = MappingProxyType(_EFFECTS)
"""Effect by name, those that a user added last."""


def put(effect: Effect) -> None:
    """Add an effect to the library; one of the same name that a user added before is replaced."""
    if effect.name in CONTRACT:
        raise MismatchError(f"effect: expected a name that the library does not have yet, got {effect.name!r}")
    _EFFECTS[effect.name] = effect


def take_out(name: str) -> None:
    """Take an effect out of the library that a user added."""
    if name in CONTRACT or name not in _EFFECTS:
        added = ", ".join(each for each in _EFFECTS if each not in CONTRACT) or "none was"
        raise MismatchError(f"effect: expected one that was added ({added}), got {name!r}")
    del _EFFECTS[name]


def effect_named(name: str) -> Effect:
    """Return an effect by its name.

    Raises:
        MismatchError: the name is unknown.
    """
    if name not in EFFECTS:
        raise MismatchError(f"effect: expected one of {', '.join(EFFECTS)}, got {name!r}{nearest(name, EFFECTS)}")
    return EFFECTS[name]
