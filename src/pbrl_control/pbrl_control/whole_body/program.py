"""The whole body as one quadratic program: tasks of both grippers, steering and postures, under all limits at once.

Where the thesis splits the work (42 to 44: what the base can do it does, the arms do the rest), here one weighted
problem is solved each tick (Escande, Mansard and Wieber 2014 for the form; the share of the task that limits leave is
an unknown, Flacco, De Luca and Khatib 2012). Its terms, from strong to weak: the twists of the grippers; how much of
the asked twist is done now, so that at a limit the object goes slower and not elsewhere; the base's steering; postures.
Solved by DAQP (Arnstrom, Bemporad and Axehill 2022), a dual active-set method that is exact and takes microseconds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import daqp
import numpy as np

from pbrl_control.kinematics import SIDES, GripperState
from pbrl_control.planar import Array
from pbrl_control.settings import ControllerSettings
from pbrl_control.whole_body.program_kernel import ROWS, UNKNOWNS, lay_program
from pbrl_control.whole_body.task import Task

SOFT = 8
"""DAQP's sense of a row that gives way where nothing else can: a border that was passed already."""
SOLVED = (1, 2)
"""DAQP's exit flags of a solution: exact, and with soft rows in use."""


@dataclass(frozen=True)
class Solution:
    """What the whole body is to do.

    Attributes:
        velocity: (16,) base forward and yaw, left and right joint rates.
        share: of the asked twist that is done now, 0 to 1.
    """

    velocity: Array
    share: float


class WholeBodyProgram:
    """Solves the program of one tick; keeps its buffers only.

    Args:
        settings: weights, borders and limits.
    """

    def __init__(self, settings: ControllerSettings) -> None:
        program = settings.program
        self._weights = np.array(
            [
                program.share,
                program.base_forward,
                program.base_yaw,
                program.joints,
                program.idle_joints,
                program.angular_length,
                program.border_rate,
            ]
        )
        left = np.array([*program.reach_x, *program.reach_y])
        right = np.array([*program.reach_x, -program.reach_y[1], -program.reach_y[0]])
        self._box = np.stack([left, right])
        self._sense = np.zeros(UNKNOWNS + ROWS, dtype=np.int32)
        self._sense[UNKNOWNS:] = SOFT
        self._jacobians, self._planar = np.zeros((2, 6, 7)), np.zeros((2, 3))
        self._active = np.zeros(2, dtype=np.bool_)
        self._asked, self._added = np.zeros((2, 6)), np.zeros((2, 6))
        self._against, self._room = np.zeros((2, 2)), np.zeros(2)
        self._hessian, self._linear = np.zeros((UNKNOWNS, UNKNOWNS)), np.zeros(UNKNOWNS)
        bounds = UNKNOWNS + ROWS
        self._rows, self._least, self._most = np.zeros((ROWS, UNKNOWNS)), np.zeros(bounds), np.zeros(bounds)

    def solve(
        self,
        grippers: Mapping[str, GripperState],
        tasks: Mapping[str, Task],
        base_wish: Array,
        arm_wish: Array,
        low: Array,
        high: Array,
    ) -> Solution | None:
        """Return what the body does; None where there is no solution.

        Args:
            grippers: where both are.
            tasks: of those that have one.
            base_wish: (2,) where steering would go [m/s, rad/s].
            arm_wish: (14,) joint rates towards nominal or stowed postures [rad/s].
            low: (16,) least body velocity.
            high: (16,) greatest.
        """
        for k, side in enumerate(SIDES):
            gripper, task = grippers[side], tasks.get(side)
            self._jacobians[k], self._planar[k] = gripper.jacobian, gripper.planar
            self._active[k] = task is not None
            if task is not None:
                self._asked[k, 0], self._asked[k, 1], self._asked[k, 5] = task.wanted
                self._asked[k, 2] = task.lift
                self._added[k] = task.added
                self._against[k], self._room[k] = task.against, task.room
        reach = lay_program(
            self._jacobians,
            self._planar,
            self._active,
            self._asked,
            self._added,
            base_wish,
            arm_wish,
            self._against,
            self._room,
            self._box,
            self._weights,
            low,
            high,
            self._hessian,
            self._linear,
            self._rows,
            self._least,
            self._most,
        )
        found, _, flag, _ = daqp.solve(self._hessian, self._linear, self._rows, self._most, self._least, self._sense)
        if flag not in SOLVED:
            return None
        # The solver keeps its bounds to within 1e-5.
        return Solution(found[:16], min(max(float(found[16] / reach), 0.0), 1.0) if reach > 0.0 else 1.0)
