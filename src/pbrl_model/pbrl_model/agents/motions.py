"""Tables of motions for the planner: what a model says each push does to a body that touches nothing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrl_model.agents.domain import DT, ActionSet, Thing
from pbrl_model.agents.planning import Motions
from pbrl_model.parameters import BodyParameters
from pbrl_model.rollout import rollout_states

Array = NDArray[np.float64]

COAST = 2.0  # [s] after which a body that was let go counts as at rest
SAMPLES = 5  # poses on the way of an action at which contact is looked for


def physics_motions(thing: Thing, parameters: BodyParameters, actions: ActionSet, samples: int = SAMPLES) -> Motions:
    """Return the motions of a physical model: every action in one batch of the kernel.

    Args:
        thing: the body.
        parameters: its physics; a hinge is taken to be where the anchor is, wherever the body stands.
        actions: the pushes.
        samples: poses on the way.
    """
    states = push_and_coast(thing, parameters.to_vector()[None], actions)[0]
    return Motions(np.array([[on_the_way(path, samples) for path in states[..., :3]]]), np.ones(len(actions)))


def push_and_coast(thing: Thing, rows: Array, actions: ActionSet, coast: float = COAST) -> Array:
    """Roll pushes out from rest at the origin, and let go.

    Args:
        thing: the body.
        rows: (P, 12) of `KERNEL_COLUMNS`; hinges are put where the anchors are.
        actions: A pushes.
        coast: [s] after the longest push.

    Returns:
        (P, A, T + 1, 6) states of the centre of mass.
    """
    pushing = np.round(actions.duration / DT).astype(int)
    steps = int(pushing.max()) + round(coast / DT)
    wrench = np.where(np.arange(steps)[None, :, None] < pushing[:, None, None], actions.wrench[:, None], 0.0)
    pinned = np.array(rows)
    pinned[:, 6:8] = pinned[:, 9:11]
    return rollout_states(pinned, np.zeros((len(actions), 6)), wrench, thing.inertia_per_mass, dt=DT)


def on_the_way(path: Array, samples: int) -> Array:
    """Return (samples, 3) poses of a path (n, 3), alike far from each other, the last its end."""
    moved = np.hypot(*np.diff(path[:, :2], axis=0).T) + 0.3 * np.abs(np.diff(path[:, 2]))
    share = np.concatenate([[0.0], np.cumsum(moved)])
    at = np.searchsorted(share, share[-1] * np.arange(1, samples + 1) / samples)
    at = np.minimum(at, len(path) - 1)
    at[-1] = len(path) - 1
    return path[at]


def expected_motions(thing: Thing, rows: Array, actions: ActionSet, samples: int = SAMPLES) -> tuple[Motions, Array]:
    """Return the mean of a posterior's motions (thesis section 5.3: the expectation of the simulator's output).

    Args:
        thing: the body.
        rows: (P, 12) draws of the posterior as kernel rows.
        actions: the pushes.
        samples: poses on the way.

    Returns:
        The motions, and (A,) how far the draws' ends spread about the mean's [m].
    """
    paths = push_and_coast(thing, rows, actions)[..., :3]
    ends, mean = paths[:, :, -1], paths.mean(axis=0)
    lever = np.array([1.0, 1.0, np.sqrt(thing.inertia_per_mass)])
    spread = np.sqrt((((ends - mean[:, -1]) * lever) ** 2).sum(axis=2).mean(axis=0))
    return Motions(np.array([[on_the_way(path, samples) for path in mean]]), np.ones(len(actions))), spread


def push_ends(thing: Thing, rows: Array, actions: ActionSet) -> Array:
    """Return (P, A, 3) where pushes from rest at the origin come to rest again."""
    return push_and_coast(thing, rows, actions)[:, :, -1, :3]
