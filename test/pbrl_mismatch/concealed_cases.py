"""Recordings of the pushed table as the contract says: raw wrist wrench, tags of table and gripper; truths drawn."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from pushed_table import BEFORE, FEET, TABLE, Array, Truth, simulate

from pbrl_bag.types import BodyGeometry, Grasp, PoseStream, Recording, WrenchStream


def quaternions(yaw: Array) -> Array:
    return np.stack([np.zeros_like(yaw), np.zeros_like(yaw), np.sin(yaw / 2), np.cos(yaw / 2)], -1)


def tags(rng: np.random.Generator, truth: Truth, time: Array, pose: Array, late: float = 0.0) -> PoseStream:
    """Sample poses as tags see them: 20 Hz, noise, one in ten missed."""
    stamps = np.arange(0.011, time[-1] - max(late, 0.0), 0.05)
    stamps = stamps[rng.random(len(stamps)) > 0.1]
    x, y, yaw = (np.interp(stamps, time, column) for column in pose.T)
    noise = rng.normal(size=(len(stamps), 4)) * [truth.tag_noise, truth.tag_noise, truth.tag_noise, truth.yaw_noise]
    return PoseStream(
        stamps + late, np.stack([x, y, np.full_like(x, 0.7)], -1) + noise[:, :3], quaternions(yaw + noise[:, 3])
    )


def record(truth: Truth, seed: int) -> Recording:
    """Simulate and sense: raw wrist wrench with weight and bias, tags of table and gripper."""
    rng = np.random.default_rng(seed)
    n = dict(truth.numbers)
    pose, hand, wrench = simulate(truth, rng)
    rest = round(BEFORE / 0.01)
    time = 0.01 * np.arange(rest + len(pose))
    pose = np.concatenate([np.repeat(pose[:1], rest, 0), pose])
    hand = np.concatenate([np.repeat(hand[:1], rest, 0), hand])
    onto = np.zeros((len(time), 3))
    onto[rest:-1] = wrench
    c, s = np.cos(hand[:, 2]), np.sin(hand[:, 2])
    felt = np.stack([c * onto[:, 0] + s * onto[:, 1], -s * onto[:, 0] + c * onto[:, 1], onto[:, 2]], -1)
    if truth.effect == "wrench_frame":
        tc, ts = math.cos(n["turn"]), math.sin(n["turn"])
        felt = (
            np.stack([tc * felt[:, 0] - ts * felt[:, 1], ts * felt[:, 0] + tc * felt[:, 1], felt[:, 2]], -1)
            * n["scale"]
        )
    if truth.effect == "wrench_bias":
        on = np.clip((time - BEFORE) * 5, 0, 1)[:, None]
        felt = (
            felt
            + on * np.array([n["x"], n["y"], n["tau"]])
            + np.maximum(time - BEFORE, 0)[:, None] * n.get("drift", 0.0) * np.array([1, 1, 0])
        )
    force = np.concatenate([-felt[:, :2], np.zeros((len(time), 1))], -1)
    torque = np.concatenate([np.zeros((len(time), 2)), -felt[:, 2:]], -1)
    force = (
        force
        + np.array([0.0, 0.0, -15.0])
        + rng.uniform(-0.5, 0.5, 3)
        + rng.normal(size=force.shape) * truth.force_noise
    )
    torque = torque + rng.normal(size=torque.shape) * 0.01
    shown = pose
    if truth.effect == "pose_bias":
        cc, ss = np.cos(pose[:, 2]), np.sin(pose[:, 2])
        shown = pose + np.stack(
            [cc * n["x"] - ss * n["y"], ss * n["x"] + cc * n["y"], np.full(len(pose), n["theta"])], -1
        )
    late = n["late"] if truth.effect == "time_offset" else 0.0
    return Recording(
        path=Path("synthetic"),
        bodies={"table": BodyGeometry("table", TABLE, 0.7, truth.nominal_mass, True, pose[0], FEET)},
        object_poses={"table": tags(rng, truth, time, shown, late)},
        gripper_poses={"left": tags(rng, truth, time, hand, late)},
        wrenches={"left": WrenchStream(time + 0.005, force, torque)},  # means over each step
        grasps=(Grasp("left", "table", BEFORE, float(time[-1]), np.array(truth.contact)),),
    )


def concealed(effect: str, rng: np.random.Generator) -> dict[str, float]:
    """Draw the numbers of an effect, weak to strong."""
    u, sign = rng.uniform, lambda: float(rng.choice([-1.0, 1.0]))
    angle = u(0, 2 * math.pi)
    c, s = math.cos(angle), math.sin(angle)
    force = u(2.0, 6.0)
    draws: dict[str, dict[str, float]] = {
        "clean": {},
        "ground_friction": {"mu": u(0.015, 0.06)},
        "breakaway_friction": {"mu": u(0.01, 0.03), "extra": u(0.05, 0.12), "speed": u(0.015, 0.03)},
        "viscous_drag": {"c": u(10.0, 40.0)},
        "second_wheel": {"x": sign() * 0.5, "y": -0.28, "mu": u(0.04, 0.12)},
        "floor_patch": {"mu": u(0.04, 0.12), "x": u(0.5, 0.8) * c, "y": u(0.5, 0.8) * s, "half": u(0.3, 0.6)},
        "floor_slope": {"x": force / 200 * c, "y": force / 200 * s},
        "com_offset": {"x": u(0.08, 0.2) * sign(), "y": u(0.05, 0.12) * sign()},
        "payload_change": {"mass": u(3.0, 8.0), "time": u(7.0, 16.0), "x": u(-0.4, 0.4), "y": u(-0.2, 0.2)},
        "tether": {
            "k": u(20.0, 80.0),
            "x": u(0.4, 1.0) * c,
            "y": u(0.4, 1.0) * s,
            "length": u(0.2, 0.6),
            "at": sign() * 0.5,
        },
        "external_force": {"x": force * c, "y": force * s, "frequency": u(0.2, 0.8)},
        "hidden_obstacle": {"x": 0.0, "y": 0.0, "radius": 0.1},
        "unseen_body": {"x": 0.0, "y": 0.0, "radius": 0.15, "force": u(5.0, 20.0)},
        "hidden_hinge": {"x": sign() * 0.5, "y": sign() * 0.28},
        "detent": {"force": u(8.0, 20.0), "x": 0.0, "y": 0.0, "width": u(0.03, 0.08)},
        "sloshing_load": {"mass": u(2.0, 5.0), "frequency": u(0.6, 1.2), "damping": u(0.03, 0.15)},
        "grasp_compliance": {"give": u(4e-4, 1.2e-3)},
        "caster_swivel": {"trail": u(0.02, 0.05), "roll": u(0.015, 0.05)},
        "wrench_bias": {"x": force * c, "y": force * s, "tau": u(-0.5, 0.5)},
        "wrench_frame": {"scale": u(0.8, 1.25), "turn": u(0.15, 0.4) * sign()},
        "time_offset": {"late": u(0.04, 0.15)},
        "pose_bias": {"x": u(0.03, 0.1) * sign(), "y": u(0.03, 0.1) * sign(), "theta": u(-0.15, 0.15)},
    }
    return draws[effect]


def on_the_way(effect: str, numbers: dict[str, float], seed: int) -> dict[str, float]:
    """Put a thing on the floor where the table without it would come by."""
    if effect not in ("hidden_obstacle", "unseen_body", "detent", "floor_patch", "hidden_hinge"):
        return numbers
    pose, _, _ = simulate(Truth(), np.random.default_rng(seed))
    rng = np.random.default_rng([seed, 1])
    if effect == "hidden_hinge":
        return numbers
    c, s = math.cos(pose[0, 2]), math.sin(pose[0, 2])
    if effect in ("hidden_obstacle", "unseen_body"):
        spot = ahead_of(pose, numbers["radius"], rng) - pose[0, :2]
    else:
        way = np.linalg.norm(pose[:, :2] - pose[0, :2], axis=1)
        spot = pose[int(rng.choice(np.flatnonzero(way > 0.5 * way.max()))), :2] - pose[0, :2]
    return numbers | {"x": float(c * spot[0] + s * spot[1]), "y": float(-s * spot[0] + c * spot[1])}


def ahead_of(pose: Array, radius: float, rng: np.random.Generator) -> Array:
    """Return a place that the table without the thing would not touch for four seconds, and run deep into later."""
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    lower, upper = pose[:, :2].min(0) - 0.9, pose[:, :2].max(0) + 0.9
    for deep in (0.06, 0.03, 0.01):
        for _ in range(400):
            spot = rng.uniform(lower, upper)
            away = spot - pose[:, :2]
            local = np.stack([c * away[:, 0] + s * away[:, 1], -s * away[:, 0] + c * away[:, 1]], -1)
            gap = np.linalg.norm(local - np.clip(local, TABLE[0], TABLE[2]), axis=1) - radius
            if gap[:400].min() > 0.01 and -0.09 < gap.min() < -deep and gap.min() > -radius + 0.005:
                return spot
    raise AssertionError("expected a place on the table's way")


def make_case(effect: str, seed: int, **changes: object) -> Recording:
    numbers = on_the_way(effect, concealed(effect, np.random.default_rng([seed, 7])), seed)
    wheel = (-0.5, 0.28, 0.12) if seed % 2 == 0 or effect == "second_wheel" else None
    return record(Truth(effect=effect, numbers=numbers, wheel=wheel, **changes), seed)  # type: ignore[arg-type]
