"""The thesis's way to the whole body (section 6.3.1): the base's share by the body Jacobian, the rest by the arms.

Beside the program of `program`, which is the default: limits are kept by slowing down after the solution, and what one
arm cannot do the other does not know.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pbrl_control.body_jacobian import body_jacobian, body_velocity
from pbrl_control.kinematics import SIDES, GripperState
from pbrl_control.planar import Array, shift
from pbrl_control.settings import ControllerSettings
from pbrl_control.whole_body.arm_ik import solve_arm
from pbrl_control.whole_body.program import Solution
from pbrl_control.whole_body.task import Task


class PseudoInverse:
    """Solves one tick by equations 42 to 44.

    Args:
        settings: gain of the null space, damping.
    """

    def __init__(self, settings: ControllerSettings) -> None:
        self._settings = settings.pseudo_inverse

    def solve(
        self,
        grippers: Mapping[str, GripperState],
        tasks: Mapping[str, Task],
        base_wish: Array,
        arm_wish: Array,
        low: Array,
        high: Array,
    ) -> Solution:
        """Return what the body does; for the arguments see `WholeBodyProgram.solve`."""
        base = np.clip(self._base_share(grippers, tasks, base_wish), low[:2], high[:2])
        velocity = np.concatenate((base, arm_wish))
        share = 1.0
        for k, side in enumerate(SIDES):
            if side not in tasks:
                continue
            gripper, task = grippers[side], tasks[side]
            carried = shift(np.array([base[0], 0.0, base[1]]), gripper.planar[:2])
            twist = task.twist - np.array([carried[0], carried[1], 0.0, 0.0, 0.0, carried[2]])
            columns = slice(2 + 7 * k, 9 + 7 * k)
            found = solve_arm(
                gripper.jacobian,
                twist,
                arm_wish[7 * k : 7 * k + 7],
                np.minimum(low[columns], 0.0),
                np.maximum(high[columns], 0.0),
                threshold=self._settings.singular_threshold,
                damping=self._settings.damping,
            )
            velocity[columns] = found.limited
            share = min(share, found.scale)
        return Solution(velocity, share)

    def _base_share(self, grippers: Mapping[str, GripperState], tasks: Mapping[str, Task], wish: Array) -> Array:
        """Return the (2,) base velocity of (44): the shortest body motion that does the tasks, near the wish."""
        if not tasks:
            return np.zeros(2)
        poses = np.array([[*grippers[side].planar[:2], 0.0] for side in tasks])
        jacobian = body_jacobian(poses, np.zeros((len(poses), 2)))
        twist = np.concatenate([task.planar for task in tasks.values()])
        ideal = np.concatenate((wish, np.zeros(3 * len(poses))))
        return body_velocity(jacobian, twist, ideal, self._settings.bias)[:2]
