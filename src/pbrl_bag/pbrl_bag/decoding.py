"""Reads the fields that matter out of ROS messages, by attribute: real ones and decoded ones alike."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from pbrl_bag.errors import BagError

NANOSECONDS = 1_000_000_000


@dataclass(frozen=True)
class PoseSample:
    """One observed pose: time [s], frame id, position (3,) [m], quaternion (4,) x y z w."""

    time: float
    frame: str
    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]


@dataclass(frozen=True)
class WrenchSample:
    """One observed wrench: time [s], frame id, force (3,) [N], torque (3,) [N m]."""

    time: float
    frame: str
    force: tuple[float, float, float]
    torque: tuple[float, float, float]


def seconds(stamp: Any) -> float:
    """Return a builtin_interfaces/Time as seconds."""
    return float(stamp.sec) + float(stamp.nanosec) / NANOSECONDS


def nanoseconds(stamp: Any) -> int:
    """Return a builtin_interfaces/Time as nanoseconds."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def poses_in(topic: str, message: Any, child_frame: str | None, index: int | None = None) -> Iterator[PoseSample]:
    """Yield the poses that a message carries.

    Args:
        topic: named in errors.
        message: PoseStamped, PoseWithCovarianceStamped, Odometry, TransformStamped, TFMessage or PoseArray.
        child_frame: which transform of a TFMessage; for the others, checked where given.
        index: which pose of a PoseArray; one that is too short has none.

    Raises:
        BagError: the message carries no stamped pose, or `child_frame` or `index` is needed and missing.
    """
    if hasattr(message, "transforms"):
        if child_frame is None:
            raise BagError(f"{topic}: carries many transforms: expected child_frame in the mapping, got none")
        wanted = [one for one in message.transforms if one.child_frame_id.lstrip("/") == child_frame.lstrip("/")]
        yield from (_from_transform(one) for one in wanted)
    elif hasattr(message, "transform") and hasattr(message, "header"):
        if child_frame is None or message.child_frame_id.lstrip("/") == child_frame.lstrip("/"):
            yield _from_transform(message)
    elif hasattr(message, "pose") and hasattr(message, "header"):
        yield _from_pose(message)
    elif hasattr(message, "poses") and hasattr(message, "header"):
        if index is None:
            raise BagError(f"{topic}: carries many poses: expected index in the mapping, got none")
        for pose in message.poses[index : index + 1]:
            if not hasattr(pose, "position"):
                raise BagError(f"{topic}: expected a PoseArray, got {type(message).__name__}; give another topic")
            yield _sample(message.header, pose.position, pose.orientation)
    else:
        raise BagError(
            f"{topic}: expected a stamped pose (PoseStamped, TransformStamped, Odometry, TFMessage, PoseArray), "
            f"got {type(message).__name__}; give another topic in the mapping"
        )


def wrench_in(topic: str, message: Any) -> WrenchSample:
    """Return the wrench that a WrenchStamped carries.

    Raises:
        BagError: it is not a WrenchStamped.
    """
    if not (hasattr(message, "wrench") and hasattr(message, "header")):
        raise BagError(
            f"{topic}: expected geometry_msgs/WrenchStamped, got {type(message).__name__}; "
            "give another topic in the mapping"
        )
    force, torque = message.wrench.force, message.wrench.torque
    return WrenchSample(
        seconds(message.header.stamp),
        str(message.header.frame_id).lstrip("/"),
        (force.x, force.y, force.z),
        (torque.x, torque.y, torque.z),
    )


def _from_pose(message: Any) -> PoseSample:
    """Read PoseStamped, or one of those that nest the pose beside a covariance."""
    pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
    return _sample(message.header, pose.position, pose.orientation)


def _from_transform(message: Any) -> PoseSample:
    """Read TransformStamped."""
    return _sample(message.header, message.transform.translation, message.transform.rotation)


def _sample(header: Any, at: Any, turn: Any) -> PoseSample:
    """Collect a pose sample from header, position and orientation."""
    return PoseSample(
        seconds(header.stamp),
        str(header.frame_id).lstrip("/"),
        (at.x, at.y, at.z),
        (turn.x, turn.y, turn.z, turn.w),
    )
