"""The planar body Jacobian: what base and grippers do, as motion of what is held (thesis 42 to 44).

Equation 42 stacks one block for the base and one for each gripper, each of the form `[R, (y, -x); 0, 1]`,
with R the turn from base axes to object axes and (x, y) the place of base or gripper in the object's
frame. A differential base cannot move along its y, so that column is dropped. Where one gripper holds,
this is the thesis's matrix. Where several do, each of them has to move the object *alike*, so each has
its own three rows; their sum in one row would leave half of the motion to each arm.
"""

from __future__ import annotations

import numpy as np

from pbrl_control.planar import Array, rotation

BASE = 2  # columns of the base: forward, yaw


def twist_block(yaw: float, point: Array) -> Array:
    """Return the (3, 3) map from a carrier's twist to the object's, object axes (one block of 42).

    Args:
        yaw: of the object in the axes that the carrier's twist is given in [rad].
        point: (2,) where the carrier's frame is, in the object's frame [m].
    """
    block = np.eye(3)
    block[:2, :2] = rotation(yaw).T
    block[:2, 2] = point[1], -point[0]
    return block


def base_block(pose: Array) -> Array:
    """Return the (3, 2) map from base (forward, yaw) velocity to the twist of an object it carries.

    Args:
        pose: (3,) of the object in `base` [m, rad].
    """
    base_in_object = -rotation(pose[2]).T @ pose[:2]
    return twist_block(pose[2], base_in_object)[:, [0, 2]]


def body_jacobian(poses: Array, contacts: Array) -> Array:
    """Return J (3n, 2 + 3n): body velocity to the twist of the object, once for each gripper that holds it.

    The body velocity is (base forward, base yaw, then (vx, vy, omega) of each gripper relative to the
    base, in base axes, at its contact).

    Args:
        poses: (n, 3) pose of the object in `base`, for each gripper that holds [m, rad].
        contacts: (n, 2) where each gripper holds it, in the object's frame [m].
    """
    count = len(poses)
    jacobian = np.zeros((3 * count, BASE + 3 * count))
    for i, (pose, contact) in enumerate(zip(poses, contacts, strict=True)):
        rows, columns = slice(3 * i, 3 * i + 3), slice(BASE + 3 * i, BASE + 3 * i + 3)
        jacobian[rows, :BASE] = base_block(pose)
        jacobian[rows, columns] = twist_block(pose[2], contact)
    return jacobian


def body_velocity(jacobian: Array, twist: Array, wish: Array, gain: float = 1.0) -> Array:
    """Return the body velocity that moves the object as asked, as near to a wish as that allows (43, 44).

    `J+ v + gain (I - J+ J) wish`: at gain 1 it is the solution nearest to the wish, at 0 the shortest.

    Args:
        jacobian: (m, n) as of `body_jacobian`.
        twist: (m,) wanted of the object, stacked [m/s, rad/s].
        wish: (n,) ideal body velocity: what the base would do alone, and grippers at rest.
        gain: c_n of (44).
    """
    inverse = np.linalg.pinv(jacobian)
    return inverse @ (twist - gain * (jacobian @ wish)) + gain * wish
