"""Random tables with a wheel somewhere, pushed in the pymunk world and sensed as the contract says.

The world runs at a step five times finer than the model's. A gripper holds the table's edge through a spring and a
damper and follows a random course; it gives way rather than push harder than an arm can. Tags of table and gripper are
read at 15 Hz with noise, drop-outs and a delay that nobody tells; the wrist is read at 100 Hz, raw, in its own axes,
with weight, bias and noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import BodyGeometry, Grasp, PoseStream, Recording, WrenchStream
from pbrl_model.parameters import BodyParameters
from pbrl_model.transforms import rotation_matrices, transform_wrench, yaw_matrices
from pbrl_model.world import BodySpec, PhysicsWorld

Array = NDArray[np.float64]

STEP = 0.002
"""Of the world [s]."""
SENSED = 5
"""Steps of the world between two readings of the wrist: 100 Hz."""
BEFORE, PUSH = 2.0, 20.0
"""Seconds recorded before the grasp, and of the push."""
TAG_RATE, DROPOUT, DELAY = 15.0, 0.12, (0.0, 0.06)
"""Pictures a second [1/s], share of tags missed, range of the delay that stamps do not tell [s]."""
TAG_NOISE, YAW_NOISE = 0.003, 0.006
"""[m]; [rad]: 3 mm over a lever of half a metre."""
FORCE_NOISE, TORQUE_NOISE, FORCE_BIAS, TORQUE_BIAS = 0.3, 0.02, 1.0, 0.05
"""Of one reading, and the range of what the sensor shows at rest besides the weight [N, N m]."""
WEIGHT = 17.35
"""Of the hand beyond the sensor [N]."""
STIFFNESS, DAMPING, LIMIT = 1500.0, 120.0, 130.0
"""Of the grip [N/m, N s/m] and what an arm pushes at most [N]."""
TWIST_STIFFNESS, TWIST_DAMPING = 12.0, 2.0
"""Of the grip in yaw [N m/rad, N m s/rad]."""
MOUNT = np.array([0.03, 0.02, -0.74, 0.67]) / np.linalg.norm([0.03, 0.02, -0.74, 0.67])
REACH = 0.217
"""From the sensor to the grip, along the sensor's y axis [m]."""


@dataclass(frozen=True)
class Table:
    """A table and how it is pushed.

    Attributes:
        footprint: (4, 2) [m].
        truth: its physics.
        locked: whether the wheel holds in both directions.
        grip: (2,) where it is held [m].
        course: (4,) direction of the push in the table's frame, how far and how fast it swings, and its size:
            [rad, rad, rad/s, m/s].
        delay: of the tags [s].
    """

    footprint: Array
    truth: BodyParameters
    locked: bool
    grip: Array
    course: Array
    delay: float


def random_table(rng: np.random.Generator) -> Table:
    """Draw a table: size, mass, wheel anywhere on it, locked or rolling, grip and course."""
    half = np.array([rng.uniform(0.4, 0.9), rng.uniform(0.25, 0.45)])
    footprint = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    locked = bool(rng.random() < 0.6)
    along, across = rng.uniform(0.1, 0.45, 2) if locked else (rng.uniform(0.005, 0.04), rng.uniform(0.15, 0.5))
    wheel_x, wheel_y = half * rng.uniform(-1.0, 1.0, 2)
    truth = BodyParameters(
        mass=float(np.clip(30.0 * np.exp(0.4 * rng.standard_normal()), 12.0, 70.0)),
        wheel_x=float(wheel_x),
        wheel_y=float(wheel_y),
        wheel_theta=float(rng.uniform(-np.pi, np.pi)),
        mu_x=float(along),
        mu_y=float(across),
        mu_ground=float(rng.uniform(0.002, 0.03)),
    )
    # Held on the near edge and pushed away from it, as a robot would that comes from there.
    grip = np.array([-half[0], rng.uniform(-0.8, 0.8) * half[1]])
    course = np.array([rng.uniform(-0.4, 0.4), rng.uniform(0.3, 0.8), rng.uniform(0.3, 0.8), rng.uniform(0.06, 0.12)])
    return Table(footprint, truth, locked, grip, course, float(rng.uniform(*DELAY)))


def push(rng: np.random.Generator, table: Table) -> tuple[Array, Array, Array]:
    """Push a table for `PUSH` seconds.

    Returns:
        Each at 100 Hz: poses of the table (T, 3), of the gripper (T, 3) [m, m, rad], what the gripper exerts at the
        grip in world axes (T, 3) [N, N, N m], as the mean since the reading before.
    """
    world = PhysicsWorld(STEP)
    start = np.array([1.0, 0.5, rng.uniform(-0.5, 0.5)])
    world.add_body(BodySpec("table", table.footprint, table.truth, start))
    steps = round(PUSH / STEP)
    direction, swing, rate, size = table.course
    phase = rng.uniform(0.0, 2.0 * np.pi)
    hand, yaw = np.array([np.nan, np.nan]), float(start[2])
    poses, hands, wrenches, mean = [], [], [], np.zeros(3)
    for k in range(steps):
        x, y, theta, vx, vy, omega = world.com_state("table")
        c, s = np.cos(theta), np.sin(theta)
        arm = np.array([c * table.grip[0] - s * table.grip[1], s * table.grip[0] + c * table.grip[1]])
        point, velocity = np.array([x, y]) + arm, np.array([vx - omega * arm[1], vy + omega * arm[0]])
        hand = point if k == 0 else hand
        if k % SENSED == 0:
            poses.append(world.pose("table"))
            hands.append(np.array([*hand, yaw]))
            wrenches.append(mean / SENSED)
            mean = np.zeros(3)
        time = k * STEP
        gait = min(1.0, time) * min(1.0, PUSH - time) * (1.0 + 0.5 * np.sin(0.9 * time + phase))
        heading = theta + direction + swing * np.sin(rate * time + phase)
        wish = size * gait * np.array([np.cos(heading), np.sin(heading)])
        force = STIFFNESS * (hand - point) + DAMPING * (wish - velocity)
        hard = float(np.linalg.norm(force))
        force *= min(1.0, LIMIT / max(hard, 1e-9))
        torque = TWIST_STIFFNESS * (yaw - theta) - TWIST_DAMPING * omega
        world.apply_wrench("table", [*force, torque + arm[0] * force[1] - arm[1] * force[0]])
        world.step()
        mean += np.array([*force, torque])
        hand = hand + wish * STEP
        give = hand - point
        hand = point + give * min(1.0, LIMIT / STIFFNESS / max(float(np.linalg.norm(give)), 1e-9))
        yaw += (theta - yaw) * STEP / 0.5
    return np.array(poses), np.array(hands), np.array(wrenches)


def record(rng: np.random.Generator, table: Table) -> Recording:
    """Push a table and sense it."""
    poses, hands, wrenches = push(rng, table)
    dt, rest = STEP * SENSED, round(BEFORE / (STEP * SENSED))
    time = (dt * np.arange(rest + len(poses))).astype(float)
    pose: Array = np.concatenate([np.repeat(poses[:1], rest, axis=0), poses])
    hand = np.concatenate([np.repeat(hands[:1], rest, axis=0), hands])
    onto = np.zeros((len(time), 6))
    onto[rest:, [0, 1, 5]] = wrenches
    turned = yaw_matrices(hand[:, 2]) @ rotation_matrices(MOUNT[None])[0]
    lever = REACH * turned[:, :, 1]
    sensor = np.concatenate([hand[:, :2], np.full((len(hand), 1), 0.75)], -1) - lever
    wrist: Array = np.concatenate([sensor[:, :2], hand[:, 2:]], -1)
    return Recording(
        path=Path("random-table"),
        bodies={"table": BodyGeometry("table", table.footprint, 0.73, np.nan, True, pose[0])},
        object_poses={"table": _tags(rng, table, time, pose, 0.73, np.array([0.0, 0.0, 0.0, 1.0]))},
        gripper_poses={"left": _tags(rng, table, time, wrist, 0.75, MOUNT)},
        wrenches={"left": _wrist(rng, time, turned, lever, onto)},
        grasps=(Grasp("left", "table", BEFORE, float(time[-1]), table.grip),),
    )


def _wrist(rng: np.random.Generator, time: Array, turned: Array, lever: Array, onto: Array) -> WrenchStream:
    """Return what the wrist reads while the hand exerts `onto` (T, 6) at the grip: the reaction, and its own weight.

    A reading is the mean over the time since the one before, so it is stamped in the middle of that time.
    """
    inverse = np.swapaxes(turned, -1, -2)
    felt = -transform_wrench(inverse, np.zeros(3), transform_wrench(np.eye(3), lever, onto))
    weight = inverse @ np.array([0.0, 0.0, -WEIGHT])
    felt[:, :3] += weight
    felt[:, 3:] += np.cross(np.array([0.0, 0.091, 0.0]), weight)
    noise = np.repeat([FORCE_NOISE, TORQUE_NOISE], 3)
    bias = np.repeat([FORCE_BIAS, TORQUE_BIAS], 3) * rng.uniform(-1.0, 1.0, 6)
    felt += bias + noise * rng.standard_normal(felt.shape)
    return WrenchStream(time - 0.5 * STEP * SENSED, felt[:, :3], felt[:, 3:])


def _tags(rng: np.random.Generator, table: Table, time: Array, pose: Array, height: float, mount: Array) -> PoseStream:
    """Return planar poses as tags see them; `mount` turns the body's frame into the stream's."""
    taken = np.arange(rng.uniform(0.0, 1.0 / TAG_RATE), time[-1], 1.0 / TAG_RATE)
    taken = taken[rng.random(len(taken)) >= DROPOUT]
    x, y, yaw = (np.interp(taken, time, column) for column in pose.T)
    noise = rng.standard_normal((len(taken), 4)) * [TAG_NOISE, TAG_NOISE, TAG_NOISE, YAW_NOISE]
    position = np.stack([x, y, np.full(len(taken), height)], -1) + noise[:, :3]
    half = 0.5 * (yaw + noise[:, 3])
    c, s = np.cos(half)[:, None], np.sin(half)[:, None]
    quaternion = c * mount + s * np.array([-mount[1], mount[0], mount[3], -mount[2]])  # a turn about z, then the mount
    return PoseStream(taken + table.delay, position, quaternion)
