"""What that is known was within touch of an object: other bodies that were told of, and the walls of the room.

No law has them: a table that is pushed against another one lacks a force at that moment, which is no physics that was
left out but a thing that is known, and a name such as `unseen_body` would be one for it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_bag.types import BodyGeometry, Recording
from pbrl_mismatch.data.track import Track, origin_of
from pbrl_model.sensing.clock import planar_yaw
from pbrl_model.transforms import plane_rotations

Array = NDArray[np.float64]

TOUCH = 0.02
"""Outlines that are so near may touch [m]: as well as tags and outlines are known."""
EVERY = 0.05
"""It is asked so often [s]."""
WALL = "the wall"
MOSTLY = 0.5
"""Something known that is in touch for at least this share of the time in which a wrench stands out is told."""


@dataclass(frozen=True)
class Contact:
    """Something known that was within touch while the wrench was there.

    Attributes:
        body: its name, or the wall.
        share_there: of the time in which the wrench was there, that in which it was in touch.
        share_touching: of the time in which it was in touch, that in which the wrench was there.
    """

    body: str
    share_there: float
    share_touching: float


def contacts_of(recording: Recording, track: Track, there: NDArray[np.bool_]) -> tuple[Contact, ...]:
    """Return what was in touch for some of the time in which a wrench was there, the longest first.

    Args:
        recording: with the other bodies and the room.
        track: of the object, in T steps.
        there: (T,) whether the wrench was there.
    """
    rows = np.arange(0, len(track.clock), max(1, round(EVERY / track.dt)))
    poses = np.array([origin_of(state[:3], track.body[1:3]) for state in track.seen[rows]])
    own = _outlines(track.outline, poses)
    others = {
        name: _outlines(body.footprint, _poses(recording, body, track.clock[rows]))
        for name, body in recording.bodies.items()
        if name != track.object
    }
    near = {name: shapely.distance(own, outlines) < TOUCH for name, outlines in others.items()}
    if len(recording.room) > 2:
        room = shapely.Polygon(recording.room)
        near[WALL] = (shapely.distance(own, room.exterior) < TOUCH) | ~shapely.within(own, room)
    found = [
        Contact(name, float(touching[there[rows]].mean()), float(there[rows][touching].mean()))
        for name, touching in near.items()
        if there[rows].any() and touching.any() and (touching & there[rows]).any()
    ]
    return tuple(sorted(found, key=lambda each: -each.share_there))


def contact_notes(name: str, contacts: tuple[Contact, ...]) -> list[str]:
    """Say what a name may be that is known already.

    Args:
        name: of the object.
        contacts: of it.
    """
    return [
        f"for {100.0 * each.share_there:.0f} % of the time in which something is left out, {name} was within "
        f"{100.0 * TOUCH:.0f} cm of {each.body}, which is known and in no model: what is named may be that"
        for each in contacts
        if each.share_there >= MOSTLY
    ]


def _outlines(footprint: Array, poses: Array) -> NDArray[np.object_]:
    """Return polygons (n,) of a footprint (k, 2) at poses (n, 3)."""
    corners = np.einsum("nij,kj->nki", plane_rotations(poses[:, 2]), footprint) + poses[:, None, :2]
    return np.asarray(shapely.polygons(corners))


def _poses(recording: Recording, body: BodyGeometry, times: Array) -> Array:
    """Return where another body was (n, 3): as it was seen last, else where it was told to be."""
    seen = recording.object_poses.get(body.name)
    if seen is None or not len(seen.time):
        return np.tile(body.pose, (len(times), 1))
    last = np.clip(np.searchsorted(seen.time, times, side="right") - 1, 0, None)
    yaw = planar_yaw(seen.quaternion)
    known = np.flatnonzero(np.isfinite(yaw))
    yaw = (
        np.full(len(seen.time), body.pose[2])
        if not len(known)
        else np.interp(np.arange(len(yaw)), known, np.unwrap(yaw[known]))
    )
    return np.column_stack([seen.position[last, :2], yaw[last]])
