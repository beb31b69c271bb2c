"""Synthetic recordings: a table pushed through a compliant gripper, sensed as the contract says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_bag.types import BodyGeometry, Grasp, PoseStream, Recording, WrenchStream
from pbrl_model.geometry import mass_properties
from pbrl_model.parameters import BodyParameters
from pbrl_model.rollout import rollout_states
from pbrl_model.transforms import transform_wrench, yaw_matrices

Array = NDArray[np.float64]

TABLE = np.array([[-0.75, -0.375], [0.75, -0.375], [0.75, 0.375], [-0.75, 0.375]])
CASTERS = np.array([[-0.65, -0.3], [0.65, -0.3], [0.65, 0.3], [-0.65, 0.3]])
LOCKED = BodyParameters(mass=33.0, wheel_x=-0.65, wheel_y=0.3, wheel_theta=0.4, mu_x=0.18, mu_y=0.18)
FREE = BodyParameters(mass=33.0)
DT = 0.01
BEFORE = 2.0
"""Seconds recorded before the grasp."""


@dataclass(frozen=True)
class Push:
    """What to simulate: see the fields' defaults; `rolling` is unmodelled Coulomb drag over all casters [N]."""

    truth: BodyParameters = LOCKED
    seconds: float = 20.0
    contact: tuple[float, float] = (-0.75, -0.1)
    speed: float = 0.05
    heading: float = 0.0
    rolling: float = 0.0
    viscous: float = 0.0
    tag_noise: float = 0.003
    yaw_noise: float = np.deg2rad(0.5)
    dropout: float = 0.15
    force_noise: float = 0.1
    bias: float = 1.0
    start: tuple[float, float, float] = (1.0, 0.5, 0.3)


def _drag(push: Push, state: Array) -> Array:
    """Return the wrench of rolling resistance at every caster, which no model knows."""
    c, s = np.cos(state[2]), np.sin(state[2])
    arm = CASTERS @ np.array([[c, s], [-s, c]])
    velocity = state[3:5] + state[5] * np.stack([-arm[:, 1], arm[:, 0]], -1)
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    force = -push.rolling / 4 * velocity / (speed + 2e-3) - push.viscous / 4 * velocity
    return np.array([*force.sum(0), float(np.sum(arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]))])


def simulate_push(push: Push) -> tuple[Array, Array, Array, Array]:
    """Return states (T + 1, 6), gripper positions (T + 1, 2), gripper yaw (T + 1,), wrenches at the contact (T, 3)."""
    inertia = mass_properties(TABLE).inertia_per_mass
    row = push.truth.to_vector()[None]
    state = np.array([*push.start, 0.0, 0.0, 0.0])
    steps = round(push.seconds / DT)
    states, hands, yaws, wrenches = [state], [], [], []
    contact = np.array(push.contact)
    yaw, hand = state[2], None
    for k in range(steps):
        c, s = np.cos(state[2]), np.sin(state[2])
        arm = np.array([c * contact[0] - s * contact[1], s * contact[0] + c * contact[1]])
        point = state[:2] + arm
        velocity = state[3:5] + state[5] * np.array([-arm[1], arm[0]])
        hand = point if hand is None else hand
        ramp = min(1.0, k * DT) * min(1.0, (steps - k) * DT)
        course = state[2] + push.heading + 0.5 * np.sin(0.5 * k * DT)
        rate = push.speed * ramp * (1.0 + 0.4 * np.sin(0.9 * k * DT)) * np.array([np.cos(course), np.sin(course)])
        hands.append(hand)
        yaws.append(yaw)
        force = 750.0 * (hand - point) + 60.0 * (rate - velocity)
        torque = 8.0 * (yaw - state[2]) - 1.0 * state[5]
        hand = hand + rate * DT
        # The hand gives way: it cannot push harder than it can.
        hand = point + (hand - point) * min(1.0, 0.06 / max(float(np.linalg.norm(hand - point)), 1e-9))
        yaw += (state[2] - yaw) * DT / 0.5
        wrench = np.array([*force, torque])
        moment = torque + arm[0] * force[1] - arm[1] * force[0]
        total = np.array([force[0], force[1], moment]) + _drag(push, state)
        state = rollout_states(row, state[None], total[None, None], inertia, (0.0, 0.0), DT)[0, 0, -1]
        states.append(state)
        wrenches.append(wrench)
    return np.array(states), np.array([*hands, hand]), np.array([*yaws, yaw]), np.array(wrenches)


def _tags(rng: np.random.Generator, push: Push, time: Array, pose: Array, height: float, fixed: Array) -> PoseStream:
    """Sample planar poses as tags see them: 15 Hz, noise, drop-outs; `fixed` is the frame's own rotation."""
    end = time[-1]
    stamps = np.arange(0.013, end, 1 / 15.0)
    stamps = stamps[rng.random(len(stamps)) >= push.dropout]
    columns = [np.interp(stamps, time, column) for column in pose.T]
    noise = rng.normal(size=(len(stamps), 4)) * [push.tag_noise, push.tag_noise, push.tag_noise, push.yaw_noise]
    position = np.stack([columns[0], columns[1], np.full(len(stamps), height)], -1) + noise[:, :3]
    yaw = columns[2] + noise[:, 3]
    turned = np.array([np.zeros_like(yaw), np.zeros_like(yaw), np.sin(yaw / 2), np.cos(yaw / 2)]).T
    return PoseStream(stamps, position, quaternion_product(turned, fixed))


def quaternion_product(a: Array, b: Array) -> Array:
    """Return a * b of quaternions (x, y, z, w)."""
    av, aw, bv, bw = a[..., :3], a[..., 3:], b[..., :3], b[..., 3:]
    vector = aw * bv + bw * av + np.cross(av, np.broadcast_to(bv, av.shape))
    return np.concatenate([vector, aw * bw - np.sum(av * bv, -1, keepdims=True)], -1)


SENSOR = np.array([0.03, 0.02, -0.74, 0.67]) / np.linalg.norm([0.03, 0.02, -0.74, 0.67])
REACH = 0.217
"""From the sensor to the contact, along the sensor's y axis [m]."""


def record_push(push: Push, seed: int) -> Recording:
    """Simulate a push and sense it: raw wrist wrench with weight and bias, tags of object and gripper."""
    rng = np.random.default_rng(seed)
    states, hands, yaws, wrenches = simulate_push(push)
    time = np.concatenate([np.arange(round(BEFORE / DT)) * DT, BEFORE + DT * np.arange(len(states))])
    rest = round(BEFORE / DT)
    pose = np.concatenate([np.repeat(states[:1, :3], rest, 0), states[:, :3]])
    yaw = np.concatenate([np.full(rest, yaws[0]), yaws])
    hand = np.concatenate([np.repeat(hands[:1], rest, 0), hands])
    sensor_to_gripper = _matrix(SENSOR)
    rotation = yaw_matrices(yaw) @ sensor_to_gripper
    sensor = np.concatenate([hand, np.full((len(hand), 1), 0.765)], -1) - REACH * rotation[:, :, 1]
    onto = np.zeros((len(time), 6))
    onto[rest:-1, [0, 1, 5]] = wrenches
    onto[rest:-1, 2] = 4.0
    # From the contact in world axes to the sensor in its own axes.
    inverse = np.swapaxes(rotation, -1, -2)
    lever = REACH * rotation[:, :, 1]
    felt = transform_wrench(np.eye(3), lever, onto)
    felt = -transform_wrench(inverse, np.zeros(3), felt)
    weight = (inverse @ np.array([0.0, 0.0, -17.35]))[..., :]
    felt[:, :3] += weight
    felt[:, 3:] += np.cross(np.array([0.0, 0.091, 0.0]), weight)
    felt[:, :3] += rng.uniform(-1, 1, 3) * push.bias + rng.normal(size=(len(time), 3)) * push.force_noise
    felt[:, 3:] += rng.uniform(-1, 1, 3) * 0.05 * push.bias + rng.normal(size=(len(time), 3)) * 0.007
    identity = np.array([0.0, 0.0, 0.0, 1.0])
    gripper = np.concatenate([sensor[:, :2], yaw[:, None]], -1)
    return Recording(
        path=Path("synthetic"),
        bodies={"table": BodyGeometry("table", TABLE, 0.73, 33.0, True, states[0, :3], CASTERS)},
        object_poses={"table": _tags(rng, push, time, pose, 0.73, identity)},
        gripper_poses={"left": _tags(rng, push, time, gripper, 0.765, SENSOR)},
        wrenches={"left": WrenchStream(time, felt[:, :3], felt[:, 3:])},
        grasps=(Grasp("left", "table", BEFORE, float(time[-1]), np.array(push.contact)),),
    )


def _matrix(quaternion: Array) -> Array:
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


@pytest.fixture(scope="session")
def make_recording() -> Callable[..., Recording]:
    """Return a maker of synthetic recordings: `make_recording(seed, **fields of Push)`."""

    def make(seed: int, **fields: object) -> Recording:
        return record_push(Push(**fields), seed)  # type: ignore[arg-type]

    return make


@pytest.fixture(scope="session")
def heard_by() -> Callable[[Recording, float], Recording]:
    """Return a function that gives what of a recording had come in by a time [s]; what is held then still is."""

    def cut(recording: Recording, time: float) -> Recording:
        wrenches = {}
        for side, felt in recording.wrenches.items():
            keep = felt.time <= time
            wrenches[side] = replace(felt, time=felt.time[keep], force=felt.force[keep], torque=felt.torque[keep])
        end = max(float(felt.time[-1]) for felt in wrenches.values())
        return replace(
            recording,
            object_poses={name: _seen_by(stream, time) for name, stream in recording.object_poses.items()},
            gripper_poses={side: _seen_by(stream, time) for side, stream in recording.gripper_poses.items()},
            wrenches=wrenches,
            grasps=tuple(replace(grasp, end=min(grasp.end, end)) for grasp in recording.grasps if grasp.start < end),
        )

    return cut


def _seen_by(stream: PoseStream, time: float) -> PoseStream:
    keep = stream.time <= time
    return PoseStream(stream.time[keep], stream.position[keep], stream.quaternion[keep])
