"""What was found, drawn for RViz: the force that a model lacks along the way, places of what is named, a caption."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from pbrl_mismatch.online.found import Found

HEIGHT, CAPTION = 0.03, 1.4
"""Of lines and of the caption over the floor [m]."""
LONGEST = 0.5
"""An arrow for the greatest force [m]."""
FORCE = ColorRGBA(r=0.77, g=0.33, b=0.0, a=1.0)
PLACE = ColorRGBA(r=0.64, g=0.22, b=0.48, a=1.0)
INK = ColorRGBA(r=0.1, g=0.1, b=0.1, a=1.0)


def mismatch_markers(entries: Iterable[Found], stamp: Time) -> MarkerArray:
    """Draw everything that was found, in `world` and in the frames of the objects, and take away what was drawn before.

    Args:
        entries: one an object; forces and places are those of its diagnosis.
        stamp: when the newest changed.
    """
    drawn = [Marker(action=Marker.DELETEALL)]
    for found in entries:
        one = [*_forces(found), *_places(found)]
        for index, marker in enumerate(one):
            marker.ns, marker.id = f"mismatch/{found.alarm.object}", index
        drawn += one
    for marker in drawn:
        marker.header.frame_id = marker.header.frame_id or "world"
        marker.header.stamp, marker.pose = stamp, marker.pose if marker.text else _identity()
    return MarkerArray(markers=drawn)


def _forces(found: Found) -> list[Marker]:
    """Draw arrows along the way, as lines with heads, and say beside the first of them what was found."""
    forces = found.diagnosed.forces if found.diagnosed is not None else ()
    if not forces:
        return []
    rows = np.array(forces)
    size = max(float(np.hypot(*rows[:, 2:].T).max()), 1e-9)
    lines = Marker(type=Marker.LINE_LIST, color=FORCE)
    lines.scale.x = 0.012
    for x, y, fx, fy in rows.tolist():
        tip = np.array([x, y]) + LONGEST * np.array([fx, fy]) / size
        back = np.array([fx, fy]) / max(float(np.hypot(fx, fy)), 1e-9)
        side, length = np.array([-back[1], back[0]]), 0.2 * LONGEST * float(np.hypot(fx, fy)) / size
        for end in (np.array([x, y]), tip + length * (0.5 * side - back), tip - length * (0.5 * side + back)):
            lines.points += [_point(end), _point(tip)]
    text = f"{found.verdict}\nlongest arrow {size:.2g} N"
    caption = Marker(type=Marker.TEXT_VIEW_FACING, color=INK, text=text, pose=_identity())
    caption.pose.position = _point(rows[0, :2], CAPTION)
    caption.scale.z = 0.08
    return [lines, caption]


def _places(found: Found) -> list[Marker]:
    """Draw the outline of each place that something named has, in the frame in which it is told."""
    drawn = []
    for effect in found.report.get("effects", ()):
        where: dict[str, Any] | None = effect["where"]
        if where and where["shape"]:
            outline: Sequence[Sequence[float]] = where["shape"]
            marker = Marker(type=Marker.LINE_STRIP, color=PLACE)
            marker.header.frame_id, marker.scale.x = where["frame"], 0.02
            marker.points = [_point(corner) for corner in (*outline, outline[0])]
            drawn.append(marker)
    return drawn


def _identity() -> Pose:
    pose = Pose()
    pose.orientation.w = 1.0
    return pose


def _point(place: Sequence[float] | np.ndarray, height: float = HEIGHT) -> Point:
    return Point(x=float(place[0]), y=float(place[1]), z=height)
