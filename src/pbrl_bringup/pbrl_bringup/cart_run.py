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
    DriveStatus,
)
from pbrl_control.planar import Array, compose, wrap
from pbrl_planner.cart.leg import ENDS, Leg, LegState, Order
from pbrl_planner.cart.navigator import PATIENCE, Navigator
from pbrl_planner.cart.outline import motions
from pbrl_planner.cart.query import OUTCOMES, Outcome
from pbrl_planner.cart.settings import CartParameters, load_cart
from pbrl_planner.cart.trail import Headway, Trail
from pbrl_planner.lattice import LatticePlan, LatticeSettings, Motions
from pr2_cart_sim.scene import OfficeScene
from pr2_cart_sim.sensing import in_base
from pr2_cart_sim.session import Pr2Session

TICK = 0.05
"""Of the local controller [s]; thesis: 20 Hz."""
SIDES = ("left", "right")
LONGEST = 300.0
"""Simulated time after which a leg is given up [s]."""
TRACED = 0.5
"""Between two points of the trace [s]."""


@dataclass
class _Going:
    """What is driven.

    Attributes:
        poses: (n, 4) of it [m, rad].
        controller: drives along them.
        plan: that they end with; None: they lead back.
        blocked: since when it stands before something [s].
    """

    poses: Array
    controller: CartController
    plan: LatticePlan | None = None
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
        self._leg = Leg(told.navigation, 0.0)
        self._going: _Going | None = None
        self._left: tuple[LatticePlan, Array] | None = None
        self._aim, self._sent = np.zeros(4), np.zeros(4)
        self._next_tick, self._next_trace = 0.0, 0.0
        self._trail, self._headway = Trail(), Headway()

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
        here, percept = self.senses.state(now), self.senses.percept(now)
        if here is not None and self.senses.whole is not None and self.senses.body is not None:
            self._do(now, self._leg.tick(now))
        if self._going is not None and not self._leg.backing and here is not None:
            self._trail.at(here)
            if self._headway.at(here):
                self._leg.got_on()
        if self._going is not None and percept is not None:
            began = thread_time()
            command = self._going.controller.step(now, percept)
            self.ticks.seconds.append(round(thread_time() - began, 7))
            self._send(command)
            self._note_errors(command)
            self._heed(now, self._going, command)
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

    def _heed(self, now: float, going: _Going, command: CartCommand) -> None:
        """Tell the leg how the drive goes on."""
        ended = ENDS.get(command.status)
        if ended is not None:
            self._left = None if going.plan is None else (going.plan, rest(going.poses, command.goal))
            self._going = None
            self._do(now, self._leg.drove(now, ended, command.reason))
            return
        if command.status is not DriveStatus.BLOCKED:
            going.blocked = None
        elif going.blocked is None:
            going.blocked = now
        blocked = 0.0 if going.blocked is None else now - going.blocked
        self._aim = command.goal
        self._do(now, self._leg.driving(now, blocked, command.reason))

    def _do(self, now: float, order: Order) -> None:
        """Do what is due; the planner answers at once."""
        if order is Order.PLAN:
            self._set_out(now)
        elif order is Order.REFINE:
            self._go_over(now)
        elif order is Order.GO_ON:
            assert self._left is not None, "called after a drive was given up"
            self._drive(self._left[1], self._left[0])
        elif order is Order.BACK:
            self._make_way()
        elif order is Order.CLEAR:
            self.senses.recover(now)
        elif order is Order.FORGET:
            if any(len(each.places) for each in self.senses.forget_unseen(now, self._navigation.unseen)):
                self._leg.forgot(now)
        elif order is Order.END:
            self._going, self.ended = None, self._leg.sentence
            self.reached = self._leg.state is LegState.ARRIVED

    def _make_way(self) -> None:
        """Go back along where they came: who stands in the way may be shut in by them."""
        poses, self._going = self._trail.back(self._navigation.way_back), None
        if poses is None:
            self._leg.nothing_behind()
        else:
            self._drive(poses)

    def _set_out(self, now: float) -> None:
        """Plan from here, and drive that."""
        here = self.senses.state(now)
        if here is None:
            self._do(now, self._leg.planned(now, Outcome.NOT_READY, "it is not known where robot and cart are"))
            return
        made = self._asked(now, here)
        order = self._leg.planned(now, *self._answer())
        if order is Order.FOLLOW:
            assert made is not None, "there is a path"
            self._drive(np.vstack([here, made.poses]), made)
        else:
            self._do(now, order)

    def _go_over(self, now: float) -> None:
        """Plan again from a little further along the plan that is driven; drive that where it is another."""
        going = self._going
        head = None if going is None or going.plan is None else onward(going.plan, self._aim)
        if head is None:
            self._leg.nothing_ahead(now)
            return
        assert going is not None and going.plan is not None, "there is something ahead"
        driven, made = going.plan, self._asked(now, head[-1])
        order = self._leg.planned(now, *self._answer())
        if order is Order.SWITCH:
            assert made is not None, "there is a path"
            if not np.array_equal(made.primitives, driven.primitives[-len(made.primitives) :]):
                self._drive(np.vstack([head, made.poses]), made)
        else:
            self._do(now, order)

    def _asked(self, now: float, begin: Array) -> LatticePlan | None:
        """Return a plan from a pose (4,) on."""
        floor = self.senses.floor(now)
        assert floor is not None, "asked once a map has come"
        if not self.navigator.calls:  # a robot that waits for its goal has the time
            self.navigator.prepare(floor)
        made = self.navigator.plan(now, floor, begin, self.goal)
        self.last_plan = made if made is not None else self.last_plan
        return made

    def _answer(self) -> tuple[Outcome, str]:
        call = self.navigator.calls[-1]
        return OUTCOMES[call.answer], f"{call.answer} {call.reason}".strip()

    def _drive(self, poses: Array, plan: LatticePlan | None = None) -> None:
        """Drive along poses (m, 4), of which the first is about here, and the last ones those of a plan."""
        body = self.senses.body
        assert body is not None, "a cart is held"
        self._going = _Going(poses, self._controller(poses, body), plan)

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
