"""A door that was pulled along a path that is known: force along the path, by the angle of the hinge.

Where a recording has no torque and no orientation, and its time stamps are poor, accelerations cannot be trusted and a
simulation forward in time has nothing to hold on to. Positions and forces are sound: a door is pulled slowly, so the
force along the path is what friction, catches and springs oppose to it; the force across the path is the hinge's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import Recording
from pbrl_mismatch.errors import MismatchError
from pbrl_model.fitting.episodes import motions_of
from pbrl_model.fitting.guesses import circle
from pbrl_model.sensing.motion import Motion

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

CELL = np.radians(0.2)
"""Samples are averaged over so much of the way [rad], so that waiting on the spot adds nothing to what is known."""
REVERSAL = np.radians(0.5)
"""A door that goes back by less than this has not turned round [rad]."""
LEAST_WAY, LEAST_CELLS = np.radians(10.0), 40
LEAST_FORCE = 1e-9
REFINEMENTS = 20


@dataclass(frozen=True)
class Hinge:
    """Where a door turns.

    Attributes:
        centre: (2,) [m], world.
        radius: from there to the handle [m].
        sd: (3,) standard deviations of centre x, y and radius [m].
        off: root mean square distance of the handle from the circle [m].
        zero: direction of the handle as seen from the hinge where the angle is zero [rad], world.
        sense: +1 where it opens counter-clockwise, -1 clockwise.
    """

    centre: Array
    radius: float
    sd: Array
    off: float
    zero: float
    sense: float


@dataclass(frozen=True)
class Pull:
    """What was felt along the way of a door, in n cells of equal way.

    Attributes:
        object: its name.
        hinge: where it turns.
        angle: (n,) by which it was open [rad]; zero at the first recorded pose, growing as it opens.
        force: (n,) along the path on the door [N], positive where it opens.
        across: (n,) outwards from the hinge [N].
        speed: (n,) of the handle along the path [m/s], positive where it opens.
        sense: (n,) +1 while it opens, -1 while it closes.
        time: (n,) [s].
        travelled: (n,) way since its pull began [rad].
        number: (n,) which pull it belongs to.
    """

    object: str
    hinge: Hinge
    angle: Array
    force: Array
    across: Array
    speed: Array
    sense: Array
    time: Array
    travelled: Array
    number: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.angle)

    @property
    def reach(self) -> float:
        """Return how far it was opened [rad]."""
        return float(np.ptp(self.angle))

    @cached_property
    def step(self) -> Array:
        """Return (n,) way since the cell before [rad]; infinite where a pull begins."""
        step = np.diff(self.travelled, prepend=0.0)
        step[np.diff(self.number, prepend=-1) != 0] = np.inf
        return step

    @cached_property
    def strength(self) -> float:
        """Return the largest force along the path [N]; priors are scaled by it."""
        return float(np.abs(self.force).max())

    def take(self, chosen: Mask) -> Pull:
        """Return the chosen cells; the way that was travelled stays as it was."""
        names = ("angle", "force", "across", "speed", "sense", "time", "travelled", "number")
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})


def is_pull(recording: Recording) -> bool:
    """Tell whether nothing but a point's path and the force there was recorded: no orientation, no torque."""
    names = {grasp.object for grasp in recording.grasps}
    grippers = {grasp.gripper for grasp in recording.grasps}
    turns = [recording.object_poses[name].quaternion for name in names if name in recording.object_poses]
    torques = [recording.wrenches[name].torque for name in grippers if name in recording.wrenches]
    seen = any(bool(np.isfinite(each).any()) for each in (*turns, *torques))
    return bool(turns) and bool(torques) and not seen


def pull_of(recording: Recording, name: str) -> Pull:
    """Return what was felt along the way of one door.

    Raises:
        MismatchError: it did not turn about a hinge far enough, or nothing was felt.
        ModelError: a stream is missing or broken.
        BagError: an episode is malformed.
    """
    motions = motions_of(recording, name)
    hinge = hinge_of(name, motions)
    parts = [_cells(motion, hinge) for motion in motions]
    number = np.repeat(np.arange(len(parts)), [len(part[0]) for part in parts])
    angle, force, across, speed, sense, time, travelled = (np.concatenate(each) for each in zip(*parts, strict=True))
    pull = Pull(name, hinge, angle, force, across, speed, sense, time, travelled, number)
    if pull.reach < LEAST_WAY or len(pull) < LEAST_CELLS:
        raise MismatchError(
            f"{name}: expected a door opened by at least {np.degrees(LEAST_WAY):.0f} degrees, "
            f"got {np.degrees(pull.reach):.2g}; pull it further"
        )
    if pull.strength < LEAST_FORCE:
        raise MismatchError(f"{name}: expected a force while it was pulled, got zero throughout; was the sensor on?")
    return pull


def hinge_of(name: str, motions: Sequence[Motion]) -> Hinge:
    """Return the hinge about which the recorded places lie.

    Raises:
        MismatchError: they lie on a line.
    """
    found = circle(motions)
    if found is None:
        raise MismatchError(f"{name}: expected a motion that is not along a line for a hinge, got one that is")
    places = np.concatenate([motion.pose[:, :2] for motion in motions])
    at = np.array([*found[0], found[1]])
    for _ in range(REFINEMENTS):  # Gauss-Newton of the distances; the first guess weighs far places too much
        away = places - at[:2]
        distance = np.hypot(*away.T)
        slope = np.column_stack([-away / distance[:, None], -np.ones(len(away))])
        left = distance - at[2]
        move = np.linalg.lstsq(slope, left, rcond=None)[0]
        at = at - move
        if np.abs(move).max() < 1e-9:
            break
    turn = np.unwrap(np.arctan2(*(places - at[:2]).T[::-1]))
    # Neighbours err together: one independent place for every five degrees of arc.
    independent = max(np.ptp(turn) / np.radians(5.0), 4.0)
    off = float(np.sqrt(np.mean(left**2)))
    covariance = np.linalg.pinv(slope.T @ slope) * len(places) / independent * off**2
    furthest = int(np.argmax(np.abs(turn - turn[0])))
    sense = 1.0 if turn[furthest] >= turn[0] else -1.0
    return Hinge(at[:2], float(at[2]), np.sqrt(np.diag(covariance)), off, float(turn[0]), sense)


def _cells(motion: Motion, hinge: Hinge) -> tuple[Array, ...]:
    """Return one pull in cells of equal way."""
    state = 0.5 * (motion.state[1:] + motion.state[:-1])
    outward = state[:, :2] - hinge.centre
    outward = outward / np.hypot(*outward.T)[:, None]
    along = hinge.sense * np.column_stack([-outward[:, 1], outward[:, 0]])
    turn = np.arctan2(outward[:, 1], outward[:, 0])
    angle = hinge.sense * (np.unwrap(turn) - hinge.zero)
    angle -= 2.0 * np.pi * np.round(angle[0] / (2.0 * np.pi))
    force, across = (np.einsum("ni,ni->n", motion.wrench[:, :2], axis) for axis in (along, outward))
    speed = np.einsum("ni,ni->n", state[:, 3:5], along)
    middle = 0.5 * (motion.time[1:] + motion.time[:-1])
    travelled = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(angle)))])
    cell = np.floor(travelled / CELL).astype(np.int64)
    _, number, count = np.unique(cell, return_inverse=True, return_counts=True)
    columns = (angle, force, across, speed, senses(angle), middle, travelled)
    means = [np.bincount(number, each) / count for each in columns]
    means[4] = np.where(means[4] >= 0.0, 1.0, -1.0)
    return tuple(means)


def senses(angle: Array) -> Array:
    """Return (n,) +1 where an angle grows, -1 where it falls; it must go back by `REVERSAL` to have turned round."""
    out = np.ones(len(angle))
    sense, far = 1.0, angle[0]
    for n, now in enumerate(angle.tolist()):
        if sense * (now - far) >= 0.0:
            far = now
        elif sense * (far - now) > REVERSAL:
            sense, far = -sense, now
        out[n] = sense
    return out
