"""A proposed mapping as YAML that a person reads, corrects and completes."""

from __future__ import annotations

import math

import yaml

from pbrl_bag.mapping import EffortSource, FramePose, Mapping, PoseSource, WrenchSource
from pbrl_bag.proposing.proposal import Proposal

SIZE = "[[-0.6, -0.4], [0.6, -0.4], [0.6, 0.4], [-0.6, 0.4]]"


def mapping_text(proposal: Proposal, source: str, sizes: dict[str, tuple[float, float]]) -> str:
    """Return the text of a mapping file.

    Args:
        proposal: with a mapping.
        source: the bag, for the first line.
        sizes: length and width by body [m], as far as they are known; a rectangle about the body's frame.
    """
    mapping = proposal.mapping
    assert mapping is not None, "a bag of the contract needs none"
    lines = [
        f"# Proposed by `pbrl map {source}`. Check each line; `pbrl info {source} --map THIS` says what comes out."
    ]
    lines += [f"# To do: {each}" for each in proposal.left if not _is_done(each, sizes)]
    lines += [f"world: {_scalar(mapping.world)} # the frame id that stands for `world`", ""]
    if mapping.frames:
        lines.append("frames: # other frames, where they are in world")
        lines += [f"  {_scalar(name)}: {_place(place)}" for name, place in mapping.frames.items()] + [""]
    lines.append("bodies:")
    for name in mapping.object_poses:
        length, width = sizes.get(name, (math.nan, math.nan))
        if math.isfinite(length):
            corners = [[x * length / 2, y * width / 2] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            lines += [f"  {name}:", f"    footprint: {_list(corners)}", "    height: 0.7 # [m]; measure it"]
        else:
            lines += [f"  # {name}:", f"  #   footprint: {SIZE} # [m] counter-clockwise", "  #   height: 0.7 # [m]"]
        lines.append(f"  {'' if math.isfinite(length) else '# '}  # nominal_mass: 20.0 # [kg] if somebody knows it")
    sources: list[PoseSource | WrenchSource | EffortSource] = [
        *mapping.joint_efforts.values(),
        *mapping.object_poses.values(),
        *mapping.gripper_poses.values(),
        *mapping.wrenches.values(),
    ]
    if any(each.clock_offset for each in sources):
        lines += ["", "# clock_offset [s] is added to a stream's times: judged by when it was heard beside the others"]
    lines += ["", "object_poses:"]
    lines += [f"  {name}: {_pose(each)}" for name, each in mapping.object_poses.items()]
    lines += ["", "gripper_poses: # of the force-torque sensor's frame; `offset` where another one was seen"]
    lines += [f"  {side}: {_pose(each)}" for side, each in mapping.gripper_poses.items()]
    if mapping.joint_efforts:
        lines += ["", "joint_efforts: # for want of a wrench; tip: the link whose pose gripper_poses tells"]
        lines += ["  # noise [N m]: how far off an effort is for seconds; left out: as seen while the hand is empty"]
        lines += [f"  {side}: {_efforts(each)}" for side, each in mapping.joint_efforts.items()]
    else:
        said = "exerted_on: gripper is a raw sensor; object one that was compensated, gripper on object"
        lines += ["", f"wrenches: # {said}"]
        lines += [f"  {side}: {_wrench(each)}" for side, each in mapping.wrenches.items()]
    lines += ["", "grasps: # seconds after the first sample, and where the gripper holds, in the body's frame"]
    for grasp in mapping.grasps:
        told = grasp.model_dump(exclude_none=True)
        lines.append(f"  - {_flow({**told, 'contact': list(grasp.contact)})}")
    return "\n".join(lines) + "\n"


def completed(mapping: Mapping, sizes: dict[str, tuple[float, float]]) -> bool:
    """Say whether every body has its geometry."""
    return bool(mapping.object_poses) and set(mapping.object_poses) <= set(sizes)


def _is_done(sentence: str, sizes: dict[str, tuple[float, float]]) -> bool:
    return any(sentence.startswith(f"the outline of {name!r} ") for name in sizes)


def _pose(source: PoseSource) -> str:
    told = {"topic": source.topic, "child_frame": source.child_frame, "index": source.index, "frame": source.frame}
    return _flow({key: value for key, value in told.items() if value is not None} | _clock(source))


def _wrench(source: WrenchSource) -> str:
    told = {"topic": source.topic, "exerted_on": source.exerted_on, "axes": source.axes}
    return _flow(told | _clock(source))


def _efforts(source: EffortSource) -> str:
    where = {"description": source.description} if source.urdf is None else {"urdf": str(source.urdf)}
    told = {"topic": source.topic, "joints": list(source.joints), "tip": source.tip}
    return _flow(told | where | _clock(source))


def _clock(source: PoseSource | WrenchSource | EffortSource) -> dict[str, float]:
    """Return what to say of a stream's clock, where it is another than the others'."""
    return {"clock_offset": source.clock_offset} if source.clock_offset else {}


def _place(place: FramePose) -> str:
    return _flow(
        {
            "position": [round(value, 6) for value in place.position],
            "quaternion": [round(value, 9) for value in place.quaternion],
        }
    )


def _list(values: list[list[float]]) -> str:
    return _flow([[round(value, 4) for value in row] for row in values])


def _flow(value: object) -> str:
    return yaml.safe_dump(value, default_flow_style=True, sort_keys=False, width=10_000).strip().removesuffix("\n...")


def _scalar(text: str) -> str:
    return _flow(text).splitlines()[0]
