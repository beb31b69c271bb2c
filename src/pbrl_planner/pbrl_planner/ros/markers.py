"""What robot and cart sweep along a path, drawn for RViz."""

from __future__ import annotations

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from pbrl_control.cart import CartBody
from pbrl_control.planar import Array
from pbrl_planner.ros.conversions import MAP

NAMESPACE = "cart_path"
EVERY = 0.25
"""Way [m, rad] between two outlines that are drawn."""
FLOOR, LINE = 0.03, 0.012
"""Height of lines above the floor, and their width [m]."""
INK = ColorRGBA(r=0.1, g=0.35, b=0.9, a=0.6)


def swept(body: CartBody, poses: Array, stamp: Time) -> MarkerArray:
    """Return outlines of robot and cart along poses (n, 4); without poses what takes the drawing away.

    Args:
        body: outlines.
        poses: x, y, heading, articulation in `map`.
        stamp: of the message.
    """
    marker = Marker(ns=NAMESPACE, id=0, type=Marker.LINE_LIST, action=Marker.ADD if len(poses) else Marker.DELETE)
    marker.header.frame_id, marker.header.stamp = MAP, stamp
    marker.pose.orientation.w, marker.scale.x, marker.color = 1.0, LINE, INK
    for pose in poses[spread(poses)]:
        for ring in body.outlines(pose[:3], float(pose[3])):
            corners = [Point(x=float(x), y=float(y), z=FLOOR) for x, y in ring]
            for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
                marker.points += [a, b]
    return MarkerArray(markers=[marker])


def spread(poses: Array) -> list[int]:
    """Return the numbers of poses (n, 4) that lie `EVERY` apart, the first and the last among them."""
    if len(poses) < 2:
        return list(range(len(poses)))
    way = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(poses, axis=0)).sum(axis=1))))
    marks = np.arange(0.0, way[-1], EVERY)
    return sorted({*np.searchsorted(way, marks).tolist(), len(poses) - 1})
