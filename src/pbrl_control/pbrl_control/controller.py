"""The body controller: a twist for what is held (or for a free gripper) becomes base and arm velocities.

One tick: the wanted twist at each gripper, what force compliance adds to it, where steering would have the base, the
range of velocities that limits allow, and the whole body solved for at once (`whole_body.program`; or the thesis's way,
`whole_body.pseudo_inverse`).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pbrl_control.admittance import Admittance, ForceGovernor, WrenchBias, grip_wrench
from pbrl_control.kinematics import SIDES, GripperState, RobotKinematics
from pbrl_control.limits import WIDTH, BodyGate, usable_period
from pbrl_control.planar import Array, shift, turn, wrap
from pbrl_control.settings import ControllerSettings
from pbrl_control.types import (
    BodyCommand,
    BodyState,
    Hold,
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
from pbrl_control.whole_body.task import Task, levelling

MIRROR = np.array([1.0, -1.0, -1.0])  # left home to right home
FASTEST = 1.0  # [m/s] no gripper goes faster than this
NOT_SOLVED = "whole-body program: expected a solution, got none; is a joint far outside of its limits?"


class BodyController:
    """Whole-body control, one tick at a time. Keeps compliance states, sensor biases, steering and the last command.

    Args:
        kinematics: of the robot.
        settings: gains and limits.

    Attributes:
        share: of the asked twist that the last tick did, 0 to 1.
    """

    def __init__(self, kinematics: RobotKinematics, settings: ControllerSettings) -> None:
        self.settings = settings
        self.share = 1.0
        self._kinematics = kinematics
        self._gate = BodyGate(settings.base, settings.arm, {side: kinematics.limits(side) for side in SIDES})
        self._way = WholeBodyProgram(settings) if settings.method == "program" else PseudoInverse(settings)
        self._steering = steering_of(settings.base)
        self._bias = {side: WrenchBias(settings.compliance.bias_time) for side in SIDES}
        self._grips: dict[str, tuple[str, Admittance]] = {}
        self._governors: dict[str, ForceGovernor] = {}
        nominal, stowed, home = (np.array(part) for part in (settings.nominal, settings.stowed, settings.home))
        self._nominal, self._stowed = np.stack([nominal, -nominal]), np.stack([stowed, -stowed])
        self._home = {"left": home, "right": home * MIRROR}

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
            elif self._grips.get(side, ("",))[0] != hold.object:
                gripper = grippers[side]
                grip = Admittance(self.settings.compliance, gripper.planar, gripper.height)
                self._grips[side] = (hold.object, grip)
                self._governors[side] = ForceGovernor(self.settings.program, FASTEST)

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
                hold = holds[side]
                tasks[side] = self._held_task(side, gripper, twists[hold.object], hold, wrenches, dt)
            elif gripper_frame(side) in twists:
                twist = twists[gripper_frame(side)]
                roll, pitch = levelling(gripper, self.settings.arm.level_gain)
                added = np.array([0.0, 0.0, 0.0, roll, pitch, 0.0])
                tasks[side] = Task(turn(twist.array(), gripper.planar[2]), twist.vz, added)
        return tasks

    def _held_task(
        self, side: str, gripper: GripperState, twist: PlanarTwist, hold: Hold, wrenches: Wrenches, dt: float
    ) -> Task:
        yaw = gripper.planar[2]
        wanted = turn(shift(twist.array(), hold.contact), yaw + hold.yaw)
        grip = self._grips[side][1]
        raw = wrenches.get(side, np.full(6, np.nan))
        wrench = grip_wrench(side, gripper, self._bias[side].remove(raw))
        unexpected = wrench
        if hold.expected is not None:
            # The object pushes back with what moving it takes; only to the rest is yielded, and that firmly.
            unexpected = wrench + np.array([*turn(hold.expected, hold.yaw), 0.0])
        yielded, lift = grip.step(unexpected, dt, firm=hold.expected is not None)
        lift += self.settings.arm.height_gain * (grip.height - gripper.height)
        vx, vy, omega = turn(yielded, yaw)
        roll, pitch = levelling(gripper, self.settings.arm.level_gain)
        against, room = self._governors[side].step(turn(wrench[:3], yaw)[:2], dt)
        return Task(wanted, 0.0, np.array([vx, vy, lift, roll, pitch, omega]), against, room)

    def _move(
        self, state: BodyState, grippers: Mapping[str, GripperState], tasks: Mapping[str, Task], dt: float
    ) -> BodyCommand:
        joints = np.concatenate((state.posture.left, state.posture.right))
        low, high = self._gate.range(joints, dt)
        base_wish, arm_wish = self._base_wish(grippers, tasks), self._arm_wish(joints, tasks)
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
        count = len(tasks)
        home, away = np.zeros(3), np.zeros(3)
        for side in tasks:
            own = self._home_of(side)
            off = grippers[side].planar - own
            off[2] = wrap(float(off[2]))
            home += own / count
            away += off / count
        carried = home + away
        twist = np.zeros(3)
        for side, task in tasks.items():
            twist += shift(task.wanted, carried[:2] - grippers[side].planar[:2]) / count
        return self._steering.wish(carried, twist, home)

    def _home_of(self, side: str) -> Array:
        """Return the (3,) place of a gripper in `base` that the base keeps it at: of a grip, where it closed."""
        return self._grips[side][1].home if side in self._grips else self._home[side]

    def _arm_wish(self, joints: Array, tasks: Mapping[str, Task]) -> Array:
        """Return the (14,) joint rates towards the nominal posture, or of an arm without a task the stowed one."""
        arm = self.settings.arm
        wish = np.zeros(14)
        for k, side in enumerate(SIDES):
            own = slice(7 * k, 7 * k + 7)
            if side in tasks:
                wish[own] = _bounded(arm.posture_gain * (self._nominal[k] - joints[own]), arm.posture_speed)
            elif self.settings.stow_idle_arm:
                wish[own] = _bounded(self._stowed[k] - joints[own], arm.stow_speed)
        return wish

    def _drive(self, state: BodyState, twist: PlanarTwist, dt: float) -> BodyCommand:
        """Drive the base alone, arms at rest."""
        low, high = self._gate.range(np.concatenate((state.posture.left, state.posture.right)), dt)
        velocity = np.zeros(WIDTH)
        velocity[:2] = twist.vx, twist.omega
        return self._command(Solution(velocity, 1.0), low, high)


def _bounded(values: Array, most: float) -> Array:
    return np.minimum(np.maximum(values, -most), most)
