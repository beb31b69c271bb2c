"""Random cases of section 6.5.3: a held square table is pushed into a long one whose locked wheel is concealed.

The world is pymunk's at steps of 2 ms, five to a step of the learner's. The robot is a compliant grip that follows a
path: it shakes the held table, to learn what it holds, then pushes one end of the long table and then the other, each
push planned from where the long table stands by then.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import BodyGeometry, Grasp, PoseStream, Recording, WrenchStream
from pbrl_bringup.errors import BringupError
from pbrl_model.parameters import BodyParameters
from pbrl_model.world import BodySpec, PhysicsWorld

Array = NDArray[np.float64]

HELD, PUSHED = "square_table", "long_table"
SQUARE, LONG, WIDE = 0.75, 1.6, 0.75  # [m] sides of the tables
SUBSTEP, SUBSTEPS = 0.002, 5
STEP = SUBSTEP * SUBSTEPS
GRIP = np.array([-SQUARE / 2.0, 0.0])
STIFFNESS, DAMPING = 1500.0, 150.0  # of the grip [N/m, N s/m]
TURN_STIFFNESS, TURN_DAMPING = 150.0, 15.0  # [N m/rad, N m s/rad]
TAG_RATE, TAG_DROPOUT = 15.0, 0.15  # [Hz], share of readings missed
TAG_NOISE = np.array([0.003, 0.003, np.deg2rad(0.5)])  # [m, m, rad]
WRENCH_NOISE = np.array([0.3, 0.3, 0.03])  # [N, N, N m] of one reading at 100 Hz
WRENCH_BIAS = np.array([1.0, 1.0, 0.1])  # [N, N, N m] an offset up to so much stays after compensation
REST, SHAKE = 0.5, 3.0  # [s] before anything moves; of the shaking
TRANSFER_SPEED = 0.35  # [m/s]
RETREAT = 0.7  # [m]
GAP = 0.25  # [m] between the tables before a push
RAMP = 0.5  # [s] in which a movement gets to its speed, and out of it
LEAST_MOVE, LEAST_TURN = 0.10, np.deg2rad(10.0)
ATTEMPTS = 20


@dataclass(frozen=True)
class Truth:
    """What the learner is not told.

    Attributes:
        held: the square table's parameters.
        pushed: the long table's, its locked wheel among them.
        contact_friction: of the pair.
        restitution: of the pair.
    """

    held: BodyParameters
    pushed: BodyParameters
    contact_friction: float
    restitution: float

    @property
    def wheel(self) -> Array:
        """Return the place of the locked wheel (2,) [m] in the long table's frame."""
        return np.array([self.pushed.wheel_x, self.pushed.wheel_y])


@dataclass(frozen=True)
class Case:
    """One case: what was recorded, and what is true for scoring alone.

    Attributes:
        seed: it was drawn from.
        recordings: for the learner: after the first push, and after both.
        truth: not for the learner.
        held_path: (T + 1, 3) true poses of the square table's frame, every `STEP`.
        pushed_path: (T + 1, 3) the same of the long table.
        first_steps: steps of the first push.
        moved: how far the long table's frame went from its start at most, by the first push [m].
        turned: how far it turned at most, by the first push [rad].
    """

    seed: int
    recordings: tuple[Recording, Recording]
    truth: Truth
    held_path: Array
    pushed_path: Array
    first_steps: int
    moved: float
    turned: float


def random_case(seed: int) -> Case:
    """Draw cases of a seed until the first push moves the long table by 10 cm or turns it by 10 degrees.

    That much the robot sees itself, from the tags, and would push again.
    """
    for attempt in range(ATTEMPTS):
        case = _draw(seed, np.random.default_rng((seed, attempt)))
        if case.moved >= LEAST_MOVE or case.turned >= LEAST_TURN:
            return case
    raise BringupError(f"seed {seed}: expected a push that moves the long table in {ATTEMPTS} draws, got none")


def draw_truth(rng: np.random.Generator) -> Truth:
    """Draw two tables: the wheel within 6 cm of a random caster, holding with random friction in random directions."""
    corner = rng.choice([-1.0, 1.0], 2) * (np.array([LONG, WIDE]) / 2.0 - 0.08)
    wheel = corner + rng.uniform(-0.06, 0.06, 2)
    mu_y = rng.uniform(0.10, 0.40)
    pushed = BodyParameters(
        mass=rng.uniform(12.0, 28.0),
        wheel_x=wheel[0],
        wheel_y=wheel[1],
        wheel_theta=rng.uniform(-np.pi, np.pi),
        mu_x=mu_y * rng.uniform(0.4, 1.0),
        mu_y=mu_y,
        mu_ground=rng.uniform(0.005, 0.03),
    )
    held = BodyParameters(mass=rng.uniform(7.0, 14.0), mu_ground=rng.uniform(0.005, 0.03))
    return Truth(held, pushed, rng.uniform(0.15, 0.6), rng.uniform(0.0, 0.4))


def _draw(seed: int, rng: np.random.Generator) -> Case:
    truth = draw_truth(rng)
    start = np.array([*rng.uniform(-2.0, 2.0, 2), rng.uniform(-np.pi, np.pi)])
    robot = _Robot(rng, start, truth)
    ends = rng.permutation([-1.0, 1.0])
    robot.push(float(ends[0]))
    steps = len(robot.wrench)
    robot.push(float(ends[1]))
    held, pushed = np.array(robot.held_path), np.array(robot.pushed_path)
    moved = float(np.hypot(*(pushed[: steps + 1, :2] - pushed[0, :2]).T).max())
    turned = float(np.abs(pushed[: steps + 1, 2] - pushed[0, 2]).max())
    both = sense(rng, held, pushed, np.array(robot.wrench), nominal_masses(truth, rng))
    return Case(seed, (until(both, steps * STEP), both), truth, held, pushed, steps, moved, turned)


def nominal_masses(truth: Truth, rng: np.random.Generator) -> tuple[float, float]:
    """Return what the robot is told that the tables weigh: wrong by a third."""
    scale = np.exp(rng.normal(0.0, 0.3, 2))
    return float(truth.held.mass * scale[0]), float(truth.pushed.mass * scale[1])


class _Robot:
    """A grip on the square table that follows a path, and the world it pushes in.

    Args:
        rng: draws offsets and angles of the pushes.
        start: (3,) pose of the long table.
        truth: both tables.
    """

    def __init__(self, rng: np.random.Generator, start: Array, truth: Truth) -> None:
        self._rng = rng
        self._side = float(rng.choice([-1.0, 1.0]))  # which long side is pushed
        self.held_path: list[Array] = []
        self.pushed_path: list[Array] = []
        self.wrench: list[Array] = []
        self._world = PhysicsWorld(SUBSTEP)
        self._command = self._aim(float(rng.choice([-1.0, 1.0])), start)[0]
        bodies = (
            (PUSHED, footprint(LONG, WIDE), truth.pushed, start),
            (HELD, footprint(SQUARE, SQUARE), truth.held, self._command),
        )
        for name, outline, parameters, pose in bodies:
            self._world.add_body(  # Chipmunk multiplies the two bodies' coefficients
                BodySpec(
                    name,
                    outline,
                    parameters,
                    pose,
                    restitution=float(np.sqrt(truth.restitution)),
                    contact_friction=float(np.sqrt(truth.contact_friction)),
                )
            )
        self._keep()
        self._shake()

    def push(self, end: float) -> None:
        """Go before one end (-1 or 1) of the long table, push it for half a metre, and back off."""
        standoff, course = self._aim(end, self._world.pose(PUSHED))
        self._go_to(standoff, TRANSFER_SPEED)
        speed, reach = self._rng.uniform(0.12, 0.25), self._rng.uniform(0.45, 0.65)
        ahead = np.array([np.cos(course), np.sin(course), 0.0])
        self._go_to(standoff + (GAP + reach) * ahead, speed)
        self._wait(0.5)
        self._go_to(self._command - RETREAT * ahead, TRANSFER_SPEED)

    def _aim(self, end: float, long_pose: Array) -> tuple[Array, float]:
        """Return where the square table stands before a push, and the course of the push."""
        along = end * self._rng.uniform(0.15, 0.9) * LONG / 2.0
        angle = self._rng.uniform(-1.0, 1.0) * np.deg2rad(20.0)
        target = place(long_pose, np.array([along, self._side * WIDE / 2.0]))
        course = long_pose[2] - self._side * np.pi / 2.0 + angle
        yaw = course + self._rng.uniform(-1.0, 1.0) * np.deg2rad(10.0)
        back = target - (SQUARE / 2.0 + GAP) * np.array([np.cos(course), np.sin(course)])
        return np.array([*back, yaw]), course

    def _shake(self) -> None:
        home = self._command.copy()
        self._wait(REST)
        c, s = np.cos(home[2]), np.sin(home[2])
        for k in range(round(SHAKE / STEP)):
            phase, fade = 2.0 * np.pi * k * STEP / 1.0, np.sin(np.pi * k * STEP / SHAKE)
            ahead, left, turn = fade * np.array([0.03, 0.03, 0.06]) * np.sin(phase * np.array([1.0, 1.5, 1.25]))
            self._step(home + np.array([c * ahead - s * left, s * ahead + c * left, turn]))
        self._go_to(home, TRANSFER_SPEED)
        self._wait(REST)

    def _go_to(self, goal: Array, speed: float) -> None:
        """Move the command along a line at a speed [m/s] that starts and ends gently."""
        start = self._command.copy()
        change = goal - start
        change[2] = (change[2] + np.pi) % (2.0 * np.pi) - np.pi
        seconds = max(float(np.hypot(*change[:2])) / speed, abs(float(change[2])) / (2.0 * speed)) + RAMP
        for k in range(1, round(seconds / STEP) + 1):
            self._step(start + change * _gentle(min(k * STEP / seconds, 1.0), RAMP / seconds))

    def _wait(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP)):
            self._step(self._command.copy())

    def _step(self, command: Array) -> None:
        """Follow a command for one step; keep poses and the mean wrench at the grip in the held table's axes."""
        rate = (command - self._command) / STEP
        felt = np.zeros(3)
        for _ in range(SUBSTEPS):
            self._command = self._command + rate * SUBSTEP
            state = self._world.com_state(HELD)
            turn = rotation(state[2])
            wanted = rotation(self._command[2])
            arm, wanted_arm = turn @ GRIP, wanted @ GRIP
            lag = self._command[:2] + wanted_arm - state[:2] - arm
            drift = rate[:2] + rate[2] * across(wanted_arm) - state[3:5] - state[5] * across(arm)
            force = STIFFNESS * lag + DAMPING * drift
            torque = TURN_STIFFNESS * (self._command[2] - state[2]) + TURN_DAMPING * (rate[2] - state[5])
            self._world.apply_wrench(HELD, [*force, torque + arm[0] * force[1] - arm[1] * force[0]])
            felt += np.array([*(turn.T @ force), torque]) / SUBSTEPS
            self._world.step()
        self.wrench.append(felt)
        self._keep()

    def _keep(self) -> None:
        self.held_path.append(self._world.pose(HELD))
        self.pushed_path.append(self._world.pose(PUSHED))


def _gentle(share: float, ramp: float) -> float:
    """Return the way done at a share of the time: constant acceleration, constant speed, and back."""
    ramp = min(ramp, 0.5)
    top = 1.0 / (1.0 - ramp)
    if share < ramp:
        return 0.5 * top * share**2 / ramp
    if share > 1.0 - ramp:
        return 1.0 - 0.5 * top * (1.0 - share) ** 2 / ramp
    return top * (share - 0.5 * ramp)


def footprint(length: float, width: float) -> Array:
    """Return the corners (4, 2) [m] of a table, counter-clockwise around its middle."""
    return np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * np.array([length, width]) / 2.0


def rotation(angle: float) -> Array:
    """Return the (2, 2) rotation by an angle [rad]."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def across(arm: Array) -> Array:
    """Return the velocity (2,) at an arm for one radian a second."""
    return np.array([-arm[1], arm[0]])


def place(pose: Array, point: Array) -> Array:
    """Return a point (2,) of a body in world."""
    return pose[:2] + rotation(pose[2]) @ point


def sense(
    rng: np.random.Generator, held: Array, pushed: Array, wrench: Array, masses: tuple[float, float]
) -> Recording:
    """Return what the sensors make of a run: tags of both tables and of the gripper, a wrist sensor.

    Args:
        rng: noise.
        held: (T + 1, 3) true poses of the square table.
        pushed: (T + 1, 3) of the long table.
        wrench: (T, 3) mean over each step at the grip, held table's axes.
        masses: nominal, of the square and the long table [kg].
    """
    time: Array = STEP * np.arange(len(held), dtype=np.float64)
    bias = rng.uniform(-1.0, 1.0, 3) * WRENCH_BIAS
    shown = wrench + bias + rng.normal(size=wrench.shape) * WRENCH_NOISE
    force = np.stack([shown[:, 0], shown[:, 1], np.zeros(len(shown))], -1)
    torque = np.stack([np.zeros(len(shown)), np.zeros(len(shown)), shown[:, 2]], -1)
    middle = 0.5 * (time[1:] + time[:-1])
    grip = held.copy()
    c, s = np.cos(held[:, 2]), np.sin(held[:, 2])
    grip[:, :2] += np.stack([c * GRIP[0] - s * GRIP[1], s * GRIP[0] + c * GRIP[1]], -1)
    bodies = {
        HELD: BodyGeometry(HELD, footprint(SQUARE, SQUARE), 0.72, masses[0], True, held[0]),
        PUSHED: BodyGeometry(PUSHED, footprint(LONG, WIDE), 0.72, masses[1], True, pushed[0]),
    }
    return Recording(
        Path("contact"),
        bodies,
        {HELD: _tag(rng, time, held), PUSHED: _tag(rng, time, pushed)},
        {"left": _tag(rng, time, grip)},
        {"left": WrenchStream(middle, force, torque, exerted_on="object", frame="sensor")},
        (Grasp("left", HELD, float(middle[0]), float(middle[-1]), GRIP),),
    )


def until(recording: Recording, end: float) -> Recording:
    """Return what there was of a recording at a time [s]."""

    def poses(stream: PoseStream) -> PoseStream:
        keep = stream.time <= end
        return PoseStream(stream.time[keep], stream.position[keep], stream.quaternion[keep])

    def wrenches(stream: WrenchStream) -> WrenchStream:
        keep = stream.time <= end
        return replace(stream, time=stream.time[keep], force=stream.force[keep], torque=stream.torque[keep])

    felt = {name: wrenches(stream) for name, stream in recording.wrenches.items()}
    return replace(
        recording,
        object_poses={name: poses(stream) for name, stream in recording.object_poses.items()},
        gripper_poses={name: poses(stream) for name, stream in recording.gripper_poses.items()},
        wrenches=felt,
        grasps=tuple(replace(grasp, end=float(felt[grasp.gripper].time[-1])) for grasp in recording.grasps),
    )


def _tag(rng: np.random.Generator, time: Array, path: Array) -> PoseStream:
    """Return what a camera sees of a path: noise, 15 Hz, some readings missed."""
    at = np.arange(rng.uniform(0.0, 1.0 / TAG_RATE), time[-1], 1.0 / TAG_RATE)
    at = at[rng.random(len(at)) >= TAG_DROPOUT]
    pose = np.stack([np.interp(at, time, column) for column in path.T], -1) + rng.normal(size=(len(at), 3)) * TAG_NOISE
    zero = np.zeros(len(at))
    quaternion = np.stack([zero, zero, np.sin(pose[:, 2] / 2.0), np.cos(pose[:, 2] / 2.0)], -1)
    return PoseStream(at, np.stack([pose[:, 0], pose[:, 1], zero + 0.72], -1), quaternion)
