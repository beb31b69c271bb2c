"""Pushes that a robot could make: contact points on the outline, directions, speeds and durations within its reach."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon, contains, distance, make_valid, polygons

from pbrl_mismatch.data.track import Track
from pbrl_mismatch.errors import MismatchError

Array = NDArray[np.float64]

WAYPOINTS = 5
"""Places along a push at which the footprint has to lie in the room."""


@dataclass(frozen=True)
class Reach:
    """What a robot can do.

    Attributes:
        contacts: places on the outline that are tried, spread evenly along it.
        directions: tried at each of them, spread evenly over the circle, the first along the body's x axis.
        speeds: of the hand [m/s].
        durations: of a push [s].
        most: candidates that are simulated; more than those are thinned out at random.
        gripped: whether the hand holds the edge; otherwise it pushes with a finger within its friction cone.
        friction: coefficient between finger and edge, where it is not gripped.
        most_force: of the hand [N].
        most_torque: of the hand [N m], where it is gripped.
        stiffness: of the arm [N/m], at most; see `hand_of`.
        turn_stiffness: of the wrist about the vertical [N m/rad], at most.
        room: (k, 2) outline of the free floor in world [m], or None: no limit.
        margin: between footprint and walls [m].

    Raises:
        MismatchError: a limit is not above zero, or nothing is to be tried.
    """

    contacts: int = 8
    directions: int = 8
    speeds: tuple[float, ...] = (0.05, 0.12)
    durations: tuple[float, ...] = (2.0, 4.0)
    most: int = 256
    gripped: bool = True
    friction: float = 0.4
    most_force: float = 80.0
    most_torque: float = 15.0
    stiffness: float = 4000.0
    turn_stiffness: float = 80.0
    room: Array | None = None
    margin: float = 0.1

    def __post_init__(self) -> None:
        limits = (*self.speeds, *self.durations, self.most_force, self.most_torque, self.stiffness, self.turn_stiffness)
        if not all(math.isfinite(value) and value > 0.0 for value in (*limits, self.friction)) or self.margin < 0.0:
            raise MismatchError(f"reach: expected finite speeds, durations and limits above zero, got {self}")
        if min(self.contacts, self.directions, self.most, len(self.speeds), len(self.durations)) < 1:
            raise MismatchError("reach: expected at least one contact, direction, speed and duration to try, got none")
        if self.room is not None and (self.room.ndim != 2 or self.room.shape[1] != 2 or len(self.room) < 3):
            raise MismatchError(f"reach: expected a room's outline (k, 2) with k >= 3, got shape {self.room.shape}")


@dataclass(frozen=True)
class Candidates:
    """C pushes.

    Attributes:
        contact: (C, 2) in the body's frame [m].
        normal: (C, 2) of the outline there, inwards, in the body's frame.
        direction: (C, 2) of the hand's way, world axes, of unit length.
        speed: (C,) [m/s].
        duration: (C,) [s].
    """

    contact: Array
    normal: Array
    direction: Array
    speed: Array
    duration: Array

    def __len__(self) -> int:
        return len(self.speed)

    def take(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Candidates:
        """Return some of the pushes."""
        return Candidates(
            self.contact[rows], self.normal[rows], self.direction[rows], self.speed[rows], self.duration[rows]
        )


def candidates_of(rng: np.random.Generator, track: Track, reach: Reach) -> Candidates:
    """Return the pushes within reach from where the object was last seen; none where it stands in the way of all.

    Args:
        rng: thins them out where there are more than `reach.most`.
        track: the last pose is where a push begins.
        reach: what the robot can do.
    """
    contact, normal = outline_points(track.outline, reach.contacts)
    yaw = float(track.seen[-1, 2])
    angle = yaw + np.arange(reach.directions) * (2.0 * math.pi / reach.directions)
    grid = np.meshgrid(
        np.arange(len(contact)),
        np.arange(len(angle)),
        np.arange(len(reach.speeds)),
        np.arange(len(reach.durations)),
        indexing="ij",
    )
    place, turn, fast, long = (each.ravel() for each in grid)
    all_of_them = Candidates(
        contact[place],
        normal[place],
        np.stack([np.cos(angle[turn]), np.sin(angle[turn])], -1),
        np.array(reach.speeds)[fast],
        np.array(reach.durations)[long],
    )
    within = all_of_them.take(_reached(all_of_them, track, reach))
    if len(within) <= reach.most:
        return within
    return within.take(np.sort(rng.choice(len(within), reach.most, replace=False)))


def outline_points(outline: Array, count: int) -> tuple[Array, Array]:
    """Return points (count, 2) spread evenly along an outline (k, 2), and inward normals."""
    ends = np.roll(outline, -1, axis=0)
    lengths = np.hypot(*(ends - outline).T)
    edges = np.concatenate([[0.0], np.cumsum(lengths)])
    where = (np.arange(count) + 0.5) * edges[-1] / count
    number = np.clip(np.searchsorted(edges, where, side="right") - 1, 0, len(outline) - 1)
    along = (ends - outline)[number] / lengths[number, None]
    return outline[number] + (where - edges[number])[:, None] * along, np.stack([-along[:, 1], along[:, 0]], -1)


def _reached(pushes: Candidates, track: Track, reach: Reach) -> NDArray[np.bool_]:
    """Return (C,) which pushes an open hand can make, and which stay in the room."""
    x, y, yaw = _pose(track)
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    fine = np.ones(len(pushes), dtype=bool)
    if not reach.gripped:
        into = np.sum(pushes.direction * (pushes.normal @ turn.T), axis=1)
        fine &= into > 1.0 / math.sqrt(1.0 + reach.friction**2)
    if reach.room is not None:
        footprint = track.outline @ turn.T + [x, y]
        room = make_valid(Polygon(reach.room))
        way = pushes.direction * (pushes.speed * pushes.duration)[:, None]
        for share in np.linspace(0.0, 1.0, WAYPOINTS)[1:]:
            there = polygons(footprint[None] + share * way[:, None])
            # Not its corners alone: the corner of a wall may reach into it.
            fine &= contains(room, there) & (distance(room.boundary, there) >= reach.margin)
    return fine


def _pose(track: Track) -> tuple[float, float, float]:
    """Return where the object's frame was last seen (x, y, theta)."""
    x, y, yaw = track.seen[-1, :3]
    c, s = math.cos(yaw), math.sin(yaw)
    return (
        float(x - c * track.body[1] + s * track.body[2]),
        float(y - s * track.body[1] - c * track.body[2]),
        float(yaw),
    )
