"""What has been learned, drawn for RViz: draws of the wheel or hinge, its mean, and a caption."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import Point, Pose
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from pbrl_model.posterior import Posterior

Array = NDArray[np.float64]

SHOWN_DRAWS = 200
HEIGHT = 0.02  # [m] above the floor
ARROW_LENGTH = 0.25  # [m]
CIRCLE_CORNERS = 64
DRAW_COLOR = ColorRGBA(r=0.9, g=0.35, b=0.1, a=0.5)
MEAN_COLOR = ColorRGBA(r=0.8, g=0.0, b=0.0, a=1.0)
TEXT_COLOR = ColorRGBA(r=0.1, g=0.1, b=0.1, a=1.0)


def model_markers(posterior: Posterior, object_pose: Array, stamp: object) -> MarkerArray:
    """Draw one posterior in `world`.

    Args:
        posterior: of the object.
        object_pose: (3,) last seen pose of the body's frame in world.
        stamp: builtin_interfaces/Time.
    """
    canonical = posterior.canonical()
    mean = dict(zip(canonical.names, canonical.mean().tolist(), strict=True))
    markers: list[Marker] = []
    if "wheel_x" in mean:
        places = _to_world(np.stack([canonical.column("wheel_x"), canonical.column("wheel_y")], -1), object_pose)
        markers.append(_points(places))
        markers.append(_rolling_direction(mean, object_pose))
    if "hinge_x" in mean:
        markers.append(_points(np.stack([canonical.column("hinge_x"), canonical.column("hinge_y")], -1)))
        markers.append(_circle(mean))
    markers.append(_caption(canonical, mean, object_pose))
    for index, marker in enumerate(markers):
        marker.header.frame_id = "world"
        marker.header.stamp = stamp
        marker.ns = f"model/{posterior.object}"
        marker.id = index
        marker.action = Marker.ADD
    return MarkerArray(markers=markers)


def _to_world(points: Array, pose: Array) -> Array:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray(points @ np.array([[c, s], [-s, c]]) + pose[:2])


def _points(places: Array) -> Marker:
    flat = places.reshape(-1, 2)
    shown = flat[:: max(1, len(flat) // SHOWN_DRAWS)]
    marker = Marker(type=Marker.POINTS, color=DRAW_COLOR, pose=_identity())
    marker.scale.x = marker.scale.y = 0.01
    marker.points = [_point(x, y) for x, y in shown.tolist()]
    return marker


def _rolling_direction(mean: dict[str, float], pose: Array) -> Marker:
    """Draw an arrow from the mean wheel along its x axis, in which it rolls most easily."""
    start = np.array([mean["wheel_x"], mean["wheel_y"]])
    theta = mean.get("wheel_theta", 0.0)
    ends = _to_world(np.stack([start, start + ARROW_LENGTH * np.array([np.cos(theta), np.sin(theta)])]), pose)
    marker = Marker(type=Marker.ARROW, color=MEAN_COLOR, pose=_identity())
    marker.scale.x, marker.scale.y, marker.scale.z = 0.02, 0.05, 0.05
    marker.points = [_point(x, y) for x, y in ends.tolist()]
    return marker


def _circle(mean: dict[str, float]) -> Marker:
    """Draw the circle on which the hinge keeps its anchor."""
    turn = np.linspace(0.0, 2.0 * np.pi, CIRCLE_CORNERS + 1)
    radius = mean["hinge_radius"]
    marker = Marker(type=Marker.LINE_STRIP, color=MEAN_COLOR, pose=_identity())
    marker.scale.x = 0.01
    marker.points = [_point(mean["hinge_x"] + radius * np.cos(a), mean["hinge_y"] + radius * np.sin(a)) for a in turn]
    return marker


def _caption(posterior: Posterior, mean: dict[str, float], pose: Array) -> Marker:
    sd = dict(zip(posterior.names, posterior.sd().tolist(), strict=True))
    lines = [f"{posterior.object}: {posterior.model_class}"]
    lines += [
        f"{name} {mean[name]:.3g} ± {sd[name]:.2g} {unit}" for name, unit in zip(mean, posterior.units, strict=True)
    ]
    marker = Marker(type=Marker.TEXT_VIEW_FACING, color=TEXT_COLOR, pose=_identity(), text="\n".join(lines))
    marker.pose.position = _point(float(pose[0]), float(pose[1]), 1.2)
    marker.scale.z = 0.08
    return marker


def _identity() -> Pose:
    pose = Pose()
    pose.orientation.w = 1.0
    return pose


def _point(x: float, y: float, z: float = HEIGHT) -> Point:
    return Point(x=float(x), y=float(y), z=z)
