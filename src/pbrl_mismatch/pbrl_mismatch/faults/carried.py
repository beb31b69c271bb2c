"""Whether what is said to be held goes along with its gripper: two objects swapped, a grasp told of the wrong one.

A point of the gripper stays at the contact, to millimetres, though an edge may turn between plates; against any other
body it moves as far as the gripper does. So poses that carry the wrong name, and grasps that name the wrong object, are
seen without a model of anything.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import Grasp, PoseStream, Recording
from pbrl_mismatch.errors import MismatchError
from pbrl_model.sensing.clock import planar_yaw
from pbrl_model.transforms import plane_rotations

Array = NDArray[np.float64]

SLID, SHARE = 0.06, 0.2
"""A hold that slides further than the first [m], and than this share of the way of gripper or object, is none."""
ALONG, LEVER = 0.03, 0.3
"""What turns about a pin in the gripper to this root mean square goes along with it; how far off pins are [m]."""
BEGIN = 0.6
"""The gripper's own point at the contact is taken from the first so many seconds [s]."""
NEAR = 0.25
"""A pose counts for times that are so close to a reading [s]."""
LEAST = 6
STILL, WENT = 0.03, 0.15
"""Where no gripper is seen: what stays within the first is not what was pushed, if another exceeds the second [m]."""


@dataclass(frozen=True)
class Pair:
    """Planar poses (n, 3) of a gripper and of a body at the same times (n,) [s]."""

    time: Array
    gripper: Array
    body: Array


def check_carried(recording: Recording, name: str) -> None:
    """Check that an object goes along with the grippers that are said to hold it.

    Args:
        recording: as read.
        name: of the object.

    Raises:
        MismatchError: it does not; says from when on, and what goes along in its place.
    """
    for grasp in recording.grasps:
        if grasp.object != name or name not in recording.object_poses:
            continue
        gripper = recording.gripper_poses.get(grasp.gripper)
        if gripper is None:
            _check_moved(recording, grasp)
            continue
        pair = paired(recording.object_poses[name], gripper, grasp.start, grasp.end)
        if pair is None:
            continue
        since, far = _slide(pair, grasp.contact)
        way = max(_extent(gripper, grasp), _extent(recording.object_poses[name], grasp))
        # A tag that is glued on elsewhere than thought, or a contact that is told wrongly, is no other body.
        if far > max(SLID, SHARE * way) and _lasting(_off_any_pin(pair)).max() > SLID:
            raise MismatchError(_said(recording, grasp, since, far))


def paired(body: PoseStream, gripper: PoseStream, start: float, end: float) -> Pair | None:
    """Return poses of gripper and body at the gripper's times; None where too little was seen of either.

    Args:
        body: with its orientation.
        gripper: with its orientation.
        start: [s].
        end: [s].
    """
    yaw, turn = planar_yaw(body.quaternion), planar_yaw(gripper.quaternion)
    seen, inside = np.isfinite(yaw), (gripper.time >= start) & (gripper.time <= end) & np.isfinite(turn)
    if seen.sum() < LEAST or inside.sum() < LEAST:
        return None
    time, there = body.time[seen], gripper.time[inside]
    after = np.clip(np.searchsorted(time, there), 1, len(time) - 1)
    close = (np.abs(time[after] - there) <= NEAR) & (np.abs(there - time[after - 1]) <= NEAR)
    if close.sum() < LEAST:
        return None
    columns = np.column_stack([body.position[:, :2], yaw])[seen]
    poses = np.stack([np.interp(there[close], time, column) for column in columns.T], -1)
    return Pair(there[close], np.column_stack([gripper.position[:, :2], turn])[inside][close], poses)


def off_pin(pair: Pair) -> float:
    """Return the root mean square by which a body does not turn about any pin in the gripper [m]."""
    return float(np.sqrt(np.mean(_off_any_pin(pair) ** 2)))


def _off_any_pin(pair: Pair) -> Array:
    """Return (n,) how far a body is off the pin in the gripper about which it turns best [m]."""
    count = len(pair.time)
    matrix = np.zeros((2 * count + 2, 4))
    matrix[: 2 * count, :2] = plane_rotations(pair.body[:, 2]).reshape(-1, 2)
    matrix[: 2 * count, 2:] = -plane_rotations(pair.gripper[:, 2]).reshape(-1, 2)
    # A weak belief keeps the pin near the gripper where nothing turns and it could be anywhere.
    matrix[2 * count :, 2:] = ALONG / LEVER * np.eye(2)
    apart = np.concatenate([(pair.gripper - pair.body)[:, :2].ravel(), [0.0, 0.0]])
    pins = np.linalg.lstsq(matrix, apart, rcond=None)[0]
    return np.asarray(np.linalg.norm((matrix @ pins - apart)[: 2 * count].reshape(-1, 2), axis=1))


def _slide(pair: Pair, contact: Array) -> tuple[float, float]:
    """Return since when and how far [m] the gripper's point is off the contact, single wrong readings left out."""
    there = pair.body[:, :2] + plane_rotations(pair.body[:, 2]) @ contact[:2]
    back = np.swapaxes(plane_rotations(pair.gripper[:, 2]), 1, 2)
    own = np.einsum("nij,nj->ni", back, there - pair.gripper[:, :2])
    own = np.median(own[pair.time <= pair.time[0] + BEGIN], axis=0)
    off = np.linalg.norm(pair.gripper[:, :2] + plane_rotations(pair.gripper[:, 2]) @ own - there, axis=1)
    lasting = _lasting(off)
    gone = np.flatnonzero(lasting > SLID)
    return float(pair.time[gone[0] if len(gone) else 0]), float(lasting.max())


def _lasting(off: Array) -> Array:
    """Return (n - 2,) what three neighbours of (n,) have at least."""
    return np.asarray(np.minimum.reduce([off[:-2], off[1:-1], off[2:]]))


def _said(recording: Recording, grasp: Grasp, since: float, far: float) -> str:
    others = list(_goes_along(recording, grasp, since))
    where = f"{recording.path}: {grasp.object}: expected it to go along with the {grasp.gripper} gripper that holds it"
    got = f"got one that is {far:.2f} m off its hold, from t = {since:.2f} s on"
    if others:
        return (
            f"{where}, {got}, while {' and '.join(others)} goes along: are their poses swapped, or is the grasp told "
            "of the wrong object?"
        )
    return f"{where}, {got}; is its tag the right one, and did the gripper lose it? cut the recording there"


def _goes_along(recording: Recording, grasp: Grasp, since: float) -> Iterator[str]:
    gripper = recording.gripper_poses[grasp.gripper]
    for name, stream in recording.object_poses.items():
        pair = paired(stream, gripper, since + NEAR, grasp.end) if name != grasp.object else None
        if pair is not None and off_pin(pair) < ALONG:
            yield name


def _check_moved(recording: Recording, grasp: Grasp) -> None:
    """Raise where an object stands while another one moves, and no gripper was seen that would say which is held."""
    ways = {name: _extent(stream, grasp) for name, stream in recording.object_poses.items()}
    held = {each.object for each in recording.grasps if each.start < grasp.end and each.end > grasp.start}
    others = [name for name, way in ways.items() if name not in held and way > WENT]
    if ways[grasp.object] < STILL and others:
        raise MismatchError(
            f"{recording.path}: {grasp.object}: expected it to move while it is held from t = {grasp.start:.2f} s on, "
            f"got one that stands, while {' and '.join(others)} moves: are their poses swapped, or is the grasp told "
            "of the wrong object?"
        )


def _extent(stream: PoseStream, grasp: Grasp) -> float:
    """Return how far poses lie apart during a grasp, along the longer axis [m], a tenth of them left out as wrong."""
    inside = (stream.time >= grasp.start) & (stream.time <= grasp.end)
    if inside.sum() < 2:
        return 0.0
    low, high = np.quantile(stream.position[inside][:, :2], [0.05, 0.95], axis=0)
    return float(np.max(high - low))
