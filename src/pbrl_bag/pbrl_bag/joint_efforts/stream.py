"""A wrench stream out of joint states: noise judged while the hand was empty, and sentences on what it is worth."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from pbrl_bag.errors import BagError
from pbrl_bag.joint_efforts.arm import Arm
from pbrl_bag.joint_efforts.samples import JointSamples
from pbrl_bag.joint_efforts.solving import tip_wrenches, untold
from pbrl_bag.mapping import EffortSource
from pbrl_bag.streams import wrench_stream
from pbrl_bag.types import Array, Grasp, WrenchStream

BEFORE, AFTER = 0.2, 0.5
"""So long before a grip closes and after it opens [s] the hand is not taken for empty."""
BLOCK, FEWEST_BLOCKS = 0.5, 6
"""Noise is judged over means of so long [s], of which there have to be so many: white noise is not what misleads a fit,
friction in the gears and a wrong weight are."""
BOTH = 2.0
"""Factor on the variance: what was read before the grip closed is taken out, and was off as well."""
LEAST, LEAST_SHARE = 0.01, 0.01
"""An effort is never taken to be better than this [N m], nor than this share of the largest: no gravity model is."""
SMOOTHED = 0.2
"""Speeds and accelerations are taken over so long [s]."""


def arm_of(source: EffortSource, urdf: str, where: str, told: Collection[str] = ()) -> Arm:
    """Return the arm that a source is about; arguments and errors as of `Arm`."""
    return Arm(urdf, source.joints, source.tip, source.gravity, where, told)


def tip_torques(samples: JointSamples, arm: Arm) -> tuple[Array, Array]:
    """Return what the world's wrench on the tip makes at the joints (n, k) [N m], and the Jacobians (n, 6, k).

    Raises:
        BagError: a number is missing or not finite.
    """
    source, angles = samples.source, samples.angles(arm.chain)
    measured = source.sign * samples.effort()
    if source.efforts == "external":
        return measured, arm.jacobians(angles)
    motion = _motion(samples.time, angles) if source.inertia else (None, None)
    return arm.torques(angles, *motion) - measured, arm.jacobians(angles)


def wrench_from_efforts(
    samples: JointSamples, urdf: str, grasps: Sequence[Grasp], notes: list[str], where: str
) -> WrenchStream:
    """Return what gripper and world exert on the tip, in its axes, as a force-torque sensor there would have it.

    Args:
        samples: joint states.
        urdf: text of the robot's description.
        grasps: of this gripper; while there is none, the hand is taken for empty.
        notes: sentences are added: how far off the wrench is, and which directions the joints do not tell.
        where: what to call the description in errors.

    Raises:
        BagError: description, joints and samples do not go together, a number is not finite, or the hand is empty for
            too short a time to judge the noise by.
    """
    source, label = samples.source, samples.label
    torques, jacobians = tip_torques(samples, arm_of(source, urdf, where, samples.positions))
    noise = _noise(samples, torques, grasps)
    wrench, covariance = tip_wrenches(jacobians, torques, noise, point=source.ignore_torque)
    held = np.zeros(len(samples), dtype=bool)
    for grasp in grasps:
        held |= (samples.time >= grasp.start) & (samples.time <= grasp.end)
    matters = covariance[held] if held.any() else covariance
    typical = BOTH * matters.mean(axis=0)
    force, torque = np.sqrt(np.trace(typical[:3, :3]) / 3.0), np.sqrt(np.trace(typical[3:, 3:]) / 3.0)
    off = f"{force:.2g} N" + ("" if source.ignore_torque else f" and {torque:.2g} N m")
    how = "as told" if source.noise is not None else "as efforts were off while the hand was empty"
    notes.append(
        f"{label}: a wrench at {source.tip} out of the efforts of {len(source.joints)} joints, a poorer one than a "
        f"sensor's: off by {off} (one standard deviation in each direction, {how})"
    )
    for share, direction in untold(matters):
        notes.append(
            f"{label}: for {100.0 * share:.0f} % of the time in which it matters the joints tell nothing of "
            f"{_words(direction)} of {source.tip}: what is given there is no measurement"
        )
    stream = wrench_stream(label, samples.time, wrench[:, :3], wrench[:, 3:], "gripper", "sensor", notes)
    typical.flags.writeable = False
    return WrenchStream(stream.time, stream.force, stream.torque, "gripper", "sensor", typical)


def _noise(samples: JointSamples, torques: Array, grasps: Sequence[Grasp]) -> Array:
    """Return (k,) how far efforts are off over a while [N m]."""
    told, count = samples.source.noise, len(samples.source.joints)
    if told is not None:
        return np.full(count, told) if isinstance(told, float) else np.array(told)
    time = samples.time
    empty: NDArray[np.bool_] = np.ones(len(time), dtype=bool)
    for grasp in grasps:
        empty &= (time < grasp.start - BEFORE) | (time > grasp.end + AFTER)
    blocks = np.floor((time[empty] - time[:1]) / BLOCK)
    means = np.array([torques[empty][blocks == block].mean(axis=0) for block in np.unique(blocks)])
    if len(means) < FEWEST_BLOCKS:
        raise BagError(
            f"{samples.label}: expected {FEWEST_BLOCKS * BLOCK:g} s with an empty hand, to see how far efforts are "
            f"off, got {len(means) * BLOCK:g} s; record longer, or say `noise` [N m] in the mapping"
        )
    spread = np.sqrt(np.mean((means - np.median(means, axis=0)) ** 2, axis=0))
    largest = np.abs(samples.effort()).max(axis=0)
    return np.maximum(spread, np.maximum(LEAST, LEAST_SHARE * largest))


def _motion(time: Array, angles: Array) -> tuple[Array, Array]:
    """Return speeds and accelerations (n, c) of angles (n, c), smoothed."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    window = max(5, 2 * round(0.5 * SMOOTHED / max(step, 1e-6)) + 1)
    even = np.arange(time[0], time[-1] + 0.5 * step, step)
    if len(even) < window:
        return np.zeros_like(angles), np.zeros_like(angles)
    smooth = np.column_stack([np.interp(even, time, column) for column in angles.T])
    rates = [savgol_filter(smooth, window, 3, deriv=order, delta=step, axis=0) for order in (1, 2)]
    speeds, accelerations = (np.column_stack([np.interp(time, even, c) for c in rate.T]) for rate in rates)
    return speeds, accelerations


def _words(direction: Array) -> str:
    """Say a direction (6,) by its larger part."""
    force, torque = np.linalg.norm(direction[:3]), np.linalg.norm(direction[3:])
    what, part = ("a force along", direction[:3]) if force >= torque else ("a torque about", direction[3:])
    x, y, z = part / np.linalg.norm(part)
    return f"{what} ({x:.2f}, {y:.2f}, {z:.2f}) in the axes"
