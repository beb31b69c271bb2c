"""Grasps: from the messages that tell of changes to intervals in which one gripper held one object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from pbrl_bag.decoding import seconds
from pbrl_bag.errors import BagError
from pbrl_bag.mapping import GraspSource
from pbrl_bag.streams import read_only
from pbrl_bag.types import Grasp

GRIPPERS = ("left", "right")


@dataclass(frozen=True)
class GraspChange:
    """Who holds what from `time` [s] on: gripper -> (object, contact x, contact y)."""

    time: float
    held: dict[str, tuple[str, float, float]]


def change_in(topic: str, message: Any) -> GraspChange:
    """Read a pbrl_msgs/Grasps.

    Raises:
        BagError: not a Grasps message, an unknown gripper, one gripper holding two objects, NaN.
    """
    if not (hasattr(message, "grasps") and hasattr(message, "header")):
        raise BagError(f"{topic}: expected pbrl_msgs/Grasps, got {type(message).__name__}")
    time = seconds(message.header.stamp)
    held: dict[str, tuple[str, float, float]] = {}
    for grasp in message.grasps:
        side = str(grasp.gripper)
        if side not in GRIPPERS:
            raise BagError(f"{topic}: t = {time:.6f} s: gripper: expected 'left' or 'right', got {side!r}")
        if side in held:
            raise BagError(f"{topic}: t = {time:.6f} s: gripper: {side!r} holds two objects at once")
        contact = (float(grasp.contact_point.x), float(grasp.contact_point.y))
        if not np.isfinite(contact).all():
            raise BagError(f"{topic}: t = {time:.6f} s: contact_point: expected finite numbers, got {contact}")
        held[side] = (str(grasp.object), *contact)
    return GraspChange(time, held)


def grasps_from_changes(topic: str, changes: Sequence[GraspChange], end: float) -> tuple[Grasp, ...]:
    """Return the intervals between changes; what is still held at the end is held until `end` [s].

    Raises:
        BagError: the changes go backwards in time.
    """
    done: list[Grasp] = []
    open_since: dict[str, float] = {}
    held: dict[str, tuple[str, float, float]] = {}
    last = -np.inf
    for change in changes:
        if change.time < last:
            raise BagError(
                f"{topic}: t = {change.time:.6f} s: stamp: time goes backwards by {last - change.time:.6f} s; "
                "was the clock reset? Cut the recording there"
            )
        last = change.time
        for side in GRIPPERS:
            if held.get(side) != change.held.get(side):
                if side in held:
                    done.append(_grasp(side, held[side], open_since[side], change.time))
                open_since[side] = change.time
        held = change.held
    done += [_grasp(side, held[side], open_since[side], max(end, open_since[side])) for side in held]
    return tuple(sorted(done, key=lambda grasp: (grasp.start, grasp.gripper)))


def grasps_from_mapping(sources: Sequence[GraspSource], start: float, end: float) -> tuple[Grasp, ...]:
    """Return the grasps that a mapping tells of.

    Args:
        sources: `grasps` of the mapping, times in seconds after `start`.
        start: time of the recording's first sample [s].
        end: time of its last [s].

    Raises:
        BagError: a grasp lies outside the recording, or one gripper holds two things at once.
    """
    grasps = []
    for source in sources:
        first = start if source.start is None else start + source.start
        last = end if source.end is None else start + source.end
        if first < start or last > end:
            raise BagError(
                f"grasps: {source.gripper} on {source.object!r}: expected a time between 0 and {end - start:.3f} s, "
                f"got {first - start:.3f} to {last - start:.3f} s"
            )
        grasps.append(_grasp(source.gripper, (source.object, *source.contact), first, last))
    grasps.sort(key=lambda grasp: (grasp.start, grasp.gripper))
    for side in GRIPPERS:
        own = [grasp for grasp in grasps if grasp.gripper == side]
        for one, following in pairwise(own):
            if following.start < one.end:
                raise BagError(
                    f"grasps: expected one object at a time in gripper {side!r}, got {one.object!r} until "
                    f"{one.end - start:.3f} s and {following.object!r} from {following.start - start:.3f} s on"
                )
    return tuple(grasps)


def _grasp(side: str, held: tuple[str, float, float], start: float, end: float) -> Grasp:
    """Make one grasp."""
    return Grasp(side, held[0], start, end, read_only(np.array(held[1:])))
