"""First guesses from the motion alone: where a body pivots, along which axis it rolls, round which circle it goes.

No forces are used, and nothing is decided: a guess is one more start for the search beside draws from the prior.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pbrl_model.sensing.motion import Motion

Array = NDArray[np.float64]


def pivot(motions: Sequence[Motion], com: Array) -> Array:
    """Return the point of the body that moved least, (2,) in the body's frame [m].

    Least squares over the smoothed motion: the velocity of a point p is v + omega x R p.
    """
    matrix, right = np.zeros((2, 2)), np.zeros(2)
    for motion in motions:
        c, s, omega = np.cos(motion.state[:, 2]), np.sin(motion.state[:, 2]), motion.state[:, 5]
        vx, vy = motion.state[:, 3], motion.state[:, 4]
        # In the body's axes: velocity (u, w) at the centre of mass; (u - omega y, w + omega x) at (x, y).
        u, w = c * vx + s * vy, -s * vx + c * vy
        matrix += np.sum(omega**2) * np.eye(2)
        right += np.array([-np.sum(omega * w), np.sum(omega * u)])
    ridge = 1e-6 * len(motions)
    return np.linalg.solve(matrix + ridge * np.eye(2), right) + com


def axle(motions: Sequence[Motion], com: Array) -> tuple[float, Array]:
    """Return the direction a fixed wheel would roll in and where it would stand: (angle [rad], (2,) [m]).

    For each direction, the sideways velocity w_perp + omega d is least for one offset d along it; the direction with
    the least sideways motion wins.
    """
    best, answer = np.inf, (0.0, com)
    state = np.concatenate([motion.state for motion in motions])
    c, s, omega = np.cos(state[:, 2]), np.sin(state[:, 2]), state[:, 5]
    u, w = c * state[:, 3] + s * state[:, 4], -s * state[:, 3] + c * state[:, 4]
    for angle in np.linspace(-np.pi / 2, np.pi / 2, 60, endpoint=False):
        sideways = -np.sin(angle) * u + np.cos(angle) * w
        offset = -float(sideways @ omega) / (float(omega @ omega) + 1e-6)
        left = float(np.sum((sideways + omega * offset) ** 2))
        if left < best:
            best, answer = left, (float(angle), com + offset * np.array([np.cos(angle), np.sin(angle)]))
    return answer


def circle(motions: Sequence[Motion]) -> tuple[Array, float] | None:
    """Return centre (2,) and radius [m] of the circle that recorded positions lie on (Kasa's fit), None for a line."""
    points = np.concatenate([motion.pose[:, :2] for motion in motions])
    middle = points.mean(0)
    x, y = (points - middle).T
    matrix = np.stack([2 * x, 2 * y, np.ones_like(x)], -1)
    solution, _, rank, _ = np.linalg.lstsq(matrix, x * x + y * y, rcond=1e-6)
    if rank < 3:
        return None
    squared = float(solution[2] + solution[0] ** 2 + solution[1] ** 2)
    return (solution[:2] + middle, float(np.sqrt(squared))) if squared > 0.0 else None


def guesses(names: Sequence[str], motions: Sequence[Motion], com: Array, draws: Array) -> Array:
    """Put what the motion suggests into some of the prior's draws.

    Args:
        names: learned parameters.
        motions: episodes.
        com: (2,) centre of mass in the body's frame [m].
        draws: (n, K) draws from the prior; each is changed in the columns that the motion speaks of.

    Returns:
        (m, K) guesses; empty where the motion suggests nothing.
    """
    out = []
    column = {name: k for k, name in enumerate(names)}
    if "wheel_x" in column:
        held, rolling = draws.copy(), draws.copy()
        held[:, [column["wheel_x"], column["wheel_y"]]] = pivot(motions, com)
        angle, place = axle(motions, com)
        rolling[:, [column["wheel_x"], column["wheel_y"]]] = place
        rolling[:, column["wheel_theta"]] = angle
        out += [held, rolling]
    found = circle(motions) if "hinge_x" in column else None
    if found is not None:
        round_it = draws.copy()
        round_it[:, [column["hinge_x"], column["hinge_y"]]] = found[0]
        round_it[:, column["hinge_radius"]] = found[1]
        out.append(round_it)
    return np.concatenate(out) if out else np.empty((0, len(names)))
