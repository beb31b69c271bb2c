"""Outlines of the PR2 that holds a cart: what the planner sweeps and the local controller checks."""

from __future__ import annotations

from functools import cache

import numpy as np
from shapely import Polygon

from pbrl_control.planar import Array
from pbrl_planner.lattice import ArticulatedBody, GeneratorSettings, Motions, Pace, generate
from pbrl_planner.lattice.body import rectangle

GRIP = (0.65, 0.0)
"""Middle between the hands in `base`, where the cart's bar is [m]."""
ELBOWS = np.array([[0.0, 0.30], [-0.20, 0.43], [-0.45, 0.43], [-0.45, -0.43], [-0.20, -0.43], [0.0, -0.30]])
"""Around both arms, in the cart's frame at the grip [m]: when it turns, elbows swing out on the other side as if fixed
to it."""
CASTERS = 0.03
"""[m] by which swivelled casters can stick out of the cart."""
KEPT = 0.04
"""[m] that plans stay away from everything beyond what the local controller does: what laser, localiser and drive are
off by. A plan without it leads to where the controller does not go on, and so does the next one."""
ARTICULATION = 0.4
"""Largest that is planned [rad]; at 0.47 a shoulder is at its stop."""


def pr2_with(cart: Array, grown: float = 0.0) -> ArticulatedBody:
    """Return the PR2 with its hands on the near short side of a cart.

    Args:
        cart: (k, 2) outline in the cart's own frame, x ahead [m].
        grown: by how much both are taken to be larger to all sides [m].
    """
    low, high = np.min(cart, axis=0), np.max(cart, axis=0)
    length, half = float(high[0] - low[0]), float(high[1]) + CASTERS
    held = np.vstack([[[length, -half], [length, half], [0.0, half]], ELBOWS, [[0.0, -half]]])
    hands = np.array([[0.0, 0.25], [0.0, -0.25]])
    shoulders = np.array([[0.20, 0.30], [0.20, -0.30]])
    robot = rectangle(-0.341, 0.335, 0.345)
    return ArticulatedBody(_grown(robot, grown), _grown(held, grown), GRIP, shoulders, hands)


def _grown(outline: Array, by: float) -> Array:
    if by <= 0.0:
        return outline
    ring = Polygon(outline).buffer(by, join_style="mitre").exterior.coords
    return np.array(ring)[:-1]


def frame_at_grip(cart: Array, bar: float = 0.016) -> Array:
    """Return where the cart's frame at the grip is in its own frame, as a pose (3,); `bar`: its radius [m]."""
    return np.array([float(np.min(cart, axis=0)[0]) + bar, 0.0, 0.0])


@cache
def motions(length: float, width: float, coarse: bool = False) -> Motions:
    """Return the motions with a cart of a length and width [m], swept once in a process.

    Args:
        length: of the cart along x [m].
        width: [m].
        coarse: half as many headings, cells of twice the size: for tests.
    """
    body = pr2_with(rectangle(-length / 2.0, length / 2.0, width / 2.0), KEPT)
    settings = GeneratorSettings(articulation_limit=ARTICULATION)
    if coarse:
        settings = GeneratorSettings(
            resolution=0.05, headings=8, articulations=3, stride=4, articulation_limit=ARTICULATION
        )
    made = Motions(generate(settings), Pace(speed=0.35, yaw_rate=0.35, articulation_rate=0.3), body)
    # What takes long is found out when it is asked for: now, not in the first plan.
    _ = made.relaxed, made.cut("backward"), made.cut("forward")
    return made
