"""From streams of different rates to one clock: what was pushed, how hard, and where it went (thesis 5.4.2).

An episode is put on a grid of `dt`. Forces are averaged over each step; gripper poses are smoothed before they
act as lever arms (3 mm of noise on a lever is 0.1 N m at 30 N); the object's pose is smoothed for lever arms and
for the first state of each window, while the poses that the likelihood sees stay as they were recorded.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.episodes import Episode
from pbrl_bag.types import PoseStream, Recording, WrenchStream
from pbrl_model.errors import ModelError
from pbrl_model.sensing.clock import planar_yaw, smooth_gripper, step_means
from pbrl_model.sensing.gravity import GravityMethod, ReferenceReading, compensation
from pbrl_model.sensing.smoothing import smooth
from pbrl_model.transforms import planar, wrench_at_centre

Array = NDArray[np.float64]

REFERENCE_SPAN = (1.0, 0.1)
"""The reference reading is the mean from so long to so long before the grasp [s]."""
LEAST_READINGS = 5
MARGIN = 1.0
"""Poses so long before and after the episode help the smoother [s]."""
LONGEST_GAP = 0.5
"""A wrench stream with a longer gap inside an episode is refused [s]: a force that nobody saw moves things too."""


@dataclass(frozen=True)
class Motion:
    """One object, held by the same grippers from `time[0]` to `time[-1]`.

    Attributes:
        object: its name.
        grippers: who held it.
        dt: grid step [s].
        time: (T + 1,) [s] on the recording's clock.
        wrench: (T, 3) on the object at its centre of mass in world axes, constant over each step.
        pose_time: (n,) times of recorded poses within the episode [s].
        pose: (n, 3) recorded poses of the object's frame; the angle is unwrapped, NaN where not observed.
        state: (T + 1, 6) smoothed state of the centre of mass.
        covariance: (T + 1, 6, 6) of `state`.
        noise: (3,) standard deviation of one recorded pose [m, m, rad], as the smoother found it.
        oriented: whether the orientation was observed.
        delay: by how much the wrenches were shifted to be as late as the poses [s].
    """

    object: str
    grippers: tuple[str, ...]
    dt: float
    time: Array
    wrench: Array
    pose_time: Array
    pose: Array
    state: Array
    covariance: Array
    noise: Array
    oriented: bool
    delay: float = 0.0


def _within(stream: PoseStream, start: float, end: float, what: str) -> PoseStream:
    """Cut a pose stream, with a margin for the smoother."""
    keep = (stream.time >= start - MARGIN) & (stream.time <= end + MARGIN)
    if int(np.sum(keep)) < 4:
        raise ModelError(
            f"{what}: expected at least 4 poses between {start:.2f} s and {end:.2f} s, got {int(np.sum(keep))}"
        )
    return PoseStream(stream.time[keep], stream.position[keep], stream.quaternion[keep])


def _checked_wrench(stream: WrenchStream, grid: Array, what: str) -> Array:
    """Return (n, 6) readings after the checks that a force must pass; a sensor without torque reads zero torque."""
    inside = (stream.time >= grid[0] - LONGEST_GAP) & (stream.time <= grid[-1] + LONGEST_GAP)
    if int(np.sum(inside)) < 2:
        raise ModelError(f"{what}: expected readings between {grid[0]:.2f} s and {grid[-1]:.2f} s, got none")
    times = np.concatenate([[grid[0]], stream.time[(stream.time > grid[0]) & (stream.time < grid[-1])], [grid[-1]]])
    gap = int(np.argmax(np.diff(times)))
    if times[gap + 1] - times[gap] > LONGEST_GAP:
        raise ModelError(
            f"{what}: expected readings at most {LONGEST_GAP} s apart while the object is held, "
            f"got none for {times[gap + 1] - times[gap]:.2f} s after t = {times[gap]:.2f} s"
        )
    torque = np.asarray(stream.torque, dtype=float)
    if np.all(np.isnan(torque)):
        torque = np.zeros_like(torque)
    wrench = np.concatenate([stream.force, torque], -1)
    broken = inside & ~np.all(np.isfinite(wrench), axis=-1)
    if np.any(broken):
        raise ModelError(f"{what}: expected finite readings, got one that is not at t = {stream.time[broken][0]:.3f} s")
    return wrench


def reference_reading(
    stream: WrenchStream, pose: PoseStream, grasp: float, free_since: float, what: str
) -> ReferenceReading:
    """Take the reference reading for gravity compensation, just before a grasp.

    Args:
        stream: raw sensor.
        pose: of the sensor's frame.
        grasp: time of the grasp [s].
        free_since: since when the gripper had held nothing [s].
        what: name of the stream, for messages.

    Raises:
        ModelError: there are too few readings before the grasp, so weight and bias cannot be known.
    """
    keep = _at_rest(stream, grasp, free_since)
    if int(np.sum(keep)) < LEAST_READINGS:
        raise ModelError(
            f"{what}: expected at least {LEAST_READINGS} readings in the second before the grasp at t = {grasp:.2f} s "
            f"to know weight and bias, got {int(np.sum(keep))}; start recording earlier"
        )
    wrench = np.concatenate([stream.force[keep].mean(0), stream.torque[keep].mean(0)])
    when = np.array([stream.time[keep].mean()])
    rotation, _ = smooth_gripper(_within(pose, grasp - MARGIN, grasp, what), when)
    return ReferenceReading(wrench, rotation[0])


def _at_rest(stream: WrenchStream, grasp: float, free_since: float) -> NDArray[np.bool_]:
    """Return which readings the reference reading is the mean of."""
    first, last = max(grasp - REFERENCE_SPAN[0], free_since + REFERENCE_SPAN[1]), grasp - REFERENCE_SPAN[1]
    return (stream.time >= first) & (stream.time <= last)


def read_at_rest(recording: Recording, gripper: str, name: str, start: float) -> float:
    """Return when the offset of a gripper's sensor was last known [s]: at its reference reading before a grasp.

    Where nothing was read before it, or nothing is compensated, that is the beginning of the grasp.

    Args:
        recording: as read.
        gripper: whose sensor.
        name: of the object that it holds.
        start: a time in the grasp [s].

    Raises:
        ModelError: the gripper does not hold the object then.
    """
    stream = recording.wrenches[gripper]
    grasp, free_since, _ = _grasp_of(recording, gripper, name, start)
    keep = _at_rest(stream, grasp, free_since)
    return float(stream.time[keep].mean()) if stream.exerted_on == "gripper" and keep.any() else grasp


def _grasp_of(recording: Recording, gripper: str, name: str, start: float) -> tuple[float, float, Array]:
    """Return (start of the grasp that covers `start`, since when the gripper had been free, contact)."""
    before = [grasp for grasp in recording.grasps if grasp.gripper == gripper and grasp.start <= start + 1e-6]
    holding = [grasp for grasp in before if grasp.object == name and grasp.end > start]
    if not holding:
        raise ModelError(f"grasps: expected {gripper} to hold {name} at t = {start:.2f} s, it does not")
    grasp = holding[-1]
    free_since = max((other.end for other in before if other.end <= grasp.start), default=-np.inf)
    return grasp.start, free_since, grasp.contact


def begun_unheard(recording: Recording, episode: Episode) -> bool:
    """Tell whether a gripper had closed before what it feels was recorded: a recording that begins amid a hold.

    Args:
        recording: as read.
        episode: of it.

    Raises:
        ModelError: its grippers do not hold its object.
    """
    return any(
        _closed_unheard(recording.wrenches[gripper], _grasp_of(recording, gripper, episode.object, episode.start)[0])
        for gripper in episode.grippers
        if gripper in recording.wrenches
    )


def _closed_unheard(stream: WrenchStream, closed: float) -> bool:
    first, last = closed - REFERENCE_SPAN[0], closed - REFERENCE_SPAN[1]
    if stream.exerted_on != "gripper":  # nothing is compensated
        return bool(stream.time[0] > closed + LONGEST_GAP)
    before = np.sum((stream.time >= first) & (stream.time <= last))
    return bool(stream.time[0] > first and before < LEAST_READINGS)


def _gripper_wrench(
    recording: Recording, gripper: str, name: str, grid: Array, state: Array, gravity: GravityMethod, delay: float
) -> Array:
    """Return (T, 3) what one gripper exerts on the object, at its centre of mass in world axes."""
    what = f"wrench of {gripper} gripper"
    if gripper not in recording.wrenches:
        raise ModelError(f"{what}: expected a stream, the recording has {sorted(recording.wrenches) or 'none'}")
    stream = recording.wrenches[gripper]
    stream = replace(stream, time=stream.time + delay) if delay else stream
    readings = _checked_wrench(stream, grid, what)
    middle = 0.5 * (grid[1:] + grid[:-1])
    centre = np.concatenate([0.5 * (state[1:, :2] + state[:-1, :2]), np.zeros((len(middle), 1))], -1)
    grasped, free_since, contact = _grasp_of(recording, gripper, name, float(grid[0]))
    pose = recording.gripper_poses.get(gripper)
    means = step_means(stream.time, readings, grid)
    if pose is not None and stream.frame == "world":
        cut = _within(pose, grid[0], grid[-1], f"pose of {gripper} gripper")
        position = np.stack([smooth(cut.time, column, middle).position for column in cut.position.T], -1)
        rotation = np.broadcast_to(np.eye(3), (len(middle), 3, 3))
    elif pose is not None:
        rotation, position = smooth_gripper(_within(pose, grid[0], grid[-1], f"pose of {gripper} gripper"), middle)
    elif stream.frame == "world" and stream.exerted_on == "object":
        # Where the gripper was is not known; the point of the object that it held is.
        heading = 0.5 * (state[1:, 2] + state[:-1, 2])
        c, s = np.cos(heading), np.sin(heading)
        arm = np.stack([c * contact[0] - s * contact[1], s * contact[0] + c * contact[1], np.zeros_like(c)], -1)
        rotation, position = np.broadcast_to(np.eye(3), (len(middle), 3, 3)), centre + arm
    else:
        raise ModelError(f"pose of {gripper} gripper: expected a stream to turn its wrench into world axes, got none")
    if stream.exerted_on == "gripper":
        reference = reference_reading(stream, pose, grasped, free_since, what) if pose is not None else None
        if stream.frame != "sensor" or reference is None:
            raise ModelError(f"{what}: expected a raw sensor's wrench in sensor axes, got it in {stream.frame} axes")
        means = compensation(reference, rotation, gravity) - means
    return planar(wrench_at_centre(rotation, position, centre, means))


def _object_state(stream: PoseStream, grid: Array, com: Array) -> tuple[Array, Array, Array, Array, bool]:
    """Smooth an object's pose; return (state, covariance, noise, heading samples, oriented)."""
    heading = planar_yaw(stream.quaternion)
    seen = np.isfinite(heading)
    oriented = bool(np.sum(seen) >= 4)
    origin = [smooth(stream.time, stream.position[:, axis], grid) for axis in (0, 1)]
    turn = smooth(stream.time[seen], heading[seen], grid) if oriented else None
    count = len(grid)
    state, covariance = np.zeros((count, 6)), np.zeros((count, 6, 6))
    for axis, smoothed in enumerate((*origin, turn)):
        if smoothed is None:
            continue
        state[:, axis], state[:, axis + 3] = smoothed.position, smoothed.velocity
        covariance[:, axis::3, axis::3] = smoothed.covariance
    noise = np.array([origin[0].noise, origin[1].noise, turn.noise if turn else np.nan])
    c, s, omega = np.cos(state[:, 2]), np.sin(state[:, 2]), state[:, 5]
    arm = np.stack([c * com[0] - s * com[1], s * com[0] + c * com[1]], -1)
    across = np.stack([-arm[:, 1], arm[:, 0]], -1)
    state[:, :2] += arm
    state[:, 3:5] += omega[:, None] * across
    shift = np.broadcast_to(np.eye(6), (count, 6, 6)).copy()
    shift[:, 0:2, 2], shift[:, 3:5, 5] = across, across
    shift[:, 3:5, 2] = -omega[:, None] * arm
    return state, shift @ covariance @ np.swapaxes(shift, -1, -2), noise, heading, oriented


def observe(
    recording: Recording,
    name: str,
    grippers: tuple[str, ...],
    start: float,
    end: float,
    com: Array,
    *,
    dt: float = 0.01,
    gravity: GravityMethod = "weight",
    delay: float = 0.0,
) -> Motion:
    """Bring everything that is known of one episode to one clock.

    Args:
        recording: what was recorded.
        name: of the object.
        grippers: that held it from `start` to `end`; their wrenches are added.
        start: [s].
        end: [s].
        com: (2,) centre of mass in the object's frame [m]; zero where the orientation is not observed.
        dt: grid step [s].
        gravity: how raw wrenches are compensated, see `pbrl_model.sensing.gravity`.
        delay: by how much the cameras' poses come after the wrenches [s]; the wrenches are made as late.

    Raises:
        ModelError: a stream is missing, has gaps or is not finite, or the episode is shorter than a few poses.
    """
    if name not in recording.object_poses:
        raise ModelError(
            f"object poses: expected a stream for {name}, the recording has {sorted(recording.object_poses)}"
        )
    steps = int(np.floor((end - start) / dt + 1e-9))
    if steps < 2:
        raise ModelError(
            f"{name}: expected an episode longer than {2 * dt:g} s, got {end - start:.3f} s at t = {start:.2f} s"
        )
    grid: Array = start + dt * np.arange(steps + 1, dtype=np.float64)
    stream = _within(recording.object_poses[name], start, end, f"pose of {name}")
    state, covariance, noise, heading, oriented = _object_state(stream, grid, com)
    inside = (stream.time >= grid[0]) & (stream.time <= grid[-1])
    pose = np.concatenate(
        [stream.position[:, :2], heading[:, None] if oriented else np.full((len(heading), 1), np.nan)], -1
    )
    wrench = sum(
        (_gripper_wrench(recording, gripper, name, grid, state, gravity, delay) for gripper in grippers),
        start=np.zeros((steps, 3)),
    )
    return Motion(
        name,
        tuple(grippers),
        dt,
        grid,
        wrench,
        stream.time[inside],
        pose[inside],
        state,
        covariance,
        noise,
        oriented,
        delay,
    )
