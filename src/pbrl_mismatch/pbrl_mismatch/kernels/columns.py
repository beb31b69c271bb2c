"""The one flat parameter row of the effects kernel: which column is what, and what it is worth when it is off.

The first twelve columns are those of `pbrl_model.parameters.KERNEL_COLUMNS`. An effect is off where its strength is
zero; its other columns then do not matter. `cone` chooses the law of the baseline's wheel: 0 limits its friction along
each axis alone, as the thesis and `pbrl_model.kernel` do; 1 limits both together by an ellipse, as rubber on a floor
does. A `mu_y` or `wheel2_mu_y` below zero stands for one that is the same as that along x, a
`torque_scale` below zero for one that is the same as `force_scale`. `load_x`, `load_y` are where the feet's load is
centred, off their middle; a force at the height `load_height` over the floor moves it on. `payload_gone` 1 stands for
a load that is there from the start and is taken off. `caster_heading` is how the first caster was turned in the body
when a recording began, `caster_turn2` to `caster_turn4` how far others were from there. `patch_roll` is what holds back
the baseline's wheel on the patch at least, along either axis, over the body's weight.

The last `SPARE` columns are for laws that a user adds: `name_columns` gives some of them names and units.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pbrl_mismatch.errors import MismatchError
from pbrl_model.parameters import KERNEL_COLUMNS, UNITS

Array = NDArray[np.float64]

_EFFECT_COLUMNS: tuple[tuple[str, str, float], ...] = (
    ("inertia_factor", "1", 1.0),
    ("cone", "1", 0.0),
    ("delay", "s", 0.0),
    ("slide_mu", "1", 0.0),
    ("slide_extent", "1", 1.0),
    ("load_x", "m", 0.0),
    ("load_y", "m", 0.0),
    ("load_height", "m", 0.0),
    ("breakaway_mu", "1", 0.0),
    ("breakaway_speed", "m/s", 0.01),
    ("drag_linear", "N s/m", 0.0),
    ("drag_turn", "N m s", 0.0),
    ("patch_mu", "1", 0.0),
    ("patch_x", "m", 0.0),
    ("patch_y", "m", 0.0),
    ("patch_length", "m", 1.0),
    ("patch_width", "m", 1.0),
    ("patch_theta", "rad", 0.0),
    ("patch_roll", "1", 0.0),
    ("slope_x", "rad", 0.0),
    ("slope_y", "rad", 0.0),
    ("com_x", "m", 0.0),
    ("com_y", "m", 0.0),
    ("payload_mass", "kg", 0.0),
    ("payload_time", "s", 0.0),
    ("payload_gone", "1", 0.0),
    ("payload_x", "m", 0.0),
    ("payload_y", "m", 0.0),
    ("tether_stiffness", "N/m", 0.0),
    ("tether_x", "m", 0.0),
    ("tether_y", "m", 0.0),
    ("tether_length", "m", 0.0),
    ("tether_at_x", "m", 0.0),
    ("tether_at_y", "m", 0.0),
    ("force_start", "s", -math.inf),
    ("force_end", "s", math.inf),
    ("steady_x", "N", 0.0),
    ("steady_y", "N", 0.0),
    ("steady_torque", "N m", 0.0),
    ("periodic_x", "N", 0.0),
    ("periodic_y", "N", 0.0),
    ("periodic_torque", "N m", 0.0),
    ("periodic_frequency", "Hz", 0.0),
    ("periodic_phase", "rad", 0.0),
    ("obstacle_stiffness", "N/m", 0.0),
    ("obstacle_x", "m", 0.0),
    ("obstacle_y", "m", 0.0),
    ("obstacle_radius", "m", 0.1),
    ("obstacle_friction", "1", 0.0),
    ("obstacle_angle", "rad", -10.0),
    ("wheel2_x", "m", 0.0),
    ("wheel2_y", "m", 0.0),
    ("wheel2_theta", "rad", 0.0),
    ("wheel2_mu_x", "1", 0.0),
    ("wheel2_mu_y", "1", 0.0),
    ("caster_trail", "m", 0.03),
    ("caster_roll", "1", 0.0),
    ("caster_scrub", "1", 0.0),
    ("caster_twist", "1", 0.0),
    ("caster_lay", "m", math.inf),
    ("caster_heading", "rad", 0.0),
    ("caster_turn2", "rad", 0.0),
    ("caster_turn3", "rad", 0.0),
    ("caster_turn4", "rad", 0.0),
    ("slosh_mass", "kg", 0.0),
    ("slosh_x", "m", 0.0),
    ("slosh_y", "m", 0.0),
    ("slosh_frequency", "Hz", 1.0),
    ("slosh_damping", "1", 0.1),
    ("detent_force", "N", 0.0),
    ("detent_x", "m", 0.0),
    ("detent_y", "m", 0.0),
    ("detent_width", "m", 0.05),
    ("detent_at_x", "m", 0.0),
    ("detent_at_y", "m", 0.0),
    ("pivot_stiffness", "N/m", 0.0),
    ("pivot_x", "m", 0.0),
    ("pivot_y", "m", 0.0),
    ("pivot_damping", "1", 0.3),
    ("pivot_off_x", "m", 0.0),
    ("pivot_off_y", "m", 0.0),
    ("unseen_force", "N", 0.0),
    ("unseen_x", "m", 0.0),
    ("unseen_y", "m", 0.0),
    ("unseen_radius", "m", 0.15),
    ("unseen_angle", "rad", -10.0),
    ("unseen_friction", "1", 0.15),
    ("unseen_tip", "1", 0.0),
    ("bias_x", "N", 0.0),
    ("bias_y", "N", 0.0),
    ("bias_torque", "N m", 0.0),
    ("bias_start", "s", -math.inf),
    ("drift_x", "N/s", 0.0),
    ("drift_y", "N/s", 0.0),
    ("drift_torque", "N m/s", 0.0),
    ("force_scale", "1", 1.0),
    ("torque_scale", "1", 1.0),
    ("sensor_turn", "rad", 0.0),
    ("time_offset", "s", 0.0),
    ("tag_x", "m", 0.0),
    ("tag_y", "m", 0.0),
    ("tag_theta", "rad", 0.0),
    ("grip_compliance", "m/N", 0.0),
    ("grip_play", "m", 0.0),
)

SPARE = 32
"""Columns that no law of the library reads."""
FIRST_SPARE = len(KERNEL_COLUMNS) + len(_EFFECT_COLUMNS)
"""Where they begin."""
COLUMNS: list[str] = [
    *KERNEL_COLUMNS,
    *(name for name, _, _ in _EFFECT_COLUMNS),
    *(f"spare_{k}" for k in range(SPARE)),
]
"""Names of the columns of a parameter row, in order."""
COLUMN: dict[str, int] = {name: k for k, name in enumerate(COLUMNS)}
"""Where each name stands."""
UNIT: dict[str, str] = {
    **UNITS,
    **{name: unit for name, unit, _ in _EFFECT_COLUMNS},
    **dict.fromkeys(COLUMNS[FIRST_SPARE:], "1"),
}
"""Unit of each column."""
WIDTH = len(COLUMNS)
"""Length of a parameter row."""

_BASE_OFF = {"mass": 1.0, "hinge_radius": math.nan}
_NEUTRAL = np.array(
    [_BASE_OFF.get(name, 0.0) for name in KERNEL_COLUMNS] + [off for _, _, off in _EFFECT_COLUMNS] + [0.0] * SPARE
)


def neutral_row() -> Array:
    """Return a (WIDTH,) row of a kilogram that slides freely: no wheel, no hinge, every effect off."""
    return _NEUTRAL.copy()


def name_columns(units: Mapping[str, str]) -> int:
    """Give names and units to spare columns that lie side by side; return where the first of them stands.

    Raises:
        MismatchError: a name is taken, or so many columns are not left.
    """
    taken = [name for name in units if name in COLUMN]
    if taken:
        raise MismatchError(f"columns: expected names that no column has yet, got {', '.join(taken)}")
    free = [COLUMNS[k] == f"spare_{k - FIRST_SPARE}" for k in range(FIRST_SPARE, WIDTH)]
    first = next((k for k in range(SPARE - len(units) + 1) if all(free[k : k + len(units)])), None)
    if first is None:
        raise MismatchError(f"columns: expected at most {sum(free)} more side by side, got {len(units)}")
    for k, (name, unit) in enumerate(units.items(), FIRST_SPARE + first):
        _rename(k, name, unit)
    return FIRST_SPARE + first


def forget_columns(names: tuple[str, ...]) -> None:
    """Make columns spare again that `name_columns` gave names to."""
    for name in names:
        k = COLUMN[name]
        if k < FIRST_SPARE:
            raise MismatchError(f"columns: expected some that were added, got {name!r}")
        _rename(k, f"spare_{k - FIRST_SPARE}", "1")


def _rename(k: int, name: str, unit: str) -> None:
    old = COLUMNS[k]
    del COLUMN[old], UNIT[old]
    COLUMNS[k], COLUMN[name], UNIT[name] = name, k, unit
