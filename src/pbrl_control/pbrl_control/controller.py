"""The body controller: a twist for what is held (or for a free gripper) becomes base and arm velocities.

One tick: the wanted twist at each gripper, what force compliance adds to it, where steering would have the base, the
range of velocities that limits allow, and the whole body solved for at once (`whole_body.program`; or the thesis's way,
`whole_body.pseudo_inverse`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import product

import numpy as np

from pbrl_control.admittance import HeldGrip, WrenchBias
from pbrl_control.kinematics import SIDES, GripperState, RobotKinematics
from pbrl_control.limits import WIDTH, BodyGate, usable_period
from pbrl_control.planar import Array, turn
from pbrl_control.settings import ControllerSettings
from pbrl_control.types import (
    BodyCommand,
    BodyState,
    Holds,
    PlanarTwist,
    Twists,
    Wrenches,
    gripper_frame,
    known_targets,
)
from pbrl_control.whole_body.program import Solution, WholeBodyProgram
from pbrl_control.whole_body.pseudo_inverse import PseudoInverse
from pbrl_control.whole_body.steering import steering_of
from pbrl_control.whole_body.steering_kernel import carried_frame
from pbrl_control.whole_body.task import Task, levelling

MIRROR = np.array([1.0, -1.0, -1.0])  # left home to right home
UNFELT = np.full(6, math.nan)  # of a wrist whose sensor has said nothing
NOT_SOLVED = "whole-body program: expected a solution, got none; is a joint far outside of its limits?"


class BodyController:
    """Whole-body control, one tick at a time. Keeps compliance states, sensor biases, steering and the last command.

    Args:
        kinematics: of the robot.
        settings: gains and limits.

    Attributes:
        share: of the asked twist that the last tick did, 0 to 1; 1 where nothing was asked.
    """

    def __init__(self, kinematics: RobotKinematics, settings: ControllerSettings) -> None:
        self.settings = settings
        self.share = 1.0
        self._kinematics = kinematics
        self._gate = BodyGate(settings.base, settings.arm, {side: kinematics.limits(side) for side in SIDES})
        self._way = WholeBodyProgram(settings) if settings.method == "program" else PseudoInverse(settings)
        self._steering = steering_of(settings.base)
        self._bias = {side: WrenchBias(settings.compliance.bias_time) for side in SIDES}
        self._grips: dict[str, HeldGrip] = {}
        home = np.array(settings.home)
        self._home = {"left": home, "right": home * MIRROR}
        self._draws = {busy: _draw(settings, busy) for busy in product((False, True), repeat=len(SIDES))}

    def tick(self, state: BodyState, object_twist: Twists, grasps: Holds, wrenches: Wrenches, dt: float) -> BodyCommand:
        """Return what the body does for the next `dt`.

        Args:
            state: joint positions.
            object_twist: the commands in force, by what they move (see `PlanarTwist`); none: stand still.
            grasps: who holds what, by gripper.
            wrenches: raw wrist sensor (6,) force then torque in `<side>_ft`, by gripper.
            dt: control period [s].

        Returns:
            The command; zero with a report where an input cannot be trusted.
        """
        fault = self._fault(state, object_twist, grasps, dt)
        if fault:
            return self.stand(fault)
        grippers = self._kinematics.grippers(state.posture)
        self._follow_grasps(grippers, grasps, wrenches, dt)
        if not object_twist or self._uncommanded(object_twist, grasps):
            return self.stand("")
        if "base" in object_twist and not grasps and len(object_twist) == 1:
            return self._drive(state, object_twist["base"], dt)
        tasks = self._tasks(grippers, object_twist, grasps, wrenches, dt)
        return self._move(state, grippers, tasks, dt)

    def _fault(self, state: BodyState, twists: Twists, holds: Holds, dt: float) -> str:
        """Return why nothing may move, in a sentence; empty where all is well."""
        if not usable_period(dt):
            return f"control period: expected 0 to 0.1 s, got {dt} s"
        if not state.finite():
            return "joint positions: expected numbers, got NaN or infinity"
        for target, twist in twists.items():
            if not twist.finite():
                return f"twist for {target!r}: expected numbers, got NaN or infinity"
            if twist.moves() and target not in known_targets(holds):
                return f"twist for {target!r}: expected something held, got an object that no gripper holds"
        loose = self._uncommanded(twists, holds)
        if loose and any(twist.moves() for twist in twists.values()):
            return f"twist: expected one for the held {loose[0]!r}, got {', '.join(sorted(twists))}"
        if not all(hold.usable() for hold in holds.values()):
            return "grasp: expected finite contact, yaw and expected wrench, got NaN or infinity"
        return ""

    def _uncommanded(self, twists: Twists, holds: Holds) -> list[str]:
        """Return what is held and has no command: as a grip opens or closes, one tick's rest is no fault."""
        return [hold.object for hold in holds.values() if hold.object not in twists]

    def stand(self, report: str) -> BodyCommand:
        """Return rest, and why; what comes next begins from rest."""
        self.share = 0.0 if report else 1.0
        self._gate.stop()
        self._steering.stop()
        return BodyCommand(report=report)

    def _follow_grasps(self, grippers: Mapping[str, GripperState], holds: Holds, wrenches: Wrenches, dt: float) -> None:
        """Learn sensor biases while grips are open; make a grip's home where it closed."""
        for side in SIDES:
            hold = holds.get(side)
            if hold is None:
                self._grips.pop(side, None)
                if side in wrenches:
                    self._bias[side].update(wrenches[side], dt)
            elif side not in self._grips or self._grips[side].target != hold.object:
                self._grips[side] = HeldGrip(side, hold.object, self.settings, grippers[side])

    def _tasks(
        self,
        grippers: Mapping[str, GripperState],
        twists: Twists,
        holds: Holds,
        wrenches: Wrenches,
        dt: float,
    ) -> dict[str, Task]:
        tasks = {}
        for side, gripper in grippers.items():
            if side in holds:
                hold, raw, bias = holds[side], wrenches.get(side, UNFELT), self._bias[side].mean
                tasks[side] = self._grips[side].task(gripper, twists[hold.object], hold, raw, bias, dt)
            elif gripper_frame(side) in twists:
                twist = twists[gripper_frame(side)]
                roll, pitch = levelling(gripper, self.settings.arm.level_gain)
                added = np.array([0.0, 0.0, 0.0, roll, pitch, 0.0])
                tasks[side] = Task(turn(twist.array(), gripper.planar[2]), twist.vz, added)
        return tasks

    def _move(
        self, state: BodyState, grippers: Mapping[str, GripperState], tasks: Mapping[str, Task], dt: float
    ) -> BodyCommand:
        joints = np.concatenate((state.posture.left, state.posture.right))
        low, high = self._gate.range(joints, dt)
        target, gain, most = self._draws[tuple(side in tasks for side in SIDES)]
        arm_wish = np.minimum(np.maximum(gain * (target - joints), -most), most)
        base_wish = self._base_wish(grippers, tasks)
        found = self._way.solve(grippers, tasks, base_wish, arm_wish, low, high)
        if found is None:
            return self.stand(NOT_SOLVED)
        return self._command(found, low, high)

    def _command(self, found: Solution, low: Array, high: Array) -> BodyCommand:
        self.share = found.share
        sent = self._gate.commit(found.velocity, low, high)
        return BodyCommand(float(sent[0]), float(sent[1]), sent[2:9].copy(), sent[9:].copy())

    def _base_wish(self, grippers: Mapping[str, GripperState], tasks: Mapping[str, Task]) -> Array:
        """Return the (2,) base velocity that steering has in mind; rest where nothing is asked to move."""
        if not any(task.wanted.any() for task in tasks.values()):
            return np.zeros(2)
        rows = [(grippers[side].planar, self._home_of(side), task.wanted) for side, task in tasks.items()]
        carried, twist, home = carried_frame(np.concatenate([each for row in rows for each in row]).reshape(-1, 3, 3))
        return self._steering.wish(carried, twist, home)

    def _home_of(self, side: str) -> Array:
        """Return the (3,) place of a gripper in `base` that the base keeps it at: of a grip, where it closed."""
        return self._grips[side].home if side in self._grips else self._home[side]

    def _drive(self, state: BodyState, twist: PlanarTwist, dt: float) -> BodyCommand:
        """Drive the base alone, arms at rest."""
        low, high = self._gate.range(np.concatenate((state.posture.left, state.posture.right)), dt)
        velocity = np.zeros(WIDTH)
        velocity[:2] = twist.vx, twist.omega
        return self._command(Solution(velocity, 1.0), low, high)


def _draw(settings: ControllerSettings, busy: tuple[bool, ...]) -> tuple[Array, Array, Array]:
    """Return where arms are drawn to (14,) [rad], how (14,) [1/s] and how fast at most (14,) [rad/s].

    Args:
        settings: of postures and gains.
        busy: of the left and the right arm, whether it has a task: then to the nominal posture, else to the stowed one.
    """
    arm, targets, gains, most = settings.arm, [], [], []
    for has_task, sign in zip(busy, (1.0, -1.0), strict=True):
        targets.append(sign * np.array(settings.nominal if has_task else settings.stowed))
        gains += 7 * [arm.posture_gain if has_task else float(settings.stow_idle_arm)]
        most += 7 * [arm.posture_speed if has_task else arm.stow_speed]
    return np.concatenate(targets), np.array(gains), np.array(most)
