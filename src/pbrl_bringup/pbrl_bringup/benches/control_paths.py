"""Object paths in Bullet: a table is grasped, moved along a trajectory and let go; truth says where it ended.

The controller gets what its node gets. What is known of the table is told where a row says so (mass, the friction of
its casters, which one is locked); nothing else of the scene's concealed part is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bullet_sim.scene import Scene, load_scene
from krang_sim.observations import Observation, WristReading
from krang_sim.session import KrangSession
from pbrl_bringup.manipulation import Manipulation
from pbrl_bringup.paths import config_file
from pbrl_control.admittance import WrenchBias
from pbrl_control.constraints.object_model import ObjectModel, SwivelCasters
from pbrl_control.kinematics import SIDES
from pbrl_control.planar import compose, inverse, wrap
from pbrl_control.push import Phase
from pbrl_control.settings import ControllerSettings, load_section
from pbrl_control.trajectories.course import TrajectoryCourse
from pbrl_control.trajectories.trajectory_plan import TrajectoryPlan
from pbrl_model.parameters import BodyParameters

Array = NDArray[np.float64]

TABLE = "table_a"
SIZE, MASS = (0.75, 1.50), 33.0
ROLLING, LOCKED = 0.02, 0.175
"""Friction of four casters that roll, and of one of four that is locked: its quarter of the load on rubber."""
CASTER = (-0.315, -0.69)
"""Of the locked one, in the table's frame [m]."""
CORNERS = ((0.315, 0.69), (0.315, -0.69), (-0.315, 0.69), CASTER)
SWING = 0.07
"""Force over load that swings a caster of the table's make round: its bearing's 0.04 N m and 0.7 * 2 mm of its load of
scrub, over its trail of 28 mm; and rolling resistance at right angles to that."""
APART = 0.25
"""Of each grip from the middle of the edge [m]: casters that swing round resist a turn by some 15 N m."""
HALL = ((-4.0, -4.0), (6.0, -4.0), (6.0, 4.0), (-4.0, 4.0))
"""Walls [m]: the robot backs by a metre and more."""
LONGEST = 150.0
"""Simulated time after which a trial has failed [s]."""
KINDS = ("straight", "arc", "in place", "sideways")


@dataclass(frozen=True)
class PathTrial:
    """What became of one path.

    Attributes:
        kind: of the path.
        phase: in which the manipulation ended.
        status: a sentence.
        error: from where the trajectory was to end to the table's true pose [m].
        yaw_error: [rad].
        force: largest horizontal force at a grip while it was moved, a tenth of a second's mean, bias removed [N].
        expected: largest that the model expects [N]; NaN without a model.
        seconds: simulated, of the motion [s].
    """

    kind: str
    phase: str
    status: str
    error: float
    yaw_error: float
    force: float
    expected: float
    seconds: float


def free_path(seed: int, number: int) -> PathTrial:
    """Move the free table along a random path of one of four kinds, both arms on it, its model known."""
    rng = np.random.default_rng([seed, number])
    kind = KINDS[number % len(KINDS)]
    sign = float(rng.choice([-1.0, 1.0]))
    if kind == "straight":
        ways = [[sign * rng.uniform(0.4, 1.0), 0.0, 0.0]]
    elif kind == "arc":
        turned, radius = sign * math.radians(rng.uniform(15.0, 35.0)), rng.uniform(1.0, 2.0)
        ways = [[radius * math.sin(abs(turned)), math.copysign(radius * (1.0 - math.cos(turned)), turned), turned]]
    elif kind == "in place":
        ways = [[0.0, 0.0, sign * math.radians(rng.uniform(10.0, 30.0))]]
    else:
        ways = [[0.0, sign * rng.uniform(0.15, 0.4), 0.0]]
    grips: list[dict[str, Any]] = [
        {"gripper": "left", "point": [-0.375, APART]},
        {"gripper": "right", "point": [-0.375, -APART]},
    ]
    plan = _plan(kind, grips, waypoints=ways)
    model = _model(BodyParameters(mass=MASS, mu_ground=ROLLING), CORNERS)
    return _run("free_table", plan, model, seed=int(rng.integers(2**31)), kind=kind)


def locked_path(seed: int, number: int) -> PathTrial:
    """Move the table with a locked caster along a random path, its model known: what it cannot do is not tried."""
    rng = np.random.default_rng([seed, 1000 + number])
    turned = math.radians(rng.uniform(15.0, 35.0))
    wanted = [[rng.uniform(0.2, 0.6), rng.uniform(-0.1, 0.1), -turned * rng.uniform(0.5, 1.0)]]
    plan = _plan("locked caster", [{"gripper": "left", "point": [-0.375, rng.uniform(0.2, 0.5)]}], waypoints=wanted)
    wheel = {"wheel_x": CASTER[0], "wheel_y": CASTER[1], "mu_x": LOCKED, "mu_y": LOCKED}
    swivels = [corner for corner in CORNERS if corner != CASTER]
    model = _model(BodyParameters(mass=MASS, mu_ground=ROLLING, **wheel), swivels)
    return _run("locked_caster", plan, model, seed=int(rng.integers(2**31)), kind="locked caster")


def _plan(name: str, grips: list[dict[str, Any]], **more: object) -> TrajectoryPlan:
    return TrajectoryPlan.model_validate({"name": name, "object": TABLE, "grips": grips, **more})


def _model(parameters: BodyParameters, swivels: Sequence[tuple[float, float]]) -> ObjectModel:
    x, y = 0.5 * SIZE[0], 0.5 * SIZE[1]
    casters = SwivelCasters(np.array(swivels), SWING, 1.0 / len(CORNERS))
    return ObjectModel.uniform(parameters, np.array([[-x, -y], [x, -y], [x, y], [-x, y]]), casters)


class _Watched(Manipulation):
    """A manipulation of which the forces at the grips and the true end are kept."""

    def __init__(self, session: KrangSession, plan: TrajectoryPlan, course: TrajectoryCourse) -> None:
        settings = load_section(config_file("params", "body_controller"), ControllerSettings, "settings")
        super().__init__(session, plan, settings, course)
        self.force, self.began = 0.0, math.nan
        self._bias = {side: WrenchBias(0.3) for side in SIDES}
        self._smooth = dict.fromkeys(SIDES, 0.0)
        self._heard: dict[str, float] = {}

    def noted(self, observation: Observation) -> None:
        """Keep the largest force, smoothed over a tenth of a second."""
        if not isinstance(observation, WristReading):
            return
        raw = np.concatenate([observation.force, observation.torque])
        dt = self.session.time - self._heard.get(observation.side, self.session.time)
        self._heard[observation.side] = self.session.time
        if self.phase not in (Phase.SETTLE, Phase.PUSH, Phase.RELEASE):
            self._bias[observation.side].update(raw, max(dt, 1e-3))
            return
        if self.phase != Phase.PUSH:
            return
        self.began = self.session.time if math.isnan(self.began) else self.began
        felt = float(np.hypot(*self._bias[observation.side].remove(raw)[:2]))
        self._smooth[observation.side] += (1.0 - math.exp(-dt / 0.1)) * (felt - self._smooth[observation.side])
        self.force = max(self.force, self._smooth[observation.side])


def _in_a_hall(scene: Scene, plan: TrajectoryPlan) -> Scene:
    """Return a scene without near walls, and the robot square before its grips, as one that drove there would be."""
    x, y, yaw = scene.robot.pose
    if len(plan.grips) > 1:
        y = scene.bodies[TABLE].pose[1] + float(np.mean([grip.point[1] for grip in plan.grips]))
    robot = scene.robot.model_copy(update={"pose": (x, y, yaw)})
    return scene.model_copy(update={"robot": robot, "room": scene.room.model_copy(update={"outline": HALL})})


def _run(scene_name: str, plan: TrajectoryPlan, model: ObjectModel, *, seed: int, kind: str) -> PathTrial:
    scene = _in_a_hall(load_scene(config_file("scenes", scene_name)), plan)
    course = TrajectoryCourse(plan, model)
    with KrangSession(scene, seed=seed) as session:
        trial = _Watched(session, plan, course)
        while session.time < LONGEST and (trial.last is None or not trial.last.finished):
            trial.step()
        end = np.asarray(session.truth(TABLE).planar)
        last = trial.last
    follower = course.follower
    if follower is None or last is None:
        return PathTrial(kind, trial.phase, last.status if last else "", *[math.nan] * 5)
    goal = follower.trajectory.at(follower.trajectory.duration + 1.0).pose
    off = compose(inverse(goal), end)
    expected = math.nan if follower.expected_force is None else follower.expected_force
    seconds = session.time - trial.began
    error, yaw_error = float(np.hypot(*off[:2])), abs(wrap(float(off[2])))
    return PathTrial(kind, str(last.phase), last.status, error, yaw_error, trial.force, expected, seconds)
