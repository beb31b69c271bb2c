"""A robot that finds its way among furniture, without middleware: simulator, executive and recorder in one process."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bullet_sim.client import Pose
from bullet_sim.scene import Scene
from krang_sim.messages import to_messages
from krang_sim.observations import KnownScene, Observation, Odometry
from krang_sim.robot import description_path
from krang_sim.session import KrangSession
from pbrl_bag.types import Recording
from pbrl_bringup.manipulation import Manipulation
from pbrl_bringup.paths import config_file
from pbrl_bringup.simulate import fallen_body
from pbrl_control.kinematics import RobotKinematics
from pbrl_control.loop import LoopCommand
from pbrl_control.settings import ControllerSettings, load_section
from pbrl_model.online.live import LiveRecording
from pbrl_namo.executive.executive import NamoExecutive, Order
from pbrl_namo.executive.opening_check import OpenByFreeSpace
from pbrl_namo.executive.settings import ExecutiveSettings
from pbrl_namo.executive.table import ENDED, State
from pbrl_namo.executive.thinker import ImmediateThinker
from pbrl_namo.settings import NamoSettings
from pbrl_namo.thinking import Thoughts
from pbrl_namo.warming import compile_kernels

Array = NDArray[np.float64]

LONGEST = 1200.0
"""Simulated time after which a run has failed [s]."""


@dataclass(frozen=True)
class Moment:
    """Where everything was when the executive's state changed.

    Attributes:
        time: [s].
        state: entered.
        sentence: why.
        base: (3,) truly, in `world` [m, rad].
        poses: (3,) of the furniture, truly [m, rad].
        object: being moved, or about to be; empty: none.
    """

    time: float
    state: str
    sentence: str
    base: tuple[float, ...]
    poses: Mapping[str, tuple[float, ...]]
    object: str


@dataclass(frozen=True)
class NamoOutcome:
    """What became of one run.

    Attributes:
        state: in which it ended.
        sentence: why.
        seconds: simulated [s].
        rows: counts and times of the executive's account.
        moments: its story.
        error: of the base to the goal, truly [m].
        room: corners of the floor [m].
        outlines: of the furniture in its own frames, by name [m].
        goal: (2,) [m].
    """

    state: str
    sentence: str
    seconds: float
    rows: dict[str, float]
    moments: tuple[Moment, ...]
    error: float
    room: tuple[tuple[float, ...], ...]
    outlines: dict[str, tuple[tuple[float, ...], ...]]
    goal: tuple[float, ...]

    @property
    def reached(self) -> bool:
        """Whether the goal was reached."""
        return self.state == State.DONE


class NamoRun(Manipulation):
    """One session, in which the executive has what its node has; what it thinks takes no simulated time.

    Args:
        session: of the simulator.
        goal: (3,) in `world`; a heading of NaN: any [m, rad].
        seed: of every draw of the executive's.
        executive: settings of it.
        planning: settings of the planner.

    Attributes:
        executive: that brings the robot to the goal.
        moments: the story so far.
    """

    def __init__(
        self,
        session: KrangSession,
        goal: Array,
        seed: int,
        executive: ExecutiveSettings | None = None,
        planning: NamoSettings | None = None,
    ) -> None:
        settings = load_section(config_file("params", "body_controller"), ControllerSettings, "settings")
        kinematics = RobotKinematics(description_path().read_text(encoding="utf-8"))
        self._heard = LiveRecording()
        self.executive = NamoExecutive(
            goal,
            kinematics,
            ImmediateThinker(Thoughts(self._recorded, planning)),
            opening=OpenByFreeSpace(),
            controller=settings,
            settings=executive,
            seed=seed,
        )
        self.moments: list[Moment] = []
        super().__init__(session, self.executive, settings)

    def _recorded(self, begin: float, end: float) -> Recording:
        """Return what was heard so far: earlier holds of a thing say as much of it as the last."""
        return self._heard.recording()

    def noted(self, observation: Observation) -> None:
        """Tell the executive what a percept does not hold, and keep what is learned from."""
        if isinstance(observation, KnownScene):
            fixed = {body.name: body.pose for body in observation.bodies if not body.movable}
            masses = {body.name: body.nominal_mass for body in observation.bodies}
            self.executive.told(observation.room, fixed, masses)
        elif isinstance(observation, Odometry):
            self.executive.odometry(observation.time, observation.pose)
        for topic, message in to_messages(observation):
            self._heard.add(topic, message)

    def commanded(self, command: LoopCommand) -> None:
        """Keep when the executive's state changes, and where everything is then."""
        order = command.push
        if isinstance(order, Order) and (not self.moments or self.moments[-1].state != str(order.state)):
            self.moments.append(self._moment(str(order.state), order.status))

    def _moment(self, state: str, sentence: str) -> Moment:
        world = self.session.world
        poses = {name: planar(world.pose(name)) for name in world.furniture}
        return Moment(
            self.session.time,
            state,
            sentence,
            planar(self.session.robot.base_pose()),
            poses,
            self.executive.mission.object,
        )


def planar(pose: Pose) -> tuple[float, float, float]:
    """Return (x, y, theta) of a pose in space [m, rad]."""
    return float(pose.position[0]), float(pose.position[1]), math.atan2(pose.matrix[1, 0], pose.matrix[0, 0])


def run_namo(
    scene: Scene,
    goal: Array,
    seed: int,
    executive: ExecutiveSettings | None = None,
    planning: NamoSettings | None = None,
    longest: float = LONGEST,
) -> NamoOutcome:
    """Let the robot find its way in a scene.

    Args:
        scene: with its concealed part, which reaches the simulator only.
        goal: (3,) in `world`; a heading of NaN: any [m, rad].
        seed: of world, sensors and executive.
        executive: settings of it.
        planning: settings of the planner.
        longest: simulated time after which it is given up [s].
    """
    compile_kernels()
    with KrangSession(scene, seed=seed) as session:
        run = NamoRun(session, goal, seed, executive, planning)
        while session.time < longest and run.executive.state not in ENDED:
            run.step()
        state, sentence = str(run.executive.state), run.executive.reason or run.executive.sentence
        if run.executive.state not in ENDED:
            sentence = f"not at the goal after {longest:.0f} s: {sentence}"
        fallen = fallen_body(session)
        base = np.array(planar(session.robot.base_pose()))
        return NamoOutcome(
            str(State.FAILED) if fallen else state,
            fallen or sentence,
            session.time,
            dict(run.executive.mission.account.rows()),
            tuple(run.moments),
            float(np.hypot(*(base[:2] - goal[:2]))),
            _corners(np.array(scene.room.outline)),
            {name: _corners(body.footprint) for name, body in scene.bodies.items()},
            tuple(map(float, goal[:2])),
        )


def _corners(points: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(map(float, point)) for point in points)
