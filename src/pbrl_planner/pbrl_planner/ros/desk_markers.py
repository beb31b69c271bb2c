"""A plan for a desk, drawn for RViz: each item's outlines on its way."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from pbrl_control.planar import Array, placed
from pbrl_planner.tabletop import Desk

INKS = ((0.23, 0.48, 0.85), (0.85, 0.55, 0.23), (0.35, 0.64, 0.41), (0.63, 0.35, 0.64), (0.76, 0.09, 0.36))
LINE, HEIGHT = 0.002, 0.002
"""Width of lines and how high they are over the table [m]."""


def planned(desk: Desk, layouts: Array, stamp: Time) -> MarkerArray:
    """Return the outlines of each item in layouts (m, n, 3), in `world`.

    Args:
        desk: whose items.
        layouts: in order; where an item stays it is drawn once.
        stamp: of the message.
    """
    markers = []
    for k, item in enumerate(desk.items):
        red, green, blue = INKS[k % len(INKS)]
        marker = Marker(ns="tabletop", id=k, type=Marker.LINE_LIST, action=Marker.ADD, text=item.name)
        marker.header.frame_id, marker.header.stamp = "world", stamp
        marker.pose.orientation.w, marker.scale.x = 1.0, LINE
        marker.color = ColorRGBA(r=red, g=green, b=blue, a=0.7)
        poses = [layouts[0, k], *(b for a, b in pairwise(layouts[:, k]) if not np.array_equal(a, b))]
        for pose in poses:
            corners = placed(item.half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), pose)
            ring = [Point(x=float(x), y=float(y), z=HEIGHT) for x, y in corners]
            for a, b in zip(ring, [*ring[1:], ring[0]], strict=True):
                marker.points += [a, b]
        markers.append(marker)
    return MarkerArray(markers=markers)
