"""Simulator and controller in one process: what is observed goes to the control loop, its commands to the robot."""

from __future__ import annotations

from functools import singledispatchmethod

import numpy as np
from numpy.typing import NDArray

from krang_sim.observations import (
    GraspState,
    JointStates,
    KnownScene,
    Observation,
    RobotDescription,
    TagReading,
    WristReading,
)
from krang_sim.session import KrangSession
from pbrl_control.course import Course
from pbrl_control.grasp_plan import GraspPlan
from pbrl_control.kinematics import SIDES, Posture, RobotKinematics
from pbrl_control.loop import ControlLoop, Executive, LoopCommand
from pbrl_control.percept import BodyShape, Grip, Percept, Tag
from pbrl_control.push import GripperAnswer, GripperRequest, PushCommand
from pbrl_control.settings import ControllerSettings


class Manipulation:
    """One session and its controller, ticked as in its node: with each joint state.

    Args:
        session: of the simulator.
        task: an executive, or what to grasp, and how.
        settings: of the body controller.
        course: what the object of a plan does while it is held; None: the segments of a push plan.

    Attributes:
        plan: what is grasped, and how.
        last: the executive's last command; None before the first.
        loop: once the robot's description has come.
    """

    def __init__(
        self,
        session: KrangSession,
        task: GraspPlan | Executive,
        settings: ControllerSettings,
        course: Course | None = None,
    ) -> None:
        self.session = session
        self.plan = task if isinstance(task, GraspPlan) else task.plan
        self.last: PushCommand | None = None
        self.loop: ControlLoop | None = None
        self._task = task
        self._settings = settings
        self._course = course
        self._posture: Posture | None = None
        self._tags: dict[str, Tag] = {}
        self._wrenches: dict[str, NDArray[np.float64]] = {}
        self._grips: dict[str, Grip] = {}
        self._bodies: dict[str, BodyShape] = {}

    @property
    def phase(self) -> str:
        """Where it is."""
        return "start" if self.last is None else str(self.last.phase)

    def step(self) -> list[Observation]:
        """Advance the simulator by one step, and control at each joint state; return what was observed."""
        observations = list(self.session.step())
        for observation in observations:
            self.noted(observation)
            self.perceive(observation)
        if self.loop and self._posture and any(isinstance(each, JointStates) for each in observations):
            self.obey(self.loop.tick(self.session.time, self.percept()))
        return observations

    def percept(self) -> Percept:
        """Return what is perceived now."""
        return Percept(self._posture, dict(self._tags), dict(self._wrenches), dict(self._grips), dict(self._bodies))

    def noted(self, observation: Observation) -> None:
        """Take note of what is observed, before the controller hears of it; here nothing."""

    def commanded(self, command: LoopCommand) -> None:
        """Take note of what is commanded, before it is done; here nothing."""

    def obey(self, command: LoopCommand) -> None:
        """Send a command to the robot, and carry out the grippers' requests."""
        self.commanded(command)
        self.last = command.push
        self.session.command_base(command.body.base_v, command.body.base_w)
        for side in SIDES:
            self.session.command_arm(side, command.body.arm(side).tolist())
        for request in command.push.requests:
            self._answer(request)

    def _answer(self, request: GripperRequest) -> None:
        assert self.loop is not None
        if request.action == "grasp":
            outcome = self.session.grasp(request.side, request.object)
        else:
            outcome = self.session.release(request.side)
        self.loop.answer(
            GripperAnswer(request.action, request.side, outcome.success, outcome.message, outcome.distance)
        )

    @singledispatchmethod
    def perceive(self, observation: object) -> None:
        """Take in what the controller uses; the rest of the observations is not its business."""

    @perceive.register
    def _(self, observation: RobotDescription) -> None:
        self.loop = ControlLoop(RobotKinematics(observation.urdf), self._task, self._settings, self._course)

    @perceive.register
    def _(self, observation: JointStates) -> None:
        self._posture = Posture.from_joint_states(observation.names, observation.position.tolist())

    @perceive.register
    def _(self, observation: TagReading) -> None:
        self._tags[observation.tag] = Tag(observation.time, observation.position, observation.quaternion)

    @perceive.register
    def _(self, observation: WristReading) -> None:
        self._wrenches[observation.side] = np.concatenate([observation.force, observation.torque])

    @perceive.register
    def _(self, observation: GraspState) -> None:
        self._grips = {hold.gripper: Grip(hold.object, hold.contact_point) for hold in observation.holds}

    @perceive.register
    def _(self, observation: KnownScene) -> None:
        self._bodies = {body.name: BodyShape(body.footprint, body.height) for body in observation.bodies}
        if self.loop:
            self.loop.told(self._bodies, {body.name: body.pose for body in observation.bodies if not body.movable})
