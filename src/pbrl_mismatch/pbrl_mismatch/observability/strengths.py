"""How strong an effect is: the columns that make it so, and how to make it weaker or stronger."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.effects.registry import effect_named
from pbrl_mismatch.kernels.columns import COLUMN, UNIT, neutral_row

Array = NDArray[np.float64]

STRENGTHS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "second_wheel": ("wheel2_mu_x", "wheel2_mu_y"),
        "caster_swivel": ("caster_roll", "caster_scrub", "caster_twist"),
        "ground_friction": ("slide_mu",),
        "breakaway_friction": ("breakaway_mu",),
        "viscous_drag": ("drag_linear", "drag_turn"),
        "floor_patch": ("patch_mu", "patch_roll"),
        "floor_slope": ("slope_x", "slope_y"),
        "com_offset": ("com_x", "com_y"),
        "payload_change": ("payload_mass",),
        "sloshing_load": ("slosh_mass",),
        "tether": ("tether_stiffness",),
        "detent": ("detent_force",),
        "hidden_hinge": ("pivot_stiffness",),
        "hidden_obstacle": ("obstacle_stiffness",),
        "unseen_body": ("unseen_force",),
        "external_force": (
            "steady_x",
            "steady_y",
            "steady_torque",
            "periodic_x",
            "periodic_y",
            "periodic_torque",
        ),
        "grasp_compliance": ("grip_compliance", "grip_play"),
        "wrench_bias": ("bias_x", "bias_y", "bias_torque", "drift_x", "drift_y", "drift_torque"),
        "wrench_frame": ("force_scale", "sensor_turn"),
        "time_offset": ("time_offset",),
        "pose_bias": ("tag_x", "tag_y", "tag_theta"),
    }
)
"""Columns that are nothing, or neutral, where an effect is off."""

_NEUTRAL = neutral_row()


def strength_columns(effect: str, free: Sequence[str]) -> tuple[str, ...]:
    """Return which of a variant's free columns make it strong."""
    return tuple(column for column in _strengths(effect) if column in free)


def _strengths(effect: str) -> tuple[str, ...]:
    """Return the strengths of an effect; of one that a user added, what its wrench is proportional to."""
    return STRENGTHS[effect] if effect in STRENGTHS else effect_named(effect).linear


def scaled(rows: Array, columns: Sequence[str], factor: Array) -> Array:
    """Return rows (P, WIDTH) with the strength multiplied by a factor (P,); a ratio is raised to its power."""
    out = rows.copy()
    for column in columns:
        k = COLUMN[column]
        off = _NEUTRAL[k] if column != "sensor_turn" else 0.0
        out[:, k] = rows[:, k] * factor if off == 0.0 else off * (rows[:, k] / off) ** factor
    return out


def laid_on(row: Array, rows: Array, name: str, variant: int, taken: Collection[str]) -> Array:
    """Return rows (P, WIDTH) of a model that has one effect more, and is else what it was.

    Strengths of other effects, which an effect's law may hold too, stay the model's. So does what is free in both,
    unless it is what makes this effect strong.

    Args:
        row: (WIDTH,) of the model.
        rows: (P, WIDTH) that have the effect.
        name: of the effect.
        variant: of it.
        taken: columns that are free in the model.
    """
    effect, strengths = effect_named(name), set(_strengths(name))
    others = {column for columns in STRENGTHS.values() for column in columns} | set(taken)
    own = [*effect.variants[variant], *effect.given(variant)]
    kept = [COLUMN[column] for column in own if column in strengths or column not in others]
    out = np.tile(row, (len(rows), 1))
    out[:, kept] = rows[:, kept]
    return out


def size_of(rows: Array, columns: Sequence[str]) -> Array:
    """Return (P,) the strength: what the columns with the unit of the first one come to, away from neutral."""
    unit = UNIT[columns[0]]
    neutral = [_NEUTRAL[COLUMN[column]] for column in columns]
    alike = [
        (COLUMN[column], off)
        for column, off in zip(columns, neutral, strict=True)
        if UNIT[column] == unit and off == neutral[0]
    ]
    return np.sqrt(np.sum([np.square(np.where(rows[:, k] < 0.0, -1.0, 1.0) * rows[:, k] - off) for k, off in alike], 0))


def unit_of(columns: Sequence[str]) -> str:
    """Return the unit of the strength."""
    return UNIT[columns[0]]


def rounded(value: float) -> str:
    """Return a strength with two digits that mean something."""
    if not math.isfinite(value):
        return "any strength"
    return f"{value:.2g}" if value < 100.0 else f"{value:.0f}"
