"""The body controller: a twist for what is held (or for a free gripper) becomes base and arm velocities.

One tick goes the way of thesis 6.3: the wanted twist at each gripper, what force compliance adds to it, the
share of the base by the body Jacobian with the base preferred (42 to 44), the base's limits, and the rest
for the arms, through their Jacobians with level plates.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pbrl_control.admittance import Admittance, WrenchBias, grip_wrench
from pbrl_control.arm_ik import ArmSolution, level_twist, solve_arm, velocity_bounds
from pbrl_control.body_jacobian import body_jacobian, body_velocity
from pbrl_control.kinematics import SIDES, GripperState, RobotKinematics
from pbrl_control.limits import ArmGate, BaseGate, usable_period
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

GOVERNOR_DOWN, GOVERNOR_UP = 10.0, 1.0  # [1/s] how fast a command is slowed, and resumed
MIRROR = np.array([1.0, -1.0, -1.0])  # left home to right home


@dataclass(frozen=True)
class Task:
    """What one gripper is to do, at its plates, in base axes.

    Attributes:
        wanted: (3,) planar twist that was asked for [m/s, rad/s].
        yielded: (3,) what force compliance adds to it.
        lift: [m/s].
    """

    wanted: Array
    yielded: Array
    lift: float

    @property
    def planar(self) -> Array:
        """The planar twist (3,) to be had."""
        return self.wanted + self.yielded


class BodyController:
    """Whole-body control, one tick at a time. Keeps only compliance states, sensor biases and last commands.

    Args:
        kinematics: of the robot.
        settings: gains and limits.
    """

    def __init__(self, kinematics: RobotKinematics, settings: ControllerSettings) -> None:
        self.settings = settings
        self._kinematics = kinematics
        self._limits = {side: kinematics.limits(side) for side in SIDES}
        self._base = BaseGate(settings.base)
        self._arms = {side: ArmGate(self._limits[side], settings.arm) for side in SIDES}
        self._bias = {side: WrenchBias(settings.compliance.bias_time) for side in SIDES}
        self._grips: dict[str, tuple[str, Admittance]] = {}
        self._governor = 1.0  # share of the commanded twist that the arms can keep up with

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
            return self._stand(fault)
        grippers = self._kinematics.grippers(state.posture)
        self._follow_grasps(grippers, grasps, wrenches, dt)
        if not object_twist or self._uncommanded(object_twist, grasps):
            return self._stand("")
        if "base" in object_twist and not grasps and len(object_twist) == 1:
            return self._drive(state, object_twist["base"], dt)
        tasks = self._tasks(grippers, object_twist, grasps, wrenches, dt)
        return self._move(state, grippers, tasks, grasps, dt)

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
        if any(not np.isfinite([*hold.contact, hold.yaw]).all() for hold in holds.values()):
            return "grasp: expected finite contact and yaw, got NaN or infinity"
        return ""

    def _uncommanded(self, twists: Twists, holds: Holds) -> list[str]:
        """Return what is held and has no command: as a grip opens or closes, one tick's rest is no fault."""
        return [hold.object for hold in holds.values() if hold.object not in twists]

    def _stand(self, report: str) -> BodyCommand:
        self._base.stop()
        for gate in self._arms.values():
            gate.stop()
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
                tasks[side] = Task(turn(twist.array(), gripper.planar[2]), np.zeros(3), twist.vz)
        return tasks

    def _held_task(
        self, side: str, gripper: GripperState, twist: PlanarTwist, hold: Hold, wrenches: Wrenches, dt: float
    ) -> Task:
        at_contact = shift(twist.array(), hold.contact)
        yaw = gripper.planar[2]
        wanted = self._governor * turn(at_contact, yaw + hold.yaw)
        grip = self._grips[side][1]
        raw = wrenches.get(side, np.full(6, np.nan))
        wrench = grip_wrench(side, gripper, self._bias[side].remove(raw))
        away = turn(gripper.planar - grip.home, -yaw)
        away[2] = wrap(gripper.planar[2] - grip.home[2])
        yielded, lift = grip.step(wrench, away, dt)
        lift += self.settings.arm.height_gain * (grip.height - gripper.height)
        return Task(wanted, turn(yielded, yaw), lift)

    def _move(
        self,
        state: BodyState,
        grippers: Mapping[str, GripperState],
        tasks: Mapping[str, Task],
        holds: Holds,
        dt: float,
    ) -> BodyCommand:
        wish = self._base_share(grippers, tasks, holds)
        base = self._base.preview(wish, dt)
        solutions = {side: self._arm_share(state, side, grippers[side], task, base) for side, task in tasks.items()}
        self._govern(min((solution.scale for solution in solutions.values()), default=1.0), dt)
        arms = {}
        for side in SIDES:
            joints = state.posture.arm(side)
            velocity = solutions[side].limited if side in solutions else self._idle(side, joints)
            arms[side] = self._arms[side].commit(velocity, joints, dt)
        v, w = self._base.commit(base)
        return BodyCommand(float(v), float(w), arms["left"], arms["right"])

    def _govern(self, scale: float, dt: float) -> None:
        """Slow the commanded twist while an arm cannot keep up with it, and come back to it afterwards."""
        change = GOVERNOR_DOWN * self._governor * (scale - 1.0) if scale < 1.0 else GOVERNOR_UP * (1.0 - self._governor)
        self._governor = float(np.clip(self._governor + dt * change, 0.0, 1.0))

    def _base_share(self, grippers: Mapping[str, GripperState], tasks: Mapping[str, Task], holds: Holds) -> Array:
        """Return the (2,) base velocity of thesis (44): what carries the grippers, and brings the arms home."""
        if not tasks:
            return np.zeros(2)
        settings = self.settings.base
        poses = np.array([[*grippers[side].planar[:2], 0.0] for side in tasks])
        jacobian = body_jacobian(poses, np.zeros((len(poses), 2)))
        twist = np.concatenate([task.planar for task in tasks.values()])
        ideal = np.mean([shift(task.wanted, -grippers[side].planar[:2]) for side, task in tasks.items()], axis=0)
        away = np.mean([grippers[side].planar - self._home(side, holds) for side in tasks], axis=0)
        reach = max(float(poses[:, 0].mean()), 0.3)
        ideal[0] += settings.follow_forward * away[0]
        ideal[2] += settings.follow_lateral * away[1] / reach + settings.follow_yaw * away[2]
        wish = np.concatenate(([ideal[0], ideal[2]], np.zeros(3 * len(poses))))
        return body_velocity(jacobian, twist, wish, settings.bias)[:2]

    def _home(self, side: str, holds: Holds) -> Array:
        """Return the (3,) place of a gripper in `base` that the base keeps it at."""
        if side in holds:
            return self._grips[side][1].home
        home = np.array(self.settings.home)
        return home if side == "left" else home * MIRROR

    def _arm_share(self, state: BodyState, side: str, gripper: GripperState, task: Task, base: Array) -> ArmSolution:
        """Solve one arm for what its gripper is to do less what the base does already (6.3.1, step 3)."""
        carried = shift(np.array([base[0], 0.0, base[1]]), gripper.planar[:2])
        twist = level_twist(gripper, task.planar - carried, task.lift, self.settings.arm)
        nominal = np.array(self.settings.nominal) * (1.0 if side == "left" else -1.0)
        joints = state.posture.arm(side)
        return solve_arm(gripper, joints, twist, nominal, self._limits[side], self.settings.arm)

    def _idle(self, side: str, joints: Array) -> Array:
        """Return the joint velocities of an arm that has nothing to do: to its stowed posture, or none."""
        if not self.settings.stow_idle_arm:
            return np.zeros(7)
        goal = np.array(self.settings.stowed) * (1.0 if side == "left" else -1.0)
        low, high = velocity_bounds(joints, self._limits[side], self.settings.arm)
        speed = self.settings.arm.stow_speed
        return np.clip(np.clip(goal - joints, -speed, speed), low, high)

    def _drive(self, state: BodyState, twist: PlanarTwist, dt: float) -> BodyCommand:
        """Drive the base alone, arms at rest."""
        v, w = self._base.commit(self._base.preview(np.array([twist.vx, twist.omega]), dt))
        arms = [self._arms[side].commit(np.zeros(7), state.posture.arm(side), dt) for side in SIDES]
        return BodyCommand(float(v), float(w), arms[0], arms[1])
