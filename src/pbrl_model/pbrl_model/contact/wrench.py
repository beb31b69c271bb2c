"""What a held body does to another that it touches: Newton's third law on recorded motion (thesis 6.5.3).

The held body's momentum changes by what gripper, floor and the touched body do to it. The gripper's part is felt; the
floor's part, the mass and what is left of the sensor's bias are learned while nothing is touched; so what the touched
body does is what remains, and its opposite acts on the touched body.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_model.geometry import MassProperties
from pbrl_model.kernel import GRAVITY
from pbrl_model.parameters import BodyParameters
from pbrl_model.rollout import com_to_origin
from pbrl_model.sensing.motion import Motion
from pbrl_model.transforms import plane_rotations

Array = NDArray[np.float64]

SLOW = 5e-3
"""Below this speed [m/s] the floor's friction fades: a smoothed velocity does not know rest from creeping."""


@dataclass(frozen=True)
class HeldBody:
    """What is known of the held body before anything is touched.

    Attributes:
        parameters: mass and friction on the floor.
        body: centre of mass and inertia over mass.
        bias: (3,) wrench at its centre of mass in its own axes that the sensor shows too little [N, N, N m].
        mass_sd: standard deviation of the mass [kg].
    """

    parameters: BodyParameters
    body: MassProperties
    bias: Array
    mass_sd: float = 0.0


def felt_wrench(held: HeldBody, motion: Motion) -> Array:
    """Return (T, 3) what the grippers do to the held body, the bias taken out, at its centre of mass in world axes."""
    heading = 0.5 * (motion.state[1:, 2] + motion.state[:-1, 2])
    c, s = np.cos(heading), np.sin(heading)
    x, y, turn = held.bias
    return motion.wrench + np.stack([c * x - s * y, s * x + c * y, np.full_like(c, turn)], -1)


def free_wrench(held: HeldBody, motion: Motion) -> Array:
    """Return (T, 3) what gripper and floor do to the held body beyond what its motion needs: W - friction - m dv/dt.

    Zero, but for noise, while nothing is touched; otherwise what it does to the touched body, at its own centre of mass
    in world axes. Velocities are the smoother's: a force that acts for less than its resolution comes out spread over
    it, with its impulse unchanged.
    """
    scale = held.parameters.mass * np.array([1.0, 1.0, held.body.inertia_per_mass])
    velocity = 0.5 * (motion.state[1:, 3:] + motion.state[:-1, 3:])
    weights = np.array([1.0, 1.0, held.body.inertia_per_mass])
    speed = np.sqrt(velocity**2 @ weights)  # in the metric of its inertia, as the engines' friction has it
    friction = held.parameters.mu_ground * GRAVITY * scale * velocity / np.maximum(speed, SLOW)[:, None]
    momentum = scale * np.diff(motion.state[:, 3:], axis=0) / motion.dt
    return felt_wrench(held, motion) - friction - momentum


def contact_wrench(held: HeldBody, motion: Motion, centre: Array) -> Array:
    """Return (T, 3) what the held body does to another, at that one's centre of mass in world axes.

    Args:
        held: the held body.
        motion: of it; `wrench` from its grippers.
        centre: (T + 1, 2) of the touched body's centre of mass [m].
    """
    out = free_wrench(held, motion)
    arm = 0.5 * (motion.state[1:, :2] + motion.state[:-1, :2]) - 0.5 * (centre[1:] + centre[:-1])
    out[:, 2] += arm[:, 0] * out[:, 1] - arm[:, 1] * out[:, 0]
    return out


def gaps(first: Array, first_pose: Array, second: Array, second_pose: Array) -> Array:
    """Return the distance (n,) [m] between two footprints along their paths; zero where they overlap.

    Args:
        first: (k, 2) corners in its body's frame [m].
        first_pose: (n, 3) of that frame in world.
        second: (l, 2).
        second_pose: (n, 3).
    """
    return np.asarray(
        shapely.distance(shapely.polygons(_placed(first, first_pose)), shapely.polygons(_placed(second, second_pose)))
    )


def frame_path(motion: Motion, body: MassProperties) -> Array:
    """Return the smoothed poses (T + 1, 3) of a body's frame."""
    return com_to_origin(motion.state[:, :3], body.com)


def _placed(points: Array, pose: Array) -> Array:
    return points @ np.swapaxes(plane_rotations(pose[:, 2]), -1, -2) + pose[:, None, :2]
