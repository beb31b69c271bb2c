"""What a body met on its way: a force that sets in after the body had moved freely, where, and which way it acts.

Seconds of a push that ended as soon as it went wrong do not say what was met: a wall, a cord that has become taut and
the edge of a carpet all begin as a force against the motion. When it set in, along which line it acts and in which
direction can be told from the left-out wrench, and to know that much is enough not to go there again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_bag.types import Recording
from pbrl_mismatch.data.residual import residual_wrench
from pbrl_mismatch.data.track import Track, origin_of
from pbrl_mismatch.diagnose import track_of
from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_model.predict import UNKNOWN_MASS

Array = NDArray[np.float64]

ROLLING = 0.02
"""Friction coefficient of a thing on casters. One that slides on feet has more: then what it meets has to stand out
from that, or it is not told as met."""
FREELY = 0.04
"""So far some corner of the body has to have gone before [m]."""
LEAST, RATIO, SURE = 20.0, 1.8, 4.0
"""The force that sets in [N], over the greatest that was left out before, and over its own standard deviation."""
HALF = 0.5
"""Of the greatest force: when it has risen to this share it has set in."""


@dataclass(frozen=True)
class Encounter:
    """A force that set in on the way.

    Attributes:
        time: when it set in, on the recording's clock [s].
        begun: (3,) pose of the body's frame then, in `world` [m, rad].
        pose: (3,) of it when the force was greatest, likewise.
        point: (2,) of the body's frame on the line along which it acts, on the outline where that line comes in [m].
        direction: (2,) of the force on the body, a unit vector in `world`.
        force: its size [N].
        before: the greatest that was left out while the body still moved freely [N].
    """

    time: float
    begun: Array
    pose: Array
    point: Array
    direction: Array
    force: float
    before: float

    @property
    def place(self) -> Array:
        """Return where `point` was (2,) in `world` [m]."""
        c, s = np.cos(self.pose[2]), np.sin(self.pose[2])
        return np.asarray(self.pose[:2] + np.array([[c, -s], [s, c]]) @ self.point)

    def told(self) -> str:
        """Return it in a sentence."""
        x, y = self.place
        return (
            f"met something near ({x:.2f}, {y:.2f}) m: {self.force:.0f} N set in after it had moved freely, "
            f"with at most {self.before:.0f} N left out"
        )


def find_encounter(recording: Recording, name: str) -> Encounter | None:
    """Return what a body met in the last hold of it, or None: nothing set in, or it never moved freely.

    Where a sensor was at the end of its range, what was met pushed this hard at least, and that is what is looked for;
    all else that is missing stays unknown.

    Args:
        recording: with the hold.
        name: of the body.

    Raises:
        MismatchError: nothing was felt while it was held, or something else was held in its place.
        ModelError: a stream is broken, or the body never moved.
    """
    track = track_of(recording, name)
    track = replace(track, missing=tuple(each for each in track.missing if not each.saturated))
    row = neutral_row()
    row[COLUMN["mass"]] = track.nominal_mass if np.isfinite(track.nominal_mass) else UNKNOWN_MASS
    row[COLUMN["mu_ground"]] = ROLLING
    found = residual_wrench(track, row)
    begin, last = int(track.begin[-1]), int(track.last[-1])
    forces = np.hypot(*found.world[begin : last + 1, :2].T)
    peak = int(np.argmax(forces))
    below = np.flatnonzero(forces[:peak] < HALF * forces[peak])
    if not len(below):
        return None
    onset = int(below[-1])
    before = float(forces[:onset].max(initial=0.0))
    deviation = float(np.sqrt(np.trace(found.covariance[begin + peak, :2, :2]) / 2.0))
    if forces[peak] < max(LEAST, RATIO * before, SURE * deviation):
        return None
    origins = [origin_of(state, track.body[1:3]) for state in track.seen[begin : begin + peak + 1]]
    if _went(track.outline, origins[0], origins[onset]) < FREELY:
        return None
    pose, wrench = origins[-1], found.world[begin + peak]
    return Encounter(
        float(track.clock[begin + onset]),
        origins[onset],
        pose,
        _point(track, pose, found.state[begin + peak], wrench),
        wrench[:2] / forces[peak],
        float(forces[peak]),
        before,
    )


def _went(outline: Array, a: Array, b: Array) -> float:
    """Return how far the corner of an outline (k, 2) that went furthest is between two poses (3,) [m]."""
    return float(np.hypot(*(_at(outline, a) - _at(outline, b)).T).max())


def _at(points: Array, pose: Array) -> Array:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray(points @ np.array([[c, s], [-s, c]]) + pose[:2])


def _point(track: Track, pose: Array, state: Array, wrench: Array) -> Array:
    """Return where the wrench's line of action enters the outline (2,), in the body's frame [m].

    Where it misses the outline, the outline's point nearest to it.
    """
    fx, fy, torque = wrench
    size = float(np.hypot(fx, fy))
    ahead = np.array([fx, fy]) / size
    foot = state[:2] + np.array([torque * fy, -torque * fx]) / size**2
    outline = shapely.Polygon(_at(track.outline, pose))
    reach = 2.0 * outline.length
    line = shapely.LineString([foot - reach * ahead, foot + reach * ahead])
    crossed = shapely.get_coordinates(line.intersection(outline))
    if len(crossed):
        place = crossed[int(np.argmin(crossed @ ahead))]
    else:
        place = shapely.get_coordinates(shapely.shortest_line(outline, line))[0]
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray(np.array([[c, s], [-s, c]]) @ (place - pose[:2]))
