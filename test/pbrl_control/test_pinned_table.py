"""The whole loop against a plane mock-up: a table pinned at one corner, held by rubber springs.

The table cannot follow the commanded twist; it can only turn about the pin. Base and joints do as they are told.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from pbrl_control.kinematics import APPROACH, GRIP, SIDES, Posture, RobotKinematics
from pbrl_control.loop import ControlLoop
from pbrl_control.percept import BodyShape, Grip, Percept, Tag
from pbrl_control.planar import compose, inverse, rotation, wrap
from pbrl_control.push import GripperAnswer, Phase
from pbrl_control.push_plan import PushPlan, load_plan
from pbrl_control.types import BodyCommand

FOOTPRINT = np.array([[-0.375, -0.75], [0.375, -0.75], [0.375, 0.75], [-0.375, 0.75]])
PIN = np.array([-0.315, -0.69])  # in the table's frame
INERTIA = 26.0  # [kg m^2] of 33 kg about the pin
STIFFNESS, DAMPING = 2.0e4, 190.0  # [N/m], [N s/m] of the rubber
TWIST_STIFFNESS, TWIST_DAMPING = 20.0, 0.5  # [N m/rad], [N m s/rad]
PIN_FRICTION = 4.0  # [N m]
WEIGHT = np.array([0.8, -0.5, -17.35, 1.58, 0.2, 0.0])  # bias and gripper weight, sensor axes


@dataclass
class PinnedTable:
    """A kinematic robot and a table that turns about a pin; what they sense, and the forces between them."""

    kinematics: RobotKinematics
    posture: Posture
    base: np.ndarray = field(default_factory=lambda: np.zeros(3))
    start: np.ndarray = field(default_factory=lambda: np.array([1.19, -0.25, 0.0]))
    turned: float = 0.0
    rate: float = 0.0
    grip: Grip | None = None
    wrench: np.ndarray = field(default_factory=lambda: WEIGHT.copy())
    force: float = 0.0

    def __post_init__(self) -> None:
        self.pin = compose(self.start, np.array([*PIN, 0.0]))[:2]

    def table(self) -> np.ndarray:
        lever = rotation(self.turned) @ (self.start[:2] - self.pin)
        return np.array([*(self.pin + lever), self.start[2] + self.turned])

    def plates(self) -> np.ndarray:
        return compose(self.base, self.kinematics.grippers(self.posture)["left"].planar)

    def close(self) -> None:
        contact = compose(inverse(self.table()), self.plates())
        self.grip = Grip("table_a", contact[:2])
        self.rest, self.last = contact, self.plates()

    def step(self, command: BodyCommand, dt: float, substeps: int = 4) -> None:
        h = dt / substeps
        for _ in range(substeps):
            v, w = command.base_v, command.base_w
            self.base += h * np.array([v * math.cos(self.base[2]), v * math.sin(self.base[2]), w])
            arms = [self.posture.arm(side) + h * command.arm(side) for side in SIDES]
            self.posture = Posture(self.posture.waist, self.posture.torso, *arms)
            self._forces(h)

    def _forces(self, h: float) -> None:
        torque = 0.0
        self.wrench = WEIGHT.copy()
        if self.grip is not None:
            plates = self.plates()
            speed, self.last = (plates - self.last) / h, plates
            goal = compose(self.table(), self.rest)
            lever = goal[:2] - self.pin
            contact = self.rate * np.array([-lever[1], lever[0]])
            on_table = STIFFNESS * (plates[:2] - goal[:2]) + DAMPING * (speed[:2] - contact)
            spin = TWIST_STIFFNESS * wrap(plates[2] - goal[2]) + TWIST_DAMPING * (speed[2] - self.rate)
            torque = lever[0] * on_table[1] - lever[1] * on_table[0] + spin
            self._feel(-on_table, -spin)
        friction = PIN_FRICTION * math.tanh(self.rate / 1e-3)
        self.rate += h * (torque - friction) / INERTIA
        self.turned += h * self.rate

    def _feel(self, force: np.ndarray, torque: float) -> None:
        pose = self.kinematics.grippers(self.posture)["left"].pose
        in_base = np.array([*(rotation(self.base[2]).T @ force), 0.0])
        lever = pose.rotation @ APPROACH["left"] * GRIP
        moment = np.array([0.0, 0.0, torque]) + np.cross(lever, in_base)
        self.wrench = WEIGHT + np.concatenate((pose.rotation.T @ in_base, pose.rotation.T @ moment))
        self.force = float(np.hypot(*force))

    def percept(self, now: float, rng: np.random.Generator) -> Percept:
        table, gripper = self.table(), self.kinematics.grippers(self.posture)["left"].pose
        yaw = self.base[2]
        turn = np.array([0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)])
        quaternion = product(turn, gripper.quaternion())
        place = np.array([*compose(self.base, np.array([*gripper.position[:2], 0.0]))[:2], gripper.position[2]])
        tags = {
            "table_a": Tag(now, np.array([*table[:2], 0.7775]), about_vertical(table[2])),
            "left_gripper": Tag(now, place + rng.normal(scale=0.003, size=3), quaternion),
        }
        grips = {} if self.grip is None else {"left": self.grip}
        return Percept(self.posture, tags, {"left": self.wrench}, grips, {"table_a": BodyShape(FOOTPRINT, 0.7775)})


def about_vertical(yaw: float) -> np.ndarray:
    return np.array([0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)])


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    vector = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.array([*vector, a[3] * b[3] - a[:3] @ b[:3]])


def push(plant: PinnedTable, plan: PushPlan, rng: np.random.Generator, delay: int = 0) -> dict[str, np.ndarray]:
    """Run a plan to its end, commands `delay` ticks late; return what happened, one row a tick."""
    loop = ControlLoop(plant.kinematics, plan)
    queue = [BodyCommand()] * delay
    rows = []
    for tick in range(4000):
        command = loop.tick(0.01 * tick, plant.percept(0.01 * tick, rng))
        assert not command.body.report, command.body.report
        for request in command.push.requests:
            plant.close() if request.action == "grasp" else setattr(plant, "grip", None)
            loop.answer(GripperAnswer(request.action, request.side, True))
        queue.append(command.body)
        plant.step(queue.pop(0), 0.01)
        held = plant.grip is not None
        rows.append([plant.turned, plant.force if held else 0.0, *plant.posture.left, held])
        if command.push.finished:
            break
    assert command.push.phase == Phase.DONE, command.push.status
    table = np.array(rows)
    return {"turned": table[:, 0], "force": table[:, 1], "joints": table[:, 2:9], "held": table[:, 9]}


@pytest.mark.parametrize(("name", "delay"), [("turn_table", 6), ("turn_table_heldout", 0)])
def test_a_pinned_table_is_turned_without_a_fight(
    kinematics: RobotKinematics, push_posture: Posture, rng: np.random.Generator, root, name: str, delay: int
) -> None:
    plan = load_plan(root / f"config/params/pushes/{name}.yaml")
    run = push(PinnedTable(kinematics, push_posture), plan, rng, delay)
    assert np.abs(run["turned"]).max() > 0.3
    assert run["turned"].min() < 0.0, "pushed forward, left of the pin, it turns clockwise"
    assert run["force"].max() < 80.0, "far from the 320 N at which rubber slips"
    bends = np.abs(run["joints"][:, [1, 3, 5]])
    assert bends.max() < 2.094 - 0.03, "no joint comes to its stop"
    settled = np.flatnonzero(run["held"])[:60]
    assert run["force"][settled].max() < 10.0, "the gripper's own weight does not push"
