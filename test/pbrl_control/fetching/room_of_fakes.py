"""A room without physics: a base that goes as told, arms that stow, hands that close, a table that comes along."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from shapely import Polygon

from pbrl_control.fetching import FetchExecutive, FetchSettings, GraspChoice, SampledGrasps
from pbrl_control.grasp_plan import GraspPlan
from pbrl_control.grasping import GraspSettings
from pbrl_control.kinematics import GRIP, SIDES, Posture, RobotKinematics
from pbrl_control.navigation import KRANG_STOWED
from pbrl_control.percept import BodyShape, Grip, Percept, Tag
from pbrl_control.planar import compose, inverse, turn, wrap
from pbrl_control.push import GripperAnswer, Phase, PushCommand
from pbrl_control.settings import ControllerSettings

TABLE = BodyShape(np.array([[-0.375, -0.75], [0.375, -0.75], [0.375, 0.75], [-0.375, 0.75]]), 0.7775)
ROOM = np.array([[-3.0, -3.0], [3.0, -3.0], [3.0, 3.0], [-3.0, 3.0]])
DT = 0.02
STOWED = np.array(ControllerSettings().stowed)
NOMINAL = np.array(ControllerSettings().nominal)
SETTINGS = FetchSettings(grasps=GraspSettings(samples=8, wanted=2, time_limit=2.0, dead_ends=2))
BOTH = (("left", "right"),)


def plan_for(*sides: str) -> GraspPlan:
    grips = [{"gripper": side, "point": (-0.375, 0.16 if side == "left" else -0.16)} for side in sides]
    return GraspPlan.model_validate({"name": "p", "object": "table", "grips": grips, "still": 0.1, "settle": 0.1})


@dataclass
class World:
    """What is true. Faults are switches that a test turns.

    Attributes:
        base, table: (3,) poses [m, rad].
        tamper: changes a percept before it is seen.
        happens: called at each tick with this world, for what goes wrong at some moment.
        grips_hold: whether closed hands really hold; `slips`: share of a pull that they slide over the edge.
        friction: [N] that the table resists with at each hand.
        unseen: what stops the base and is on no map, in `world`.
    """

    kinematics: RobotKinematics
    base: np.ndarray
    table: np.ndarray = field(default_factory=lambda: np.zeros(3))
    joints: np.ndarray = field(default_factory=lambda: NOMINAL.copy())
    waist: float = 2.732
    bodies: dict[str, BodyShape] = field(default_factory=lambda: {"table": TABLE})
    fixed: dict[str, np.ndarray] = field(default_factory=dict)
    tamper: Callable[[World, Percept], Percept] = lambda world, percept: percept
    happens: Callable[[World], None] = lambda world: None
    odometry: bool = True
    arms_move: bool = True
    base_moves: bool = True
    refuses: str = ""
    grips_hold: bool = True
    slips: float = 0.0
    friction: float = 3.0
    unseen: Polygon = field(default_factory=Polygon)
    time: float = 0.0
    grips: dict[str, Grip] = field(default_factory=dict)
    hands: dict[str, np.ndarray] = field(default_factory=dict)  # x, y, yaw, height of plates, once lowered
    forces: dict[str, float] = field(default_factory=dict)
    phases: list[str] = field(default_factory=list)
    last: PushCommand | None = None

    def percept(self) -> Percept:
        posture = Posture(self.waist, 0.0, self.joints.copy(), -self.joints)
        tags = {"table": _tag(self.time, np.array([*self.table[:2], TABLE.height]), self.table[2])}
        for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
            tags[f"{side}_gripper"] = self._hand_tag(side, sign, posture)
        wrenches = {
            side: np.array([0.0, sign * self.forces.get(side, 0.0), 0.0, 0.0, 0.0, 0.0])
            for side, sign in zip(SIDES, (1.0, -1.0), strict=True)
        }
        return self.tamper(self, Percept(posture, tags, wrenches, dict(self.grips), self.bodies))

    def _hand_tag(self, side: str, sign: float, posture: Posture) -> Tag:
        if side in self.hands:
            x, y, yaw, height = self.hands[side]
            wrist = np.array([x - GRIP * math.cos(yaw), y - GRIP * math.sin(yaw), height])
            return _tag(self.time, wrist, yaw - sign * math.pi / 2.0)
        pose = self.kinematics.frame(posture, f"{side}_ft")
        c, s = math.cos(self.base[2]), math.sin(self.base[2])
        world = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        turned = replace(pose, rotation=world @ pose.rotation)
        return Tag(self.time, world @ pose.position + np.array([*self.base[:2], 0.0]), turned.quaternion())

    def run(self, fetch: FetchExecutive, until: float = 150.0) -> PushCommand:
        """Go on until the fetch has ended or a time [s]."""
        fetch.told(ROOM, self.fixed)
        while self.time < until:
            if self.odometry:
                fetch.odometry(self.time, self.base.copy())
            command = self.last = fetch.tick(self.time, self.percept())
            assert "\n" not in command.status
            if not self.phases or self.phases[-1] != command.phase:
                self.phases.append(str(command.phase))
            if command.finished:
                return command
            self.obey(command, fetch)
            self.time += DT
            self.happens(self)
        raise AssertionError(f"not over after {until} s: {command.phase}: {command.status}")

    def obey(self, command: PushCommand, fetch: FetchExecutive) -> None:
        self.forces = {}
        if "base" in command.twists:
            self._drive(command)
        elif command.phase == Phase.STOW and self.arms_move:
            self.joints += np.clip(STOWED - self.joints, -0.3 * DT, 0.3 * DT)
        elif command.phase not in (Phase.LOCATE, Phase.STOW):
            self._move_hands(command)
        for request in command.requests:
            fetch.answer(self._close_or_open(request.action, request.side))

    def _drive(self, command: PushCommand) -> None:
        twist = command.twists["base"]
        assert twist.vy == 0.0
        if command.phase in (Phase.LOCATE, Phase.DRIVE):
            self.hands = {}
        self._go(DT * turn(twist.array(), self.base[2] + 0.5 * DT * twist.omega))

    def _go(self, step: np.ndarray) -> None:
        """Move the base by a step (3,), unless something is in the way."""
        there = np.array([*(self.base[:2] + step[:2]), wrap(float(self.base[2] + step[2]))])
        if self.base_moves and not self.unseen.intersects(Polygon(KRANG_STOWED.at(there))):
            self.base = there

    def _move_hands(self, command: PushCommand) -> None:
        for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
            home = compose(self.base, np.array([0.74, sign * 0.16, 0.0]))
            self.hands.setdefault(side, np.array([*home, 0.9]))
            own, hand = command.twists.get(f"{side}_ft"), self.hands[side]
            if own is not None and side not in self.grips:
                hand[:3] += DT * turn(own.array(), hand[2])
                hand[3] += DT * own.vz
        held = command.twists.get("table")
        if held is None or not self.grips:
            return
        step = DT * turn(held.array(), self.table[2])
        for side in self.grips:
            self.hands[side][:3] += step
            if self.grips_hold and held.moves():
                inward = np.array([math.cos(self.hands[side][2]), math.sin(self.hands[side][2])])
                self.forces[side] = -math.copysign(self.friction, float(step[:2] @ inward))
        if self.grips_hold:
            self.table += (1.0 - self.slips) * step

    def _close_or_open(self, action: str, side: str) -> GripperAnswer:
        if action == "grasp" and self.refuses:
            return GripperAnswer(action, side, False, self.refuses, 0.034)
        if action == "grasp":
            place = compose(inverse(self.table), self.hands[side][:3])
            self.grips[side] = Grip("table", place[:2])
        else:
            self.grips.pop(side, None)
        return GripperAnswer(action, side, True)


def fetching(
    kinematics: RobotKinematics,
    *sides: str,
    choice: GraspChoice | None = None,
    settings: FetchSettings = SETTINGS,
    **more: object,
) -> FetchExecutive:
    sides = sides or ("left", "right")
    choice = choice or SampledGrasps(hands=(sides,))
    return FetchExecutive(plan_for(*sides), kinematics, settings=settings, choice=choice, **more)  # type: ignore[arg-type]


def _tag(time: float, position: np.ndarray, yaw: float) -> Tag:
    return Tag(time, position, np.array([0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)]))
