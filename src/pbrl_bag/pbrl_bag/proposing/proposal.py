"""Roles for the streams of a bag, each with the reason for it: types first, then names, then how things moved."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from pbrl_bag.errors import BagError
from pbrl_bag.mapping import FramePose, GraspSource, Mapping, PoseSource, WrenchSource
from pbrl_bag.proposing.candidates import Candidates, PoseCandidate, WrenchCandidate, candidates_of
from pbrl_bag.proposing.efforts import Efforts, efforts_of
from pbrl_bag.proposing.holding import Held, extent, held, while_felt
from pbrl_bag.proposing.words import COMPENSATED, HANDS, NOT_A_NAME, ROBOT, side_of
from pbrl_bag.roles import CONTRACT, roles_of
from pbrl_bag.streams import are_turns
from pbrl_bag.types import Array

STILL = 0.02
"""What reaches less far apart than this [m] did not move."""


@dataclass(frozen=True)
class Proposed:
    """One stream.

    Attributes:
        stream: topic, and the frame on it where it carries several.
        role: as in a mapping, "object_poses.table"; empty: none.
        why: in words.
    """

    stream: str
    role: str
    why: str


@dataclass(frozen=True)
class Proposal:
    """What a bag's streams could be.

    Attributes:
        mapping: None where the bag has the contract's topics and needs none. Bodies have no geometry yet.
        streams: every stream that was looked at.
        left: what has to be told by hand, in sentences.
    """

    mapping: Mapping | None
    streams: tuple[Proposed, ...]
    left: tuple[str, ...] = ()


@dataclass
class _Draft:
    streams: list[Proposed] = field(default_factory=list)
    left: list[str] = field(default_factory=list)
    grippers: dict[str, PoseCandidate] = field(default_factory=dict)
    objects: dict[str, PoseCandidate] = field(default_factory=dict)
    wrenches: dict[str, WrenchCandidate] = field(default_factory=dict)
    efforts: dict[str, Efforts] = field(default_factory=dict)


def propose(path: Path) -> Proposal:
    """Propose roles for the streams of a bag.

    Args:
        path: bag folder or file; no CSV.

    Raises:
        BagError: it cannot be read, or it is a CSV file.
    """
    if path.suffix.lower() == ".csv":
        raise BagError(f"{path}: expected a bag; columns of a CSV file are mapped by hand, see config/mappings/")
    found = candidates_of(path)
    by_contract = {topic: roles_of(topic, CONTRACT) for topic in found.types}
    kinds = {role.kind for roles in by_contract.values() for role in roles}
    if {"object_poses", "wrenches", "grasps", "scene"} <= kinds:
        named = [
            Proposed(topic, f"{role.kind}.{role.name}".rstrip("."), "it is the contract's name for it")
            for topic, roles in sorted(by_contract.items())
            for role in roles
        ]
        return Proposal(None, tuple(named))
    draft = _Draft()
    _wrenches(found, draft)
    _poses(found, draft)
    _efforts(found, draft)
    return Proposal(_mapping(found, draft), tuple(draft.streams), tuple(draft.left))


def _wrenches(found: Candidates, draft: _Draft) -> None:
    """Give each wrench a side, the one that changes most first."""
    liveliest = sorted(found.wrenches.values(), key=lambda each: -float(np.std(each.array()[:, 1:4], axis=0).sum()))
    for each in liveliest:
        told = side_of(f"{each.topic}/{each.frame}")
        side = told or next((other for other in ("left", "right") if other not in draft.wrenches), "")
        if not side or side in draft.wrenches:
            draft.streams.append(Proposed(each.topic, "", f"a wrench, but the {told or 'third'} one has less to say"))
            continue
        draft.wrenches[side] = each
        why = f"a wrench whose name says {told}" if told else f"a wrench; no side in its name, taken for the {side} one"
        draft.streams.append(Proposed(each.topic, f"wrenches.{side}", why))


def _efforts(found: Candidates, draft: _Draft) -> None:
    """Where there is no wrench at all, let the joints of each hand's arm stand in for it."""
    for topic in sorted(found.joints):
        if draft.wrenches:
            draft.streams.append(Proposed(topic, "", "joint efforts, but there is a wrench, which is the better one"))
    if draft.wrenches:
        return
    for side, hand in draft.grippers.items():
        name = (hand.child or "").rsplit("/", 1)[-1]
        efforts = efforts_of(side, name, found.joints, found.descriptions)
        if efforts is not None:
            draft.efforts[side] = efforts
            draft.left += efforts.left
            draft.streams.append(Proposed(efforts.source.topic, f"joint_efforts.{side}", efforts.why))
            if efforts.source.description is not None:
                said = Proposed(efforts.source.description, "description", "a URDF: lengths and weights of the arm")
                draft.streams.append(said)
    if not draft.efforts:
        draft.left.append(
            "no WrenchStamped was found, and no joint efforts of an arm that holds: without a force nothing can be "
            "learned; record the wrist sensor"
        )


def _poses(found: Candidates, draft: _Draft) -> None:
    """Tell grippers and objects apart: by name, and by what moved."""
    parts: list[PoseCandidate] = []
    moved = {key: extent(each.array()) for key, each in found.poses.items()}
    for key in sorted(found.poses, key=lambda key: -moved[key]):
        each, far = found.poses[key], moved[key]
        low, label = each.name.lower(), _label(each)
        if HANDS.search(low):
            sides = draft.wrenches or (("left", "right") if found.joints else ())
            side = side_of(low) or next((s for s in sides if s not in draft.grippers), "")
            if side and side not in draft.grippers:
                draft.grippers[side] = each
                draft.streams.append(Proposed(label, f"gripper_poses.{side}", "its name is that of a hand"))
            else:
                draft.streams.append(Proposed(label, "", "a hand, but that side has one already"))
        elif ROBOT.search(low):
            parts.append(each)
        elif far < STILL:
            draft.streams.append(Proposed(label, "", f"it did not move ({100.0 * far:.1f} cm)"))
        else:
            name = _body_name(each, draft.objects)
            draft.objects[name] = each
            draft.streams.append(
                Proposed(label, f"object_poses.{name}", f"it moved {100.0 * far:.0f} cm and is no part of the robot")
            )
    for each in parts:
        hands = [] if draft.objects else [hand for hand in draft.grippers.values() if hand.frame == each.frame]
        if any(held(each.array(), hand.array()) for hand in hands):
            name = _body_name(each, draft.objects)
            draft.objects[name] = each
            why = "a hand kept its place on it while it moved, though its name is that of a part of the robot"
            draft.streams.append(Proposed(_label(each), f"object_poses.{name}", why))
        else:
            why = "its name is that of a part of the robot or the room"
            draft.streams.append(Proposed(_label(each), "", why))
    if not draft.objects:
        draft.left.append("no pose of a thing that moved was found; name its topic under `object_poses`")
    for side in draft.wrenches:
        if side not in draft.grippers:
            draft.left.append(f"no pose of the {side} sensor was found; name its topic under `gripper_poses`")


def _label(each: PoseCandidate) -> str:
    if each.index is not None:
        return f"{each.topic} ({each.index})"
    return f"{each.topic} ({each.child})" if each.child else each.topic


def _body_name(each: PoseCandidate, taken: dict[str, PoseCandidate]) -> str:
    """Return what to call a body: the last part of its frame or topic that is a name."""
    parts = [part for part in re.split(r"[/]", each.name) if part]
    name = next((part for part in reversed(parts) if not NOT_A_NAME.fullmatch(part)), parts[-1] if parts else "body")
    name = re.sub(r"[^A-Za-z0-9_]+", "_", name).strip("_") or "body"
    name = name if name[0].isalpha() else f"body_{name}"
    return name if name not in taken else f"{name}_{len(taken)}"


def _mapping(found: Candidates, draft: _Draft) -> Mapping:
    """Put the roles together; frames are found by way of what is fixed."""
    frames = [each.frame for each in draft.objects.values()] + [each.frame for each in draft.grippers.values()]
    world = frames[0] if frames else "world"
    places: dict[str, FramePose] = {}
    for frame in dict.fromkeys(frames):
        if frame != world:
            place = place_of(frame, world, found)
            if place is None:
                draft.left.append(f"where {frame!r} is in {world!r} is not in the bag; tell it under `frames`")
            places[frame] = place or FramePose()
    grasps = _grasps(draft, places, found, world)
    if draft.objects and draft.grippers and not grasps:
        draft.left.append("no gripper went along with a thing that moved; tell under `grasps` who held what, and when")
    for name in draft.objects:
        draft.left.append(f"the outline of {name!r} is in no bag; measure it and tell it under `bodies`")
    # A mapping without geometry is no mapping yet: what is checked here are the parts.
    return Mapping.model_construct(
        description="Proposed; read the comments",
        world=world,
        frames=places,
        object_poses={name: _pose_source(each, world) for name, each in draft.objects.items()},
        gripper_poses={side: _pose_source(each, world) for side, each in draft.grippers.items()},
        wrenches={side: _wrench_source(each, world, places) for side, each in draft.wrenches.items()},
        joint_efforts={side: each.source for side, each in draft.efforts.items()},
        grasps=grasps,
    )


def _pose_source(each: PoseCandidate, world: str) -> PoseSource:
    return PoseSource(
        topic=each.topic,
        child_frame=each.child,
        index=each.index,
        frame=None if each.frame == world else each.frame,
        clock_offset=each.clock_offset,
    )


def _wrench_source(each: WrenchCandidate, world: str, places: dict[str, FramePose]) -> WrenchSource:
    axes = each.frame if each.frame in (world, *places) else "sensor"
    on: Literal["gripper", "object"] = "object" if COMPENSATED.search(each.topic.lower()) else "gripper"
    return WrenchSource(topic=each.topic, exerted_on=on, axes=axes, clock_offset=each.clock_offset)


def place_of(frame: str, world: str, found: Candidates) -> FramePose | None:
    """Return where a frame is in another, by way of transforms that never change; None: they do not lead there."""
    steps: dict[str, list[tuple[str, Array, Rotation]]] = {}
    for (parent, child), (position, quaternion) in found.fixed.items():
        turn = Rotation.from_quat(quaternion)
        steps.setdefault(child, []).append((parent, position, turn))
        steps.setdefault(parent, []).append((child, -turn.inv().apply(position), turn.inv()))
    waiting: list[tuple[str, Array, Rotation]] = [(frame, np.zeros(3), Rotation.identity())]
    seen = {frame}
    while waiting:
        here, position, turn = waiting.pop(0)
        if here == world:
            x, y, z = position.tolist()
            qx, qy, qz, qw = turn.as_quat().tolist()
            return FramePose(position=(x, y, z), quaternion=(qx, qy, qz, qw))
        for there, shift, rotation in steps.get(here, ()):
            if there not in seen:
                seen.add(there)
                waiting.append((there, shift + rotation.apply(position), rotation * turn))
    return None


def _grasps(draft: _Draft, places: dict[str, FramePose], found: Candidates, world: str) -> tuple[GraspSource, ...]:
    """Find who held what, from how they moved."""
    firsts = [row[0] for each in _used(draft) for row in each.rows[:1]]
    begun = min([*firsts, *(each.begins for each in draft.efforts.values())], default=0.0)
    grasps = []
    for side, gripper in draft.grippers.items():
        felt = draft.wrenches[side].array() if side in draft.wrenches else None
        if side in draft.efforts:
            felt = draft.efforts[side].felt
        elif felt is None:
            continue
        options: list[tuple[str, Held]] = []
        for name, each in draft.objects.items():
            together = held(_in_world(each, places), _in_world(gripper, places))
            if together is not None:
                options.append((name, together if felt is None else while_felt(together, felt)))
        if not options:
            continue
        name, best = max(options, key=lambda pair: (pair[1].share, pair[1].end - pair[1].start))
        x, y = (round(float(value), 3) for value in best.contact)
        start, end = round(max(best.start - begun, 0.0), 3), round(best.end - begun, 3)
        grasps.append(
            GraspSource(
                gripper="left" if side == "left" else "right", object=name, contact=(x, y), start=start, end=end
            )
        )
    return tuple(grasps)


def _used(draft: _Draft) -> list[PoseCandidate | WrenchCandidate]:
    return [*draft.objects.values(), *draft.grippers.values(), *draft.wrenches.values()]


def _in_world(each: PoseCandidate, places: dict[str, FramePose]) -> Array:
    """Return the poses (n, 8) of a candidate in the mapping's world."""
    rows = each.array()
    if each.frame not in places:
        return rows
    place = places[each.frame]
    turn = Rotation.from_quat(place.quaternion)
    rows[:, 1:4] = turn.apply(rows[:, 1:4]) + np.array(place.position)
    turned = are_turns(rows[:, 4:8])
    if turned.any():
        rows[turned, 4:8] = (turn * Rotation.from_quat(rows[turned, 4:8])).as_quat()
    return rows
