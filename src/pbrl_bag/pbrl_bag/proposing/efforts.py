"""Joint efforts in place of a wrench that a bag does not have: which joints, and down to which link."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from pbrl_bag.errors import BagError
from pbrl_bag.joint_efforts import JointSamples
from pbrl_bag.joint_efforts.solving import tip_wrenches
from pbrl_bag.joint_efforts.stream import arm_of, tip_torques
from pbrl_bag.mapping import EffortSource
from pbrl_bag.proposing.candidates import JointCandidate
from pbrl_bag.proposing.words import HANDS, side_of
from pbrl_bag.types import Array

UNKNOWN = Path("robot.urdf")
"""What stands for a description that is not in the bag."""


@dataclass(frozen=True)
class Efforts:
    """What could stand in for the wrench of one gripper.

    Attributes:
        source: as for a mapping.
        begins: time of the first joint state [s].
        felt: (n, 7) time [s], force [N], torque [N m] of the tip, as far off as efforts are; None: not known here.
        why: in words.
        left: what has to be told by hand, in sentences.
    """

    source: EffortSource
    begins: float
    felt: Array | None
    why: str
    left: tuple[str, ...]


def efforts_of(
    side: str, hand: str, joints: Mapping[str, JointCandidate], descriptions: Mapping[str, str]
) -> Efforts | None:
    """Return what stands in for the wrench of a gripper; None where no joint tells an effort.

    Args:
        side: "left" or "right".
        hand: frame whose pose is taken for the gripper's; empty where it has no name of its own.
        joints: joint states with efforts by topic.
        descriptions: texts of URDFs by topic.
    """
    driven = {topic: each.driven() for topic, each in joints.items()}
    for topic, names in sorted(driven.items(), key=lambda pair: -len(pair[1])):
        if not names:
            continue
        for description, text in descriptions.items():
            chain = _chain(text, side, hand, names)
            if chain is not None:
                source = _source(topic, *chain, description=description, clock_offset=joints[topic].clock_offset)
                why = f"there is no wrench; {len(chain[0])} joints with efforts carry {chain[1]!r} in {description}"
                felt = _felt(joints[topic], source, text)
                return Efforts(source, joints[topic].begins, felt, why, _told(side, hand, chain[1]))
        own = tuple(name for name in names if side_of(name) == side) or names
        tip = hand or f"{side}_hand"
        left = (
            f"{side}: which joints carry {tip!r} is in no description of the bag: give the robot's `urdf`, the joints "
            "of the arm alone, and the link `tip`",
        )
        why = "there is no wrench; its joints tell efforts, but no robot_description says how they carry a hand"
        source = _source(topic, own, tip, urdf=UNKNOWN, clock_offset=joints[topic].clock_offset)
        return Efforts(source, joints[topic].begins, None, why, left)
    return None


def _source(topic: str, joints: tuple[str, ...], tip: str, **told: object) -> EffortSource:
    return EffortSource.model_validate({"topic": topic, "joints": joints, "tip": tip, **told})


def _told(side: str, hand: str, tip: str) -> tuple[str, ...]:
    if hand == tip:
        return ()
    seen = f"the frame {hand!r}" if hand else "the frame whose pose is seen"
    return (f"{side}: `tip` is taken to be {tip!r}: name the link that {seen} is, or give `gripper_poses` an `offset`",)


def _chain(text: str, side: str, hand: str, driven: Sequence[str]) -> tuple[tuple[str, ...], str] | None:
    """Return the driven joints from the root to a hand, and the hand's link; None: there is no such chain."""
    parents = _parents(text)
    options = {link: tuple(name for name in _joints(link, parents) if name in driven) for link in parents}
    options = {link: joints for link, joints in options.items() if joints and side_of(link) in ("", side)}
    if hand in options:
        return options[hand], hand
    # Of several links behind the last driven joint the first: what follows does not move against it.
    hands = [link for link in options if HANDS.search(link.lower())] or list(options)
    best = max(hands, key=lambda link: (side_of(link) == side, len(options[link])), default=None)
    return None if best is None else (options[best], best)


def _parents(text: str) -> dict[str, tuple[str, str]]:
    """Return (joint, parent link) by link; empty of a text that is no URDF."""
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError:
        return {}
    found = {}
    for joint in root.iter("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            found[child.get("link", "")] = (joint.get("name", ""), parent.get("link", ""))
    return found


def _joints(link: str, parents: Mapping[str, tuple[str, str]]) -> list[str]:
    """Return the joints from the root to a link."""
    found: list[str] = []
    while link in parents and parents[link][0] not in found:
        joint, link = parents[link]
        found.insert(0, joint)
    return found


def _felt(candidate: JointCandidate, source: EffortSource, text: str) -> Array | None:
    """Return the wrench (n, 7) with its times, good enough to see when something was held; None: it cannot be had."""
    samples = JointSamples(candidate.topic, source)
    try:
        for message in candidate.messages:
            samples.add(message, None)
        torques, jacobians = tip_torques(samples, arm_of(source, text, candidate.topic, samples.positions))
    except BagError:  # no Pinocchio here, or a number that is not one: reading the bag by the mapping will say so
        return None
    wrenches, _ = tip_wrenches(jacobians, torques, np.ones(len(source.joints)))
    return np.column_stack([samples.time, wrenches])
