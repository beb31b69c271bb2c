"""Known geometry: from /scene or from a mapping to `BodyGeometry`, with its checks."""

from __future__ import annotations

from collections.abc import Mapping as Dictionary
from typing import Any

import numpy as np

from pbrl_bag.errors import BagError
from pbrl_bag.mapping import BodySource
from pbrl_bag.outline import fault_of_name, fault_of_outline
from pbrl_bag.streams import read_only
from pbrl_bag.types import Array, BodyGeometry, PoseStream


def yaw_of(quaternion: Array) -> Array:
    """Return the heading [rad] of quaternions (..., 4) x y z w; NaN where not observed."""
    x, y, z, w = np.moveaxis(np.asarray(quaternion, dtype=np.float64), -1, 0)
    return np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def bodies_of_scene(topic: str, scene: Any) -> dict[str, BodyGeometry]:
    """Return the bodies of a pbrl_msgs/Scene by name.

    Raises:
        BagError: a footprint with fewer than three corners, clockwise or not finite; a name given twice.
    """
    bodies: dict[str, BodyGeometry] = {}
    for body in scene.bodies:
        name = str(body.name)
        if name in bodies:
            raise BagError(f"{topic}: bodies: {name!r} is there twice; names of bodies have to differ")
        geometry = BodyGeometry(
            name=name,
            footprint=corners(body.footprint),
            height=float(body.height),
            nominal_mass=float(body.nominal_mass),
            movable=bool(body.movable),
            pose=read_only(np.array([body.pose.x, body.pose.y, body.pose.theta])),
            casters=corners(body.casters),
        )
        _check(topic, geometry)
        bodies[name] = geometry
    return bodies


def corners(points: Any) -> Array:
    """Return x and y (k, 2) [m] of a list of geometry_msgs/Point."""
    return read_only(np.array([[point.x, point.y] for point in points], dtype=np.float64).reshape(-1, 2))


def bodies_of_mapping(
    sources: Dictionary[str, BodySource], poses: Dictionary[str, PoseStream], where: str
) -> dict[str, BodyGeometry]:
    """Return the bodies that a mapping describes, by name.

    Args:
        sources: `bodies` of the mapping.
        poses: what was observed, for bodies whose pose is left out.
        where: the recording, named in errors.

    Raises:
        BagError: a body's pose is neither given nor observed.
    """
    return {name: _body(name, source, poses.get(name), where) for name, source in sources.items()}


def _body(name: str, source: BodySource, stream: PoseStream | None, where: str) -> BodyGeometry:
    """Make one body of a mapping."""
    return BodyGeometry(
        name=name,
        footprint=read_only(np.array(source.footprint)),
        height=source.height,
        nominal_mass=float("nan") if source.nominal_mass is None else source.nominal_mass,
        movable=source.movable,
        pose=read_only(np.array(source.pose if source.pose else _first_pose(name, source, stream, where))),
        casters=read_only(np.array(source.casters).reshape(-1, 2)),
    )


def _first_pose(name: str, source: BodySource, stream: PoseStream | None, where: str) -> tuple[float, float, float]:
    """Return where a body was first observed: x, y [m] and heading [rad]."""
    if stream is None or not len(stream.time):
        raise BagError(f"{where}: bodies.{name}: has no pose and is never observed; give `pose` in the mapping")
    theta = source.theta if source.theta is not None else float(yaw_of(stream.quaternion[0]))
    if not np.isfinite(theta):
        raise BagError(f"{where}: bodies.{name}: its heading is not observed; give `theta` or `pose` in the mapping")
    return (float(stream.position[0, 0]), float(stream.position[0, 1]), theta)


def _check(topic: str, body: BodyGeometry) -> None:
    """Raise a BagError where geometry makes no sense."""
    if fault := fault_of_name(body.name):
        raise BagError(f"{topic}: bodies: {fault}")
    if fault := fault_of_outline(body.footprint):
        raise BagError(f"{topic}: body {body.name!r}: footprint: {fault}")
    if not (np.isfinite(body.pose).all() and np.isfinite(body.height) and np.isfinite(body.casters).all()):
        raise BagError(f"{topic}: body {body.name!r}: pose, height and casters: expected finite numbers, got NaN")
    if body.nominal_mass < 0.0 or np.isinf(body.nominal_mass):
        raise BagError(f"{topic}: body {body.name!r}: nominal_mass: expected kilograms, got {body.nominal_mass:g}")
