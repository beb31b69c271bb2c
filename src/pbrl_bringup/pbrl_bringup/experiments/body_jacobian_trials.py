"""One manipulation in Bullet through the real controller, and what is kept of it: truth, grip wrenches, workspace.

The controller gets what its node gets: tags, wrist sensors, joint states. True poses are kept for scoring and drawing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bullet_sim.scene import Scene, load_scene
from krang_sim.observations import Observation, WristReading
from krang_sim.session import KrangSession
from pbrl_bringup.benches.control_laws import robot
from pbrl_bringup.experiments.body_jacobian_scenes import in_a_hall
from pbrl_bringup.experiments.robot_fits_trials import holding_casters
from pbrl_bringup.manipulation import Manipulation
from pbrl_bringup.paths import config_file
from pbrl_control.admittance import WrenchBias, grip_wrench
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.controller import BodyController
from pbrl_control.kinematics import SIDES, GripperState, RobotKinematics
from pbrl_control.loop import LoopCommand
from pbrl_control.planar import compose, inverse, turn, wrap
from pbrl_control.push import Phase
from pbrl_control.settings import ControllerSettings, ProgramSettings
from pbrl_control.trajectories.course import TrajectoryCourse
from pbrl_control.trajectories.trajectory_plan import AbortLimits, TrajectoryPlan
from pbrl_control.types import BodyCommand, BodyState, Holds, Twists, Wrenches

Array = NDArray[np.float64]

LONGEST = 90.0
"""Simulated time after which a trial is ended [s]."""
SMOOTHING = 0.1
"""Over which forces at a grip are averaged [s]."""
EVERY = 5
"""Control ticks from one kept row to the next."""
UNSTOPPED = {"force": 1e4, "force_floor": 1e4}
"""Abort limits of a trial that shows how far forces go, where the robot would have stopped [N]."""
STATIONS = 100
"""Poses that are kept of the path that is followed."""


@dataclass(frozen=True)
class Job:
    """What is tried.

    Attributes:
        name: of the way.
        scene: of the simulator.
        plan: what to grasp and along which path to move it.
        model: what is believed of the object; None: nothing.
        method: of the whole-body controller.
        steering: of the base.
        seed: of world and sensors.
    """

    name: str
    scene: str
    plan: TrajectoryPlan
    model: ObjectModel | None
    method: str = "program"
    steering: str = "predictive"
    seed: int = 0


@dataclass(frozen=True)
class Held:
    """What became of an object while it was held, a row each moment; n rows, two grippers, left first.

    Attributes:
        job: what was tried.
        phase: in which it ended.
        status: a sentence.
        time: (n,) since it set out [s].
        object: (n, 3) true poses in `world` [m, rad].
        base: (n, 3) likewise.
        plates: (n, 2, 3) the middle of each gripper's plates in `base` [m, rad].
        wrench: (n, 2, 3) that each grip exerts on the object: fx, fy [N], tau [N m] at the plates, object axes.
        expected: (n, 2) horizontal force that the model expects of each grip [N]; NaN without a model.
        margin: (n,) how far the worse gripper is inside of its workspace [m].
        path: (k, 3) poses that are followed, from start to foreseen end; (0, 3) if it never set out.
        wanted: (3,) last pose that was asked for.
        progress: share of the path's time that was done.
        peak: largest force at a grip that the model expects [N]; NaN without a model.
        outline: (c, 2) of the object in its frame [m].
        holding: (w, 2) wheels that are locked or do not swivel, in the object's frame [m].
    """

    job: Job
    phase: str
    status: str
    time: Array
    object: Array
    base: Array
    plates: Array
    wrench: Array
    expected: Array
    margin: Array
    path: Array
    wanted: Array
    progress: float
    peak: float
    outline: Array
    holding: Array

    @property
    def force(self) -> Array:
        """Horizontal force at each grip (n, 2) [N]."""
        return np.hypot(self.wrench[..., 0], self.wrench[..., 1])

    @property
    def limit(self) -> float:
        """Force at a grip at which the controller ends a trajectory unless it is told otherwise [N]."""
        limits = AbortLimits()
        return max(limits.force_ratio * self.peak, limits.force_floor) if self.peak == self.peak else limits.force

    @property
    def stopped(self) -> float:
        """Time at which the force would have ended it [s]; NaN: never."""
        return first_longer(self.time, self.force.max(axis=1) > self.limit, AbortLimits().force_time)

    def off(self, goal: Array) -> tuple[float, float]:
        """Return the distance [m] and turn [rad] from a pose (3,) to where the object ended."""
        if not len(self.object):
            return math.nan, math.nan
        way = compose(inverse(goal), self.object[-1])
        return float(np.hypot(*way[:2])), abs(wrap(float(way[2])))


def largest(held: Held) -> float:
    """Return the largest horizontal force at a grip [N]; NaN where it never set out."""
    return float(held.force.max()) if len(held.time) else math.nan


def least(held: Held) -> float:
    """Return the least workspace margin [m]; NaN where it never set out."""
    return float(held.margin.min()) if len(held.margin) else math.nan


def first_longer(time: Array, true: NDArray[np.bool_], least: float) -> float:
    """Return the first moment at which something (n,) has been true for `least` [s]; NaN: never.

    Args:
        time: (n,) [s], ascending.
        true: (n,).
        least: [s].
    """
    since = math.nan
    for now, holds in zip(time.tolist(), true.tolist(), strict=True):
        since = math.nan if not holds else since if since == since else now
        if now - since >= least:
            return float(now)
    return math.nan


def workspace_margin(planar: Array, program: ProgramSettings) -> Array:
    """Return how far both plates are inside of their workspace (...) [m]; negative outside.

    Args:
        planar: (..., 2, 3) of left and right plates in `base` [m, rad].
        program: with the workspace's borders.
    """
    x, y = planar[..., 0], planar[..., 1] * np.array([1.0, -1.0])
    (back, front), (inner, outer) = program.reach_x, program.reach_y
    sides = np.stack([x - back, front - x, y - inner, outer - y])
    return sides.min(axis=(0, -1))


def run(job: Job) -> Held:
    """Grasp as ever, move along the path in the way that is tried, let go."""
    scene = in_a_hall(load_scene(config_file("scenes", job.scene)), job.plan)
    kinematics, settings = robot()
    base = settings.base.model_copy(update={"steering": job.steering})
    own = settings.model_copy(update={"method": job.method, "base": base})
    course = TrajectoryCourse(job.plan, job.model)
    with KrangSession(scene, seed=job.seed) as session:
        watched = _Watched(session, job.plan, course, _AsTried(kinematics, settings, own))
        while session.time < LONGEST and not (watched.last and watched.last.finished):
            watched.step()
        return watched.held(job, scene)


class _AsTried(BodyController):
    """Comes near and grasps as installed, so that all trials begin alike; moves what is held in the way that is tried.

    Args:
        kinematics: of the robot.
        settings: as installed.
        own: of the way that is tried.
    """

    def __init__(self, kinematics: RobotKinematics, settings: ControllerSettings, own: ControllerSettings) -> None:
        super().__init__(kinematics, settings)
        self._own = BodyController(kinematics, own)
        self._moving = False

    def tick(self, state: BodyState, object_twist: Twists, grasps: Holds, wrenches: Wrenches, dt: float) -> BodyCommand:
        """See `BodyController.tick`; both learn the sensors' biases until something held is moved."""
        tried = self._own.tick(state, object_twist, grasps, wrenches, dt)
        self._moving = self._moving or (bool(grasps) and any(twist.moves() for twist in object_twist.values()))
        if not self._moving:
            return super().tick(state, object_twist, grasps, wrenches, dt)
        self.share = self._own.share
        return tried


class _Watched(Manipulation):
    """A manipulation of which rows are kept while the object is moved."""

    def __init__(
        self, session: KrangSession, plan: TrajectoryPlan, course: TrajectoryCourse, controller: BodyController
    ) -> None:
        settings = controller.settings
        super().__init__(session, plan, settings, course)
        self._course_of = course
        self._controller = controller
        self._program = settings.program
        self._kinematics, _ = robot()
        self._bias = {side: WrenchBias(settings.compliance.bias_time) for side in SIDES}
        self._raw: dict[str, Array] = {}
        self._smooth = np.zeros((2, 3))
        self._rows: list[tuple[Array, ...]] = []
        self._ticks, self._before = 0, math.nan
        self._wanted = np.full(3, math.nan)

    def noted(self, observation: Observation) -> None:
        """Learn the sensors' biases until a grip closes; keep the latest sample."""
        if self.loop is not None:
            self.loop.controller = self._controller
        if not isinstance(observation, WristReading):
            return
        raw = np.concatenate([observation.force, observation.torque])
        self._raw[observation.side] = raw
        if self.phase not in (Phase.SETTLE, Phase.PUSH, Phase.RELEASE):
            self._bias[observation.side].update(raw, 0.01)

    def commanded(self, command: LoopCommand) -> None:
        """Keep a row now and then while the object is moved."""
        follower, now = self._course_of.follower, self.session.time
        if command.push.phase != Phase.PUSH or follower is None:
            return
        if math.isnan(self._before):
            self._before = now
            self._wanted = self._plan_end(follower.trajectory.at(0.0).pose)
        posture = self.percept().posture
        assert posture is not None
        grippers = self._kinematics.grippers(posture)
        body, base = np.asarray(self.session.truth(self.plan.object).planar), self._base()
        self._smooth += (1.0 - math.exp(-(now - self._before) / SMOOTHING)) * (
            np.array([self._on_object(side, grippers[side], base, body) for side in SIDES]) - self._smooth
        )
        self._before = now
        self._ticks += 1
        if self._ticks % EVERY != 1:
            return
        wrenches = follower.expected_wrenches()
        expected = [float(np.hypot(*wrenches[side][:2])) if side in wrenches else math.nan for side in SIDES]
        plates = np.array([grippers[side].planar for side in SIDES])
        self._rows.append((np.array([now]), body, base, plates, self._smooth.copy(), np.array(expected)))

    def _base(self) -> Array:
        pose = self.session.robot.base_pose()
        return np.array([pose.position[0], pose.position[1], pose.yaw])

    def _plan_end(self, start: Array) -> Array:
        assert isinstance(self.plan, TrajectoryPlan)
        return self.plan.trajectory(start).end

    def _on_object(self, side: str, gripper: GripperState, base: Array, body: Array) -> Array:
        """Return the wrench (3,) that a grip exerts on the object, at the plates, object axes."""
        if side not in self._raw or side not in self.percept().grips:
            return np.zeros(3)
        felt = grip_wrench(side, gripper, self._bias[side].remove(self._raw[side]))
        return turn(-felt[:3], float(gripper.planar[2] + base[2] - body[2]))

    def held(self, job: Job, scene: Scene) -> Held:
        """Return what was kept."""
        name = self.plan.object
        follower, last = self._course_of.follower, self.last
        shapes = ((1,), (3,), (3,), (2, 3), (2, 3), (2,))
        columns = [np.array([row[k] for row in self._rows]).reshape(-1, *shape) for k, shape in enumerate(shapes)]
        time, body, base, plates, wrench, expected = columns
        path, progress, peak = np.zeros((0, 3)), 0.0, math.nan
        if follower is not None:
            stations = np.linspace(0.0, follower.trajectory.duration, STATIONS)
            path = np.array([follower.trajectory.at(float(station)).pose for station in stations])
            progress = follower.progress
            peak = math.nan if follower.expected_force is None else follower.expected_force
        return Held(
            job,
            self.phase,
            last.status if last else "",
            time[:, 0] - (time[0, 0] if len(time) else 0.0),
            body,
            base,
            plates,
            wrench,
            expected,
            workspace_margin(plates, self._program),
            path,
            self._wanted,
            progress,
            peak,
            np.asarray(scene.bodies[name].footprint),
            holding_casters(scene, name)[0],
        )
