"""Sets of pushes made for one body: as strong as a model says is needed to move it by so much and no more."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrl_model.agents.domain import DT, ActionSet, Thing
from pbrl_model.agents.motions import push_ends

Array = NDArray[np.float64]

STRENGTH = 600.0  # [N] the agent pushes no harder
DURATION = 0.3  # [s] of a push
SIZES = (0.05, 0.12, 0.3)  # [m] how far a push is meant to bring the body
TURNING = 0.5  # [m] a radian counts as this far
HALVINGS = 18
LEAST = 0.01  # [m] a push that does less is no use


def directions(gyration: float) -> Array:
    """Return (26, 3) wrenches of unit size: eight directions, each straight, turning left or right, and turning alone.

    Args:
        gyration: radius of gyration [m], which makes a torque of a force.
    """
    angle = np.arange(8) * np.pi / 4.0
    flat = np.column_stack([np.cos(angle), np.sin(angle)])
    rows = [np.column_stack([flat, np.full(8, turn * gyration)]) for turn in (-1.0, 0.0, 1.0)]
    return np.concatenate([*rows, [[0.0, 0.0, -gyration], [0.0, 0.0, gyration]]])


def measure(ends: Array) -> Array:
    """Return how far displacements (..., 3) go [m], turns counted by `TURNING`."""
    return np.sqrt(ends[..., 0] ** 2 + ends[..., 1] ** 2 + (TURNING * ends[..., 2]) ** 2)


def fitted_actions(thing: Thing, rows: Array, sizes: tuple[float, ...] = SIZES) -> ActionSet:
    """Return pushes in all directions that bring a body as far as `sizes` [m] under a posterior.

    Args:
        thing: the body.
        rows: (P, 12) draws as kernel rows.
        sizes: of the motions.

    Returns:
        The pushes that move it at all; a body that nothing moves has none in some directions.
    """
    unit = np.repeat(directions(float(np.sqrt(thing.inertia_per_mass))), len(sizes), axis=0)
    wanted = np.tile(sizes, len(unit) // len(sizes))
    seconds = np.full(len(unit), round(DURATION / DT) * DT)
    weak, strong = np.zeros(len(unit)), np.full(len(unit), STRENGTH)
    for _ in range(HALVINGS):
        middle = (weak + strong) / 2.0
        far = measure(push_ends(thing, rows, ActionSet(middle[:, None] * unit, seconds)).mean(axis=0)) > wanted
        weak, strong = np.where(far, weak, middle), np.where(far, middle, strong)
    actions = ActionSet(weak[:, None] * unit, seconds)
    useful = measure(push_ends(thing, rows, actions).mean(axis=0)) > LEAST
    return ActionSet(actions.wrench[useful], actions.duration[useful])
