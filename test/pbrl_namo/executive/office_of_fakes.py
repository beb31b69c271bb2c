"""Two rooms, two doors, a table before each; tables that come along or are stuck; a planner that knows three tricks.

The world is that of `room_of_fakes`, with more than one thing in it. Laws that hold at every tick are asserted here:
every story is a test of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from room_of_fakes import NOMINAL, STOWED, World

from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.fetching import FetchSettings, GripTestSettings
from pbrl_control.grasping import GraspSettings
from pbrl_control.kinematics import SIDES, Posture, RobotKinematics
from pbrl_control.navigation import TrackerSettings
from pbrl_control.percept import BodyShape, Grip, Percept, Tag
from pbrl_control.planar import compose, inverse, turn
from pbrl_control.push import GripperAnswer, GripperRequest, Phase
from pbrl_control.settings import BaseSettings, ControllerSettings
from pbrl_control.trajectories.trajectory import MotionLimits
from pbrl_model.parameters import BodyParameters
from pbrl_namo.executive import (
    Answer,
    ExecutiveSettings,
    GraspJob,
    ImmediateThinker,
    Job,
    LearnAnswer,
    LearnJob,
    Lost,
    MismatchAnswer,
    MismatchJob,
    Move,
    NamoExecutive,
    OpenByFreeSpace,
    Order,
    PlanAnswer,
    PlanJob,
    State,
)
from pbrl_namo.executive.settings import JobSettings, ReleaseSettings
from pbrl_namo.executive.table import ENDED, MOVING
from pbrl_namo.executive.view import RoomView
from pbrl_namo.executive.ways import find_grasp, find_way
from pbrl_namo.regions import free_space, region_of

DT = 0.06
TABLE = BodyShape(np.array([[-0.375, -0.75], [0.375, -0.75], [0.375, 0.75], [-0.375, 0.75]]), 0.7775)
ROOM = np.array([[-4.0, -3.0], [3.0, -3.0], [3.0, 3.0], [-4.0, 3.0]])
START, GOAL = np.array([-2.6, 0.0, 0.0]), np.array([2.0, 0.0, math.nan])
RADIUS = 0.75  # [m] of what drives: room to turn anywhere on the way
STIFFNESS = 2000.0  # [N/m] of a grip on something that is stuck
LAX = TrackerSettings(reached=0.02, aligned=0.02, position_tolerance=0.05, yaw_tolerance=0.05)
SETTINGS = ExecutiveSettings(
    fetch=FetchSettings(
        attempts=1,
        look=0.1,
        grasps=GraspSettings(samples=8, wanted=2, time_limit=2.0, dead_ends=2),
        grip_test=GripTestSettings(still=0.36, duration=0.6),
        tracker=LAX,
    ),
    tracker=LAX,
    motion=MotionLimits(speed=0.4, acceleration=0.5, yaw_rate=0.5, yaw_acceleration=0.5),
    jobs=JobSettings(tries=3, wait=0.5, plan=2.0, grasp=2.0, learn=2.0, mismatch=2.0),
    release=ReleaseSettings(settle=0.2, timeout=2.0, again=0.5),
    look=0.2,
    look_timeout=3.0,
    patience=1.5,
    pause_timeout=5.0,
)
CONTROLLER = ControllerSettings(base=BaseSettings(speed=1.0, yaw_rate=2.0, acceleration=2.0, yaw_acceleration=6.0))
WALLS = {
    "wall_middle": (np.array([[-0.05, -0.5], [0.05, -0.5], [0.05, 0.5], [-0.05, 0.5]]), np.array([1.0, 0.0, 0.0])),
    "wall_north": (np.array([[-0.05, -0.2], [0.05, -0.2], [0.05, 0.2], [-0.05, 0.2]]), np.array([1.0, 2.8, 0.0])),
    "wall_south": (np.array([[-0.05, -0.2], [0.05, -0.2], [0.05, 0.2], [-0.05, 0.2]]), np.array([1.0, -2.8, 0.0])),
}


def light(mass: float = 30.0) -> ObjectModel:
    return ObjectModel.uniform(BodyParameters(mass=mass, mu_ground=0.02), TABLE.footprint)


@dataclass
class Office(World):
    """What is true.

    Attributes:
        things: (3,) pose of each table.
        pinned: tables that do not move.
        stiffness: [N/m] of a grip on something that is pinned.
        strongest: [N] that such a grip feels at most.
        slides: whether it slides along the edge at that force.
        closes: whether grippers do.
        opens: likewise.
    """

    things: dict[str, np.ndarray] = field(default_factory=dict)
    pinned: set[str] = field(default_factory=set)
    stiffness: float = STIFFNESS
    strongest: float = math.inf
    slides: bool = False
    closes: bool = True
    opens: bool = True
    strain: dict[str, np.ndarray] = field(default_factory=dict)
    states: list[State] = field(default_factory=list)
    now: float = 0.0
    order: Order | None = None

    def percept(self) -> Percept:
        posture = Posture(self.waist, 0.0, self.joints.copy(), -self.joints)
        tags = {
            name: tag(self.time, np.array([*pose[:2], self.bodies[name].height]), pose[2])
            for name, pose in self.things.items()
        }
        wrenches = {}
        for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
            tags[f"{side}_gripper"] = self._hand_tag(side, sign, posture)
            wrenches[side] = np.array([0.0, sign * self.forces.get(side, 0.0), 0.0, 0.0, 0.0, 0.0])
        return self.tamper(self, Percept(posture, tags, wrenches, dict(self.grips), self.bodies))

    def tick(self, executive: NamoExecutive) -> Order:
        """One tick of both, and the laws."""
        if self.odometry:
            executive.odometry(self.time, self.base.copy())
        percept, before = self.percept(), executive.state
        order = self.order = executive.tick(self.time, percept)
        check_laws(before, order, percept)
        if not self.states or self.states[-1] != order.state:
            self.states.append(order.state)
        if order.state not in ENDED:
            self.obey(order, executive)
        self.time += DT
        self.happens(self)
        return order

    def run(self, executive: NamoExecutive, to: State | None = None, until: float = 300.0) -> Order:
        """Go on until it has ended, or until a state is entered; longer than a time [s] is too long."""
        while self.time < until:
            before = executive.state
            order = self.tick(executive)
            if order.finished or (order.state == to and order.state != before):
                return order
        raise AssertionError(f"not over after {until} s: {order.state}: {order.status}")

    def obey(self, order: Order, executive: NamoExecutive) -> None:
        self.forces = {}
        lowered = order.phase in (Phase.APPROACH, Phase.GRASP, Phase.SETTLE, Phase.PUSH, Phase.RELEASE)
        backing = order.phase == Phase.RETREAT and "base" not in order.twists
        if self.grips or lowered or backing:
            self._move_hands(order)
        elif "base" in order.twists:
            self._drive(order)
        elif order.phase == Phase.STOW and self.arms_move:
            self.hands = {}
            self.joints += np.clip(STOWED - self.joints, -1.0 * DT, 1.0 * DT)
        for request in order.requests:
            executive.answer(self._carry_out(request))

    def _drive(self, order: Order) -> None:
        twist = order.twists["base"]
        assert twist.vy == 0.0
        if twist.moves() and not self.grips:
            self.hands = {}
        self._go(DT * turn(twist.array(), self.base[2] + 0.5 * DT * twist.omega))

    def _move_hands(self, order: Order) -> None:
        if not self.hands:
            self.joints = NOMINAL.copy()
        for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
            home = compose(self.base, np.array([0.74, sign * 0.16, 0.0]))
            self.hands.setdefault(side, np.array([*home, 0.9]))
            own, hand = order.twists.get(f"{side}_ft"), self.hands[side]
            if own is not None and side not in self.grips:
                hand[:3] += DT * turn(own.array(), hand[2])
                hand[3] += DT * own.vz
        for name in {grip.object for grip in self.grips.values()}:
            twist = order.twists.get(name)
            if twist is not None and twist.moves():
                self._move_held(name, twist.array())

    def _move_held(self, name: str, twist: np.ndarray) -> None:
        old = self.things[name].copy()
        step = DT * turn(twist, old[2])
        moved = compose(old, inverse(old))
        if name not in self.pinned:
            self.things[name] = old + step
            moved = compose(self.things[name], inverse(old))
            self.base = compose(moved, self.base)
        for side, grip in self.grips.items():
            if grip.object != name:
                continue
            hand = self.hands[side]
            inward = np.array([math.cos(hand[2]), math.sin(hand[2])])
            if name in self.pinned:
                self.strain[side] = self.strain.get(side, np.zeros(2)) + step[:2]
                force = self.stiffness * float(self.strain[side] @ inward)
                self.forces[side] = -min(max(force, -self.strongest), self.strongest)
                if self.slides and abs(force) >= self.strongest:
                    hand[:2] += step[:2]
            else:
                hand[:3] = compose(moved, hand[:3])
                self.forces[side] = -math.copysign(self.friction, float(step[:2] @ inward))

    def _carry_out(self, request: GripperRequest) -> GripperAnswer:
        action, side = request.action, request.side
        if action == "release":
            if self.opens:
                self.grips.pop(side, None)
            return GripperAnswer(action, side, self.opens, "" if self.opens else "its plates\ndo not move")
        if self.refuses or not self.closes:
            return GripperAnswer(action, side, False, self.refuses or "nothing between the plates", 0.034)
        self.strain.pop(side, None)
        place = compose(inverse(self.things[request.object]), self.hands[side][:3])
        self.grips[side] = Grip(request.object, place[:2])
        return GripperAnswer(action, side, True)


def check_laws(before: State, order: Order, percept: Percept) -> None:
    moving = {name for name, twist in order.twists.items() if twist.moves()}
    assert "\n" not in order.status
    assert order.status
    assert all(twist.finite() for twist in order.twists.values())
    assert order.state in MOVING or not moving, f"{order.state} moves {moving}"
    assert order.state == before or not moving, f"{before} to {order.state} moves {moving}"
    assert not (percept.grips and "base" in moving), f"{order.state} drives with {percept.grips}"
    assert order.state in MOVING or not order.requests
    if order.state in ENDED:
        assert not order.twists
        assert order.finished


def office(kinematics: RobotKinematics, **more: object) -> Office:
    things = {"table_a": np.array([0.3, 1.55, 0.0]), "table_b": np.array([0.3, -1.55, 0.0])}
    bodies = dict.fromkeys(things, TABLE) | {name: BodyShape(outline, 2.0) for name, (outline, _) in WALLS.items()}
    world = Office(kinematics, START.copy(), joints=STOWED.copy(), things=things, bodies=bodies)
    world.fixed = {name: pose for name, (_, pose) in WALLS.items()}
    return replace(world, **more)  # type: ignore[arg-type]


@dataclass
class Brain:
    """Answers jobs: a planner that pulls the first table that it does not believe to be stuck, a learner that is right.

    Attributes:
        world: that the learner looks into.
        jobs: everything that was asked.
        order: of tables to be tried.
        explains: whether the learner is content with what it learned.
        ignorant: whether nothing is ever learned or diagnosed.
        lost: how often each kind of job finds nobody at home.
        moves: changes a move before it is told.
        silent: kinds of jobs that are thought about for ever.
    """

    world: Office
    jobs: list[Job] = field(default_factory=list)
    order: tuple[str, ...] = ("table_a", "table_b")
    explains: bool = True
    ignorant: bool = False
    lost: dict[type, int] = field(default_factory=dict)
    moves: Callable[[Move], Move] = lambda move: move
    silent: tuple[type, ...] = ()
    found: Answer | None = None

    def __call__(self, job: Job) -> Answer:
        self.jobs.append(job)
        if self.lost.get(type(job), 0) > 0:
            self.lost[type(job)] -= 1
            return Lost("nobody at home")
        if isinstance(job, PlanJob):
            return self.plan(job)
        if isinstance(job, GraspJob):
            return find_grasp(job, SETTINGS.fetch.grasps)
        if isinstance(job, MismatchJob):
            return MismatchAnswer(None if self.ignorant else "static", "a detent")
        assert isinstance(job, LearnJob)
        assert job.end > job.begin
        if self.ignorant and self.explains:
            return LearnAnswer(None, reason="it did not move")
        return LearnAnswer("static" if job.object in self.world.pinned else "free", self.explains, "", 0.1)

    def plan(self, job: PlanJob) -> PlanAnswer:
        scene = job.scene
        free = free_space(scene, RADIUS)
        here, there = region_of(scene, free, scene.start), region_of(scene, free, scene.goal, "goal")
        told = {"region": here, "regions": len(free.regions), "seconds": 0.01}
        if here == there:
            return PlanAnswer(way=find_way(scene, job.seed), **told)
        for name in self.order:
            if name in scene.movable and job.beliefs.get(name) != "static":
                pull = ((np.array([-0.4, 0.0, 0.0]), 4.5),)
                targets = np.array([scene.goal[:2], [2.0, 1.0], [2.0, -1.0]])
                move = Move(name, pull, np.array([-0.375, 0.0]), here, there, targets, expected_force=5.0)
                return PlanAnswer(self.moves(move), **told)
        return PlanAnswer(reason="nothing that could be moved", cut_off=(there,), **told)

    def begin(self, job: Job) -> None:
        """Be a thinker that says nothing where it is silent: see `ImmediateThinker`."""
        self.found = None if type(job) in self.silent else self(job)

    def poll(self) -> Answer | None:
        found, self.found = self.found, None
        return found

    def drop(self) -> None:
        self.found = None

    def asked(self, kind: type) -> list[Job]:
        return [job for job in self.jobs if type(job) is kind]


def executive_in(world: Office, brain: Brain | None = None, **more: object) -> NamoExecutive:
    told = {
        "opening": OpenByFreeSpace(RADIUS),
        "controller": CONTROLLER,
        "settings": SETTINGS,
        "thinker": ImmediateThinker(brain or Brain(world)),
        "goal": GOAL.copy(),
    } | more
    goal, thinker = told.pop("goal"), told.pop("thinker")
    executive = NamoExecutive(goal, world.kinematics, thinker, **told)  # type: ignore[arg-type]
    executive.told(ROOM, world.fixed)
    return executive


def view_of(world: Office, seconds: float = 0.6) -> RoomView:
    view = RoomView(world.kinematics, SETTINGS)
    view.told(ROOM, world.fixed, {"table_a": 33.0})
    for now in np.arange(0.0, seconds, 0.05):
        world.time = float(now)
        view.odometry(world.time, world.base)
        view.take(world.time, world.percept())
    return view


def tag(time: float, position: np.ndarray, yaw: float) -> Tag:
    return Tag(time, position, np.array([0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)]))
