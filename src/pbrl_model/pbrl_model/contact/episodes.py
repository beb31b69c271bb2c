"""A recording in which a held body is pushed into another, cut into when they touch and when nothing is touched."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.episodes import cut_episodes
from pbrl_bag.types import Recording
from pbrl_model.contact.wrench import HeldBody, contact_wrench, frame_path, gaps
from pbrl_model.errors import ModelError
from pbrl_model.geometry import MassProperties, mass_properties
from pbrl_model.sensing.motion import Motion, observe

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

APART = 0.05
"""Further apart [m] than this, smoothed poses leave no doubt that the bodies do not touch."""
TOUCHING = 0.015
"""Nearer [m] than this they may touch: three times what the smoothed poses of both are wrong by."""
MOVING = np.array([0.015, 0.015, 0.03])
"""Smoothed velocities above this [m/s, m/s, rad/s], and above three of their standard deviations, are motion."""
PADDING = 0.4
"""Seconds at rest kept before and after a touch: a start that is known."""
SHORTEST = 0.6
"""Touches and free spans shorter than this [s] say little."""


@dataclass(frozen=True)
class Touch:
    """One span in which the pushed body is touched or moves.

    Attributes:
        held: motion of the held body, its `wrench` from the grippers.
        pushed: motion of the other on the same grid, its `wrench` from the held body; zero where they are apart.
        gap: (T + 1,) distance between the footprints [m].
    """

    held: Motion
    pushed: Motion
    gap: Array


@dataclass(frozen=True)
class Approach:
    """What is known before any force is thought about.

    Attributes:
        held: name of the held body.
        pushed: name of the other.
        held_body: centre of mass and inertia over mass.
        pushed_body: the same of the other.
        free: motions of the held body while nothing is touched.
        spans: (first, last, grippers) [s] in which the pushed body is touched or moves, and who holds the other.
        nearest: least distance between the footprints [m].
        delay: by how much wrenches are shifted to be as late as the poses [s].
    """

    held: str
    pushed: str
    held_body: MassProperties
    pushed_body: MassProperties
    free: tuple[Motion, ...]
    spans: tuple[tuple[float, float, tuple[str, ...]], ...]
    nearest: float
    delay: float


def approach(recording: Recording, pushed: str, delay: float = 0.0) -> Approach:
    """Find out from poses alone when the held body touches another.

    Args:
        recording: with poses of both.
        pushed: name of the body that nobody holds.
        delay: by how much poses come after wrenches [s].

    Raises:
        ModelError: a body is not in the recording, the pushed one is held, or nothing else is.
        BagError: an episode is malformed.
    """
    names = sorted({grasp.object for grasp in recording.grasps})
    if pushed not in recording.bodies or pushed not in recording.object_poses:
        known = ", ".join(sorted(set(recording.bodies) & set(recording.object_poses))) or "none"
        raise ModelError(f"contact: expected a body with footprint and poses to learn ({known}), got {pushed!r}")
    if len(names) != 1 or names[0] == pushed:
        raise ModelError(
            f"contact: expected one body that is held and pushed into {pushed}, "
            f"got grasps of {', '.join(names) or 'none'}"
        )
    held = names[0]
    shapes = recording.bodies[held].footprint, recording.bodies[pushed].footprint
    bodies = mass_properties(shapes[0]), mass_properties(shapes[1])
    free: list[Motion] = []
    spans: list[tuple[float, float, tuple[str, ...]]] = []
    nearest = np.inf
    for episode in cut_episodes(recording):
        if episode.object != held or episode.duration < SHORTEST:
            continue
        span = episode.start, episode.end
        mine = observe(recording, held, episode.grippers, *span, bodies[0].com, delay=delay)
        other = observe(recording, pushed, (), *span, bodies[1].com, delay=delay)
        for motion in (mine, other):
            if not motion.oriented:
                raise ModelError(f"contact: expected the orientation of {motion.object} to be observed, got positions")
        gap = gaps(shapes[0], frame_path(mine, bodies[0]), shapes[1], frame_path(other, bodies[1]))
        nearest = min(nearest, float(gap.min()))
        free += [_part(mine, first, last) for first, last in runs(gap > APART, 0, round(SHORTEST / mine.dt))]
        busy = runs((gap < TOUCHING) | _moving(other), round(PADDING / mine.dt), round(SHORTEST / mine.dt))
        spans += [
            (float(mine.time[first]), float(mine.time[last]), episode.grippers)
            for first, last in busy
            if gap[first : last + 1].min() < TOUCHING
        ]
    return Approach(held, pushed, *bodies, tuple(free), tuple(spans), nearest, delay)


def touches(recording: Recording, found: Approach, held: HeldBody) -> tuple[Touch, ...]:
    """Return every touch with the forces on both bodies.

    Each touch is smoothed on its own: how jerkily a body moves while it is shaken says nothing of how it moves while it
    pushes. What the held body's poses are wrong by moves the other's simulation by the ratio of their masses, through
    m dv/dt, and counts as noise of its poses.
    """
    out = []
    shapes = recording.bodies[found.held].footprint, recording.bodies[found.pushed].footprint
    for first, last, grippers in found.spans:
        mine = observe(recording, found.held, grippers, first, last, found.held_body.com, delay=found.delay)
        other = observe(recording, found.pushed, (), first, last, found.pushed_body.com, delay=found.delay)
        gap = gaps(shapes[0], frame_path(mine, found.held_body), shapes[1], frame_path(other, found.pushed_body))
        wrench = contact_wrench(held, mine, other.state[:, :2])
        wrench[np.minimum(gap[1:], gap[:-1]) >= TOUCHING] = 0.0
        noise = np.hypot(other.noise, mine.noise * _mass_ratio(recording, found, held))
        out.append(Touch(mine, replace(other, wrench=wrench, noise=noise), gap))
    return tuple(out)


def runs(mask: Flags, padding: int, least: int) -> list[tuple[int, int]]:
    """Return (first, last) of a mask's stretches, grown by `padding` to both sides, of at least `least` steps."""
    grown = np.convolve(mask, np.ones(2 * padding + 1), mode="full")[padding : padding + len(mask)] > 0.5
    edges = np.diff(np.concatenate([[0], grown.astype(int), [0]]))
    pairs = zip(np.flatnonzero(edges == 1).tolist(), (np.flatnonzero(edges == -1) - 1).tolist(), strict=True)
    return [(first, last) for first, last in pairs if last - first >= max(least, 1)]


def _mass_ratio(recording: Recording, found: Approach, held: HeldBody) -> float:
    """Return the held body's mass over what the other is said to weigh; one where nobody says."""
    nominal = recording.bodies[found.pushed].nominal_mass
    return held.parameters.mass / nominal if np.isfinite(nominal) else 1.0


def _moving(motion: Motion) -> Flags:
    deviation = np.sqrt(np.einsum("nii->ni", motion.covariance)[:, 3:])
    return np.asarray(np.any(np.abs(motion.state[:, 3:]) > np.maximum(MOVING, 3.0 * deviation), axis=1))


def _part(motion: Motion, first: int, last: int) -> Motion:
    inside = (motion.pose_time >= motion.time[first]) & (motion.pose_time <= motion.time[last])
    return replace(
        motion,
        time=motion.time[first : last + 1],
        wrench=motion.wrench[first:last],
        pose_time=motion.pose_time[inside],
        pose=motion.pose[inside],
        state=motion.state[first : last + 1],
        covariance=motion.covariance[first : last + 1],
    )
