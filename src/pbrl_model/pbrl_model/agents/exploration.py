"""Which pushes an agent makes to get to know a body: away from things, and where its posterior's draws differ."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrl_model.agents.domain import Scene
from pbrl_model.agents.joint_posterior import space_among
from pbrl_model.agents.motions import expected_motions
from pbrl_model.agents.planning import Planner
from pbrl_model.agents.pushes import DURATION, fitted_actions

Array = NDArray[np.float64]

GENTLE = 10.0  # [N] the first push of an unknown body
CANDIDATES = 48
REACH = 0.35  # [m] as far as a push of an unknown body is to have room
SIZE = 0.15  # [m] of pushes that are to tell something
CLEARANCE = 0.05  # [m]


def unknown_push(rng: np.random.Generator, scene: Scene, state: Array, index: int, strength: float) -> Array:
    """Return (3,) a push, world axes, in a random direction in which there is room, with a random turn to it.

    Args:
        rng: source of randomness.
        scene: the room.
        state: (K, 6).
        index: of the body.
        strength: [N].
    """
    thing = scene.things[index]
    planner = Planner(thing, space_among(scene, state, index))
    gyration = float(np.sqrt(thing.inertia_per_mass))
    best, most = np.zeros(3), -1.0
    for _ in range(CANDIDATES):
        angle, turn = rng.uniform(-np.pi, np.pi), rng.uniform(0.3, 1.0) * rng.choice([-1.0, 1.0])
        ahead = np.array([np.cos(angle), np.sin(angle)])
        room = 0.0
        for distance in np.linspace(0.1, 1.0, 4) * REACH:
            if not planner.free(np.array([*(state[index, :2] + distance * ahead), state[index, 2]]), CLEARANCE):
                break
            room = distance
        if room > most:
            best, most = np.array([*(strength * ahead), strength * gyration * turn]), room
        if room >= REACH:
            break
    return best


def telling_push(
    rng: np.random.Generator, scene: Scene, state: Array, index: int, rows: Array
) -> tuple[Array, float] | None:
    """Return the push about whose outcome the posterior's draws disagree most, of those that have room.

    Args:
        rng: source of randomness.
        scene: the room.
        state: (K, 6).
        index: of the body.
        rows: (P, 12) draws of its posterior.

    Returns:
        Wrench (3,) in world axes and duration [s]; None where there is no room for any.
    """
    thing = scene.things[index]
    actions = fitted_actions(thing, rows, (SIZE,))
    if not len(actions):
        return None
    motions, spread = expected_motions(thing, rows, actions)
    planner = Planner(thing, space_among(scene, state, index))
    x, y, theta = state[index, :3]
    c, s = np.cos(theta), np.sin(theta)
    # Ties, as between the draws of a body that is known already, are broken at random.
    for action in np.argsort(-spread * rng.uniform(0.9, 1.0, len(spread))):
        way = motions.table[0, action]
        poses = np.column_stack(
            [x + c * way[:, 0] - s * way[:, 1], y + s * way[:, 0] + c * way[:, 1], theta + way[:, 2]]
        )
        if all(planner.free(pose, CLEARANCE) for pose in poses):
            return actions.in_world(int(action), theta), DURATION
    return None
