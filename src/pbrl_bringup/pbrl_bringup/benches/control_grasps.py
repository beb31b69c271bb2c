"""Grasps of a table from anywhere in a room, in Bullet: driven to, closed, tested, let go; truth says who held what.

The executive gets what its node gets. Then the same with something that goes wrong on purpose: each has to end with a
failure that says why.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from bullet_sim.client import STEP
from bullet_sim.scene import Scene
from bullet_sim.settings import parse_settings
from krang_sim.observations import GraspState, KnownScene, Observation, Odometry
from krang_sim.robot import description_path
from krang_sim.session import KrangSession
from pbrl_bringup.manipulation import Manipulation
from pbrl_bringup.paths import config_file
from pbrl_control.fetching import FetchExecutive, FetchSettings, SampledGrasps
from pbrl_control.grasp_plan import GraspPlan
from pbrl_control.grasping.contacts import Hands
from pbrl_control.kinematics import SIDES, RobotKinematics
from pbrl_control.loop import LoopCommand
from pbrl_control.navigation import KRANG_STOWED, reaching_arms
from pbrl_control.percept import Grip, Percept, Tag, gripper_tag
from pbrl_control.planar import placed
from pbrl_control.push import GripperAnswer, Phase
from pbrl_control.settings import ControllerSettings, load_section

Array = NDArray[np.float64]

TABLE, OTHER = "table_a", "other"
SIZE, HEIGHT = (0.75, 1.50), 0.7775
ROOM = 3.5
"""Half a side of the room, whose middle is near the table [m]."""
AWAY = 1.5
"""Of the robot's axle from the table's border, at the start [m]."""
GAP = 0.6
"""Least between the table and the other piece of furniture [m]."""
LONGEST = 200.0
"""Simulated time after which a trial has failed [s]."""
HANDS: tuple[Hands, ...] = (("left", "right"), ("left",), ("left", "right"), ("right",))
FAULTS = (
    "behind a wall",
    "table too high",
    "gripper tags lost on the way",
    "table's tag lost on the way",
    "odometry lost on the way",
    "closes on nothing and says it holds",
    "one of two closes on nothing",
    "holds with play",
    "never closes",
    "table rolls off as it is approached",
)


@dataclass(frozen=True)
class GraspTrial:
    """What became of one grasp.

    Attributes:
        number: of the trial.
        kind: what was wrong on purpose, or how many hands were wanted and what else stood in the room.
        phase: in which it ended.
        status: a sentence.
        wanted: hands that were to hold the table.
        held: hands that truly held it while the grip was tested.
        confirmed: whether the executive was sure of the grip.
        forces: of the grip test, by hand [N].
        slips: likewise [m].
        troubles: why each way or grasp before the last one was given up.
        seconds: simulated [s].
    """

    number: int
    kind: str
    phase: str
    status: str
    wanted: tuple[str, ...]
    held: tuple[str, ...]
    confirmed: bool
    forces: dict[str, float] = field(default_factory=dict)
    slips: dict[str, float] = field(default_factory=dict)
    troubles: tuple[str, ...] = ()
    seconds: float = math.nan

    @property
    def success(self) -> bool:
        """Whether the table was truly held by the hands that were to, and the executive knew."""
        return self.phase == Phase.DONE and self.confirmed and bool(self.wanted) and self.wanted == self.held

    @property
    def detected(self) -> bool:
        """Whether a failure was known to the executive, which says why."""
        return not self.success and self.phase == Phase.FAILED and not self.confirmed and bool(self.status)


def grasp_trial(seed: int, number: int, step: float = STEP) -> GraspTrial:
    """Grasp the free table from a random pose, in half of the trials with another piece of furniture in the room.

    Args:
        seed: of all trials.
        number: of this one.
        step: of the physics [s].
    """
    rng = np.random.default_rng([seed, number])
    hands = HANDS[number % len(HANDS)]
    furnished = (number // 2) % 2 == 1
    scene = _scene(rng, furnished)
    kind = f"{len(hands)} hand{'s' if len(hands) > 1 else ''}{', furnished' if furnished else ''}"
    return _run(scene, hands, seed=int(rng.integers(2**31)), number=number, kind=kind, step=step)


def provoked_trial(seed: int, number: int, step: float = STEP) -> GraspTrial:
    """Grasp the free table while something goes wrong: the fault of that number; see `grasp_trial`."""
    rng = np.random.default_rng([seed, 5000 + number])
    fault = FAULTS[number % len(FAULTS)]
    scene = _scene(rng, False)
    if fault == "behind a wall":
        scene = _walled(scene)
    elif fault == "table too high":
        bodies = {TABLE: scene.bodies[TABLE].model_copy(update={"height": 1.0})}
        scene = scene.model_copy(update={"bodies": bodies})
    elif fault == "holds with play":
        loose = {"grasp_compliance": {TABLE: {"play": 0.05}}}
        scene = parse_settings({**scene.model_dump(exclude_unset=True), "concealed": loose}, Scene, "play")
    return _run(
        scene, ("left", "right"), seed=int(rng.integers(2**31)), number=number, kind=fault, fault=fault, step=step
    )


def _scene(rng: np.random.Generator, furnished: bool) -> Scene:
    """Draw a room: the table, the robot `AWAY` from it at any bearing and heading, perhaps one thing more."""
    table = (*rng.uniform(-0.3, 0.3, 2), rng.uniform(-math.pi, math.pi))
    outline = shapely.Polygon(placed(_box(*SIZE), np.array(table)))
    bodies: dict[str, Any] = {TABLE: _table(SIZE, 33.0, table)}
    robot, taken = _robot_pose(outline, rng)
    if furnished:
        bodies[OTHER] = _furniture(outline, taken, rng)
    corners = [[-ROOM, -ROOM], [ROOM, -ROOM], [ROOM, ROOM], [-ROOM, ROOM]]
    told = {"name": "grasp", "room": {"outline": corners}, "robot": {"pose": list(robot)}, "bodies": bodies}
    return parse_settings(told, Scene, "grasp trial")


def _walled(scene: Scene) -> Scene:
    """Return the scene with walls all round the table, a metre off."""
    x, y, _ = scene.bodies[TABLE].pose
    half, thick = 1.2, 0.05
    sides = {"east": (half, 0.0, 0.0), "west": (-half, 0.0, 0.0), "north": (0.0, half, 1.0), "south": (0.0, -half, 1.0)}
    bodies: dict[str, Any] = {TABLE: scene.bodies[TABLE].model_dump(exclude_unset=True)}
    for name, (dx, dy, turned) in sides.items():
        long = half + thick / 2 if turned else half - thick / 2
        size = (2 * long, thick) if turned else (thick, 2 * long)
        bodies[name] = {"kind": "fixture", "polygon": _box(*size).tolist(), "height": 1.0, "pose": [x + dx, y + dy, 0]}
    return parse_settings({**scene.model_dump(exclude_unset=True), "bodies": bodies}, Scene, "wall")


def _table(size: tuple[float, float], mass: float, pose: tuple[float, ...]) -> dict[str, Any]:
    return {"kind": "office_table", "size": list(size), "height": HEIGHT, "nominal_mass": mass, "pose": list(pose)}


def _robot_pose(table: shapely.Polygon, rng: np.random.Generator) -> tuple[tuple[float, float, float], shapely.Polygon]:
    """Draw where the robot stands, and what it covers with its arms ahead."""
    x, y = table.buffer(AWAY).exterior.interpolate(rng.uniform(), normalized=True).coords[0]
    pose = (float(x), float(y), rng.uniform(-math.pi, math.pi))
    parts = [shapely.Polygon(placed(shape.outline, np.array(pose))) for shape in (KRANG_STOWED, reaching_arms(0.16))]
    return pose, shapely.union_all(parts)


def _furniture(table: shapely.Polygon, robot: shapely.Polygon, rng: np.random.Generator) -> dict[str, Any]:
    """Draw another table or a pillar that leaves room around the table and touches nothing."""
    room = shapely.box(-ROOM, -ROOM, ROOM, ROOM)
    pillar = bool(rng.integers(2))
    size = (0.4, 0.4) if pillar else (0.80, 1.60)
    while True:
        pose = (*rng.uniform(-ROOM, ROOM, 2), rng.uniform(-math.pi, math.pi))
        place = shapely.Polygon(placed(_box(*size), np.array(pose)))
        if room.contains(place) and place.distance(table) >= GAP and place.distance(robot) >= 0.15:
            break
    if pillar:
        return {"kind": "fixture", "polygon": _box(*size).tolist(), "height": 1.2, "pose": list(pose)}
    return _table(size, 36.0, pose)


def _box(x: float, y: float) -> Array:
    return 0.5 * np.array([[-x, -y], [x, -y], [x, y], [-x, y]])


class _Fetching(Manipulation):
    """A fetch, of which is kept who truly held the table; and what goes wrong on purpose.

    Attributes:
        fetch: the executive.
        held: hands that truly held the table all the time that the grip was tested last.
    """

    def __init__(self, session: KrangSession, hands: Hands, seed: int, fault: str) -> None:
        settings = load_section(config_file("params", "body_controller"), ControllerSettings, "settings")
        grips = tuple({"gripper": side, "point": (0.0, 0.0)} for side in hands)
        plan = GraspPlan.model_validate({"name": "fetch", "object": TABLE, "grips": grips})
        kinematics = RobotKinematics(description_path().read_text(encoding="utf-8"))
        choice = SampledGrasps(hands=(hands,))
        own = FetchSettings(attempts=1) if fault else FetchSettings()  # what is broken stays broken
        self.fetch = FetchExecutive(plan, kinematics, settings, own, choice=choice, seed=seed)
        super().__init__(session, self.fetch, settings)
        self.held: tuple[str, ...] = ()
        self._fault = fault
        self._truly: tuple[str, ...] = ()
        self._frozen: dict[str, Tag] = {}
        self._claimed: dict[str, Grip] = {}
        self._phase_before = ""

    def noted(self, observation: Observation) -> None:
        """Tell the executive what a percept does not hold, and keep who holds what."""
        if isinstance(observation, KnownScene):
            fixed = {body.name: body.pose for body in observation.bodies if not body.movable}
            self.fetch.told(observation.room, fixed)
        elif isinstance(observation, Odometry):
            if not (self._fault == "odometry lost on the way" and self.phase == Phase.DRIVE):
                self.fetch.odometry(observation.time, observation.pose)
        elif isinstance(observation, GraspState):
            self._truly = tuple(hold.gripper for hold in observation.holds if hold.object == TABLE)

    def percept(self) -> Percept:
        """Return what is perceived, less what is lost, with what is claimed."""
        seen = super().percept()
        lost = {
            "gripper tags lost on the way": tuple(gripper_tag(side) for side in SIDES),
            "table's tag lost on the way": (TABLE,),
        }.get(self._fault, ())
        if lost and self.phase != Phase.DRIVE and not self._frozen:
            return seen
        self._frozen = self._frozen or {name: seen.tags[name] for name in lost}
        return replace(seen, tags={**seen.tags, **self._frozen}, grips={**seen.grips, **self._claimed})

    def obey(self, command: LoopCommand) -> None:
        """Obey, but for grippers that are broken."""
        broken = {
            "never closes": SIDES,
            "closes on nothing and says it holds": SIDES,
            "one of two closes on nothing": ("right",),
        }.get(self._fault, ())
        requests = tuple(each for each in command.push.requests if each.side not in broken)
        for request in command.push.requests:
            if request.side in broken:
                says_so = self._fault != "never closes"
                self.fetch.answer(GripperAnswer(request.action, request.side, says_so, "the plates do not move", 0.0))
                if says_so and request.action == "grasp" and self.fetch.candidate is not None:
                    contact = self.fetch.candidate.contacts[request.side]
                    self._claimed[request.side] = Grip(TABLE, np.asarray(contact))
                elif request.action == "release":
                    self._claimed.pop(request.side, None)
        super().obey(replace(command, push=replace(command.push, requests=requests)))
        self.last = command.push

    def commanded(self, command: LoopCommand) -> None:
        """Keep who holds the table while the grip is tested; push it away where that is what goes wrong."""
        phase = str(command.push.phase)
        if phase != self._phase_before:
            if phase == Phase.PUSH:
                self.held = self._truly
            self._phase_before = phase
        if phase == Phase.PUSH:
            self.held = tuple(side for side in self.held if side in self._truly)

    def disturb(self) -> None:
        """Do to the world what goes wrong: somebody pulls the table away."""
        if self._fault == "table rolls off as it is approached" and self.phase == Phase.APPROACH:
            table = self.session.world.furniture[TABLE]
            place = table.pose().position
            away = place[:2] - self.session.robot.base_pose().position[:2]
            away /= np.hypot(*away)
            table.apply_force(30.0 * np.array([away[0], away[1], 0.0]), place - np.array([0.0, 0.0, 0.1]))


def _run(scene: Scene, hands: Hands, *, seed: int, number: int, kind: str, step: float, fault: str = "") -> GraspTrial:
    with KrangSession(scene, seed=seed, step=step) as session:
        trial = _Fetching(session, hands, seed, fault)
        while session.time < LONGEST and (trial.last is None or not trial.last.finished):
            trial.disturb()
            trial.step()
        return _judged(trial, hands, number, kind)


def _judged(trial: _Fetching, hands: Hands, number: int, kind: str) -> GraspTrial:
    fetch, last = trial.fetch, trial.last
    readings = fetch.readings
    return GraspTrial(
        number,
        kind,
        trial.phase,
        "" if last is None else last.status,
        hands,
        trial.held,
        fetch.confirmed,
        {side: reading.force for side, reading in readings.items()},
        {side: reading.slip for side, reading in readings.items()},
        tuple(fetch.troubles),
        trial.session.time,
    )
