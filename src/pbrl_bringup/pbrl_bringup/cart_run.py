"""The PR2 pushes a cart through an office to a goal, without middleware: simulator, planner and controller in one."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from time import thread_time

import numpy as np

from pbrl_bringup.cart.along import onward, rest
from pbrl_bringup.cart.outcome import CartOutcome, Score, Touch, Trace
from pbrl_bringup.cart.senses import CartSenses
from pbrl_control.cart import (
    CartBody,
    CartCommand,
    CartController,
    CartPlan,
    Cause,
    DriveStatus,
)
from pbrl_control.planar import Array, compose, wrap
from pbrl_planner.cart.navigator import PATIENCE, Answer, Navigator
from pbrl_planner.cart.outline import motions
from pbrl_planner.cart.settings import CartParameters, load_cart
from pbrl_planner.cart.trail import Headway, Trail
from pbrl_planner.costmap import CostField
from pbrl_planner.lattice import LatticePlan, LatticeSettings, Motions
from pr2_cart_sim.scene import OfficeScene
from pr2_cart_sim.sensing import in_base
from pr2_cart_sim.session import Pr2Session

TICK = 0.05
"""Of the local controller [s]; thesis: 20 Hz."""
SIDES = ("left", "right")
LONGEST = 300.0
"""Simulated time after which a leg is given up [s]."""
IN_THE_WAY = (Cause.OBSTACLE, Cause.FOOTPRINT)
"""Why a plan is given up that may be good again in a moment."""
TRACED = 0.5
"""Between two points of the trace [s]."""


@dataclass
class _Going:
    """What is driven: a plan, its controller, when it began, since when it stands before something.

    Without a plan it is the way back along where they came.
    """

    plan: LatticePlan | None
    controller: CartController
    since: float
    blocked: float | None = None


@dataclass
class _Ticks:
    """Of each tick on a plan: how far it is off, and what the controller took of a core."""

    position: list[float] = field(default_factory=list)
    angle: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)


class CartRun:
    """One session and what drives in it; what is thought takes no simulated time.

    Args:
        session: of the simulator, the cart in both hands.
        goal: (3,) of `base` in `map` [m, rad].
        swept: motions of robot and cart.
        planning: epsilons and patience of the planner.
        told: of the local controller, and when to plan again; None: as installed.

    Attributes:
        senses: all that is perceived.
        navigator: plans, and has an account of it.
        trace: the story so far.
    """

    def __init__(
        self,
        session: Pr2Session,
        goal: Array,
        swept: Motions,
        planning: LatticeSettings = PATIENCE,
        told: CartParameters | None = None,
    ) -> None:
        self.session, self.goal = session, np.asarray(goal, dtype=float)
        self.senses = CartSenses(swept.primitives.resolution)
        self.navigator = Navigator(swept, planning)
        self.trace: list[Trace] = []
        self.ended = ""
        self.reached = False
        self.ticks = _Ticks()
        self.last_plan: LatticePlan | None = None
        told = told or load_cart()
        self._settings, self._navigation = told.controller, told.navigation
        self._going: _Going | None = None
        self._sent = np.zeros(4)
        self._next_tick, self._next_plan, self._next_trace = 0.0, 0.0, 0.0
        self._pause = self._navigation.retry
        self._trail, self._headway = Trail(), Headway()
        self._stuck: float | None = None

    def step(self) -> None:
        """Advance the simulator by one step; perceive, and control at each tick."""
        for observation in self.session.step():
            self.senses.hear(observation)
        now = self.session.time
        if now + 1e-9 >= self._next_tick:
            self._next_tick += TICK
            self._tick(now)

    def _tick(self, now: float) -> None:
        command: CartCommand | None = None
        if self._going is None and now >= self._next_plan:
            self._set_out(now)
        percept = self.senses.percept(now)
        if self._going is not None and self._going.plan is not None and (here := self.senses.state(now)) is not None:
            self._trail.at(here)
            self._stuck = None if self._headway.at(here) else self._stuck
        if self._going is not None and percept is not None:
            began = thread_time()
            command = self._going.controller.step(now, percept)
            self.ticks.seconds.append(round(thread_time() - began, 7))
            self._send(command)
            self._note_errors(command)
            self._heed(now, command)
        else:
            self.session.command_base(0.0, 0.0, 0.0)
            self._sent = np.zeros(4)
        if now + 1e-9 >= self._next_trace:
            self._next_trace += TRACED
            self.trace.append(self._traced(now, command))

    def _send(self, command: CartCommand) -> None:
        self.session.command_base(*map(float, command.twist))
        if command.joint_rates is not None:
            for side, rates in zip(SIDES, command.joint_rates, strict=True):
                self.session.command_arm(side, rates.tolist())
        self._sent = np.append(command.twist, command.articulation_rate)

    def _heed(self, now: float, command: CartCommand) -> None:
        """Do what the controller's status asks for."""
        going = self._going
        assert going is not None, "called while a plan is driven"
        if command.status is DriveStatus.FAILED:
            self.ended = command.reason
        elif going.plan is None:
            self._heed_way_back(now, command)
        elif command.status is DriveStatus.ARRIVED:
            self.reached, self.ended = True, "at the goal"
        elif command.status is DriveStatus.REPLAN:
            self.senses.recover(now)
            self._give_up(now, going, going.plan, command)
        elif command.status is DriveStatus.BLOCKED:
            going.blocked = now if going.blocked is None else going.blocked
            if now - going.blocked >= self._navigation.blocked and now >= self._next_plan:
                self._set_out(now)
        else:
            going.blocked = None
            if now - going.since >= self._navigation.refresh and now >= self._next_plan:
                self._go_over(now, going, going.plan, command.goal)

    def _heed_way_back(self, now: float, command: CartCommand) -> None:
        """At its end, or where it is not free, wait for who wants to get by."""
        if command.status in (DriveStatus.ARRIVED, DriveStatus.REPLAN):
            told = self._navigation
            self._going, self._next_plan = None, now + told.room
            # Where that was not far enough, it goes on soon.
            self._stuck = now - told.make_way + 2.0 * told.room
        if command.status is DriveStatus.REPLAN:
            self.senses.recover(now)

    def _make_way(self, now: float) -> None:
        """Go back along where they came: who stands in the way may be shut in by them."""
        self._stuck, body = None, self.senses.body
        poses = self._trail.back(self._navigation.way_back)
        if poses is not None and body is not None:
            self._going = _Going(None, self._controller(poses, body), now)

    def _give_up(self, now: float, going: _Going, driven: LatticePlan, command: CartCommand) -> None:
        """Have another plan made; while there is none, wait on what is left of this one for the way to get free."""
        self._going = None
        if command.cause in IN_THE_WAY and self.senses.body is not None:
            left = self._controller(rest(driven, command.goal), self.senses.body)
            self._going = _Going(driven, left, going.since, now if going.blocked is None else going.blocked)

    def _set_out(self, now: float) -> None:
        """Plan from here, and drive that; without a plan go on with the old one, if any, and try again later."""
        here, floor, body = self.senses.state(now), self.senses.floor(now), self.senses.body
        if here is None or floor is None or body is None:
            return
        made = self._asked(now, floor, here)
        if made is None and self.navigator.calls[-1].answer is Answer.SHUT_IN:
            self.senses.recover(now)
        elif made is None and any(len(each.places) for each in self.senses.forget_unseen(now, self._navigation.unseen)):
            self._pause = self._navigation.retry
            self._next_plan = now + self._pause
        if made is None:
            self._stuck = now if self._stuck is None else self._stuck
            if now - self._stuck > self._navigation.make_way:
                self._make_way(now)
            return
        self._going = _Going(made, self._controller(np.vstack([here, made.poses]), body), now)

    def _asked(self, now: float, floor: CostField, begin: Array) -> LatticePlan | None:
        """Return a plan from a pose (4,) on, and take note of when to ask again."""
        if not self.navigator.calls:  # a robot that waits for its goal has the time
            self.navigator.prepare(floor)
        made = self.navigator.plan(now, floor, begin, self.goal)
        found = made is not None
        retry, most = self._navigation.retry, self._navigation.retry_most
        late = now - self._next_plan > most
        self._next_plan = now + (retry if found or late else self._pause)
        self._pause = retry if found else min(2.0 * (retry if late else self._pause), most)
        self.last_plan = made if found else self.last_plan
        return made

    def _go_over(self, now: float, going: _Going, driven: LatticePlan, aim: Array) -> None:
        """Plan again from a little further along the plan that is driven; drive that where it is another."""
        floor, body = self.senses.floor(now), self.senses.body
        head = onward(driven, aim)
        if floor is None or body is None or head is None:
            return
        going.since = now
        made = self._asked(now, floor, head[-1])
        if made is None or np.array_equal(made.primitives, driven.primitives[-len(made.primitives) :]):
            return
        self._going = _Going(made, self._controller(np.vstack([head, made.poses]), body), now)

    def _controller(self, poses: Array, body: CartBody) -> CartController:
        """Return a controller that goes along poses (m, 4), of which the first is about here."""
        poses = np.array(poses)
        low, high = self._settings.limits.articulation
        poses[:, 3] = np.clip(poses[:, 3], low, high)
        plan = CartPlan.timed(poses, self._settings.limits, self._settings.share, self._sent)
        return CartController(plan, body, self._settings, self._sent)

    def _note_errors(self, command: CartCommand) -> None:
        if command.status is DriveStatus.MOVING and np.isfinite(command.error).all():
            self.ticks.position.append(round(math.hypot(*command.error[:2]), 5))
            self.ticks.angle.append(round(float(np.abs(command.error[2:]).max()), 5))

    def _traced(self, now: float, command: CartCommand | None) -> Trace:
        office = self.session.office
        assert office.cart is not None, "the scene has a cart"
        body, base = office.world.pose(office.cart), self.session.robot.base_pose()
        pose = self.session.robot_truth()[0]
        places = {name: (float(each.place[0]), float(each.place[1])) for name, each in self.session.people.items()}
        return Trace(
            now,
            tuple(map(float, pose)),
            tuple(map(float, compose(pose, in_base(base, body)))),
            "planning" if command is None else str(command.status),
            "" if command is None else str(command.cause),
            places,
        )


def run_cart(
    scene: OfficeScene,
    goal: Array,
    seed: int,
    longest: float = LONGEST,
    coarse: bool = False,
    planning: LatticeSettings = PATIENCE,
) -> CartOutcome:
    """Drive to a goal in an office.

    Args:
        scene: with people and clutter, which reach the simulator only; the robot holds a cart.
        goal: (3,) of `base` in `map` [m, rad].
        seed: of world, people and sensors.
        longest: simulated time after which it is given up [s].
        coarse: plan on larger cells with half the headings: for tests.
        planning: epsilons and patience of the planner.
    """
    assert scene.robot.holds is not None, "the robot holds a cart"
    size = np.array(scene.bodies[scene.robot.holds].footprint)
    length, width = np.ptp(size, axis=0)
    with Pr2Session(scene, seed=seed) as session:
        run = CartRun(session, goal, motions(float(length), float(width), coarse), planning)
        while session.time < longest and not run.ended:
            run.step()
        return outcome(run)


def outcome(run: CartRun) -> CartOutcome:
    """Return what became of a run, scored by the truth."""
    session = run.session
    pose = session.robot_truth()[0]
    places = np.array([each.base[:2] for each in run.trace]).reshape(-1, 2)
    score = Score(
        tuple(Touch(each.mover, each.other, each.person, each.start, each.peak) for each in session.contacts),
        _finite(session.clearance.person),
        _finite(session.clearance.thing),
        tuple(run.ticks.position),
        tuple(run.ticks.angle),
        tuple(run.ticks.seconds),
        float(np.hypot(*(pose[:2] - run.goal[:2]))),
        abs(wrap(float(pose[2] - run.goal[2]))),
        float(np.hypot(*np.diff(places, axis=0).T).sum()),
    )
    last = run.navigator.calls[-1] if run.navigator.calls else None
    sentence = run.ended or f"not at the goal after {session.time:.0f} s; the last call of the planner: " + (
        "none" if last is None else f"{last.answer} {last.reason}"
    )
    room = run.senses.room if run.senses.room is not None else np.zeros((0, 2))
    poses = run.last_plan.poses if run.last_plan is not None else np.zeros((0, 4))
    return CartOutcome(
        run.reached,
        sentence,
        session.time,
        tuple(run.navigator.calls),
        tuple(run.trace),
        score,
        tuple(map(float, run.goal)),
        tuple(tuple(map(float, corner)) for corner in room),
        tuple(tuple(map(float, pose)) for pose in poses),
    )


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
