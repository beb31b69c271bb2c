"""Which role a topic plays: by the contract's names, or by a mapping."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from pbrl_bag.mapping import EffortSource, Mapping, PoseSource, WrenchSource

Kind = Literal["object_poses", "gripper_poses", "wrenches", "joint_efforts", "description", "grasps", "scene"]

GRASPS_TOPIC = "/grasps"
SCENE_TOPIC = "/scene"
CONTRACT = Mapping(contract=True)

_TAG = re.compile(r"/ar_tags/(?P<body>[^/]+)/pose")
_GRIPPER = re.compile(r"(?P<side>left|right)_gripper")
_WRENCH = re.compile(r"/wrist_ft/(?P<side>left|right)")


@dataclass(frozen=True)
class Role:
    """What a topic stands for.

    Attributes:
        kind: which part of a recording it fills.
        name: body or gripper; empty for grasps, scene and description.
        source: how to read it; None for grasps, scene and description.
    """

    kind: Kind
    name: str = ""
    source: PoseSource | WrenchSource | EffortSource | None = None


def roles_of(topic: str, mapping: Mapping) -> tuple[Role, ...]:
    """Return the roles of a topic, possibly none; one topic of transforms can play several."""
    mapped = _mapped(topic, mapping)
    if mapped or not mapping.contract:
        return mapped
    return tuple(role for role in _contract(topic) if not _taken(role, mapping))


def topic_of(kind: Kind, name: str, mapping: Mapping) -> str:
    """Return the topic that is expected to play a role, for the error that it is missing."""
    sources: dict[str, PoseSource | WrenchSource] = {}
    if kind in ("object_poses", "gripper_poses", "wrenches"):
        sources = dict(getattr(mapping, kind))
    if kind == "wrenches" and name in mapping.joint_efforts:
        return mapping.joint_efforts[name].topic
    if name in sources:
        return sources[name].topic or ""
    named: dict[str, str] = {
        "object_poses": f"/ar_tags/{name}/pose",
        "gripper_poses": f"/ar_tags/{name}_gripper/pose",
        "wrenches": f"/wrist_ft/{name}",
        "grasps": mapping.grasp_topic or GRASPS_TOPIC,
        "scene": mapping.scene_topic or SCENE_TOPIC,
    }
    return named[kind]


def _mapped(topic: str, mapping: Mapping) -> tuple[Role, ...]:
    """Return the roles that a mapping gives to a topic by name."""
    roles = [Role("object_poses", name, s) for name, s in mapping.object_poses.items() if s.topic == topic]
    roles += [Role("gripper_poses", side, s) for side, s in mapping.gripper_poses.items() if s.topic == topic]
    roles += [Role("wrenches", side, wrench) for side, wrench in mapping.wrenches.items() if wrench.topic == topic]
    arms = mapping.joint_efforts.items()
    roles += [Role("joint_efforts", side, arm) for side, arm in arms if arm.topic == topic]
    roles += [Role("description")] * any(arm.description == topic for _, arm in arms)
    roles += [Role("grasps")] * (mapping.grasp_topic == topic) + [Role("scene")] * (mapping.scene_topic == topic)
    return tuple(roles)


def _contract(topic: str) -> tuple[Role, ...]:
    """Return the role that a topic has in the contract."""
    if topic == GRASPS_TOPIC:
        return (Role("grasps"),)
    if topic == SCENE_TOPIC:
        return (Role("scene"),)
    if wrench := _WRENCH.fullmatch(topic):
        return (Role("wrenches", wrench["side"], WrenchSource(topic=topic, exerted_on="gripper")),)
    if tag := _TAG.fullmatch(topic):
        gripper = _GRIPPER.fullmatch(tag["body"])
        kind: Kind = "gripper_poses" if gripper else "object_poses"
        return (Role(kind, gripper["side"] if gripper else tag["body"], PoseSource(topic=topic)),)
    return ()


def _taken(role: Role, mapping: Mapping) -> bool:
    """Tell whether a mapping fills this role from elsewhere."""
    if role.kind == "grasps":
        return mapping.grasp_topic is not None or bool(mapping.grasps)
    if role.kind == "scene":
        return mapping.scene_topic is not None
    return role.name in getattr(mapping, role.kind) or (role.kind == "wrenches" and role.name in mapping.joint_efforts)
