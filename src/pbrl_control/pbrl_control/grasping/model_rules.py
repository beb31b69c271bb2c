"""Where an object may be grasped, given how it can move (thesis 6.3.2, figures 39 and 40).

Grasps are parametrised by the angle of a ray from the object's centre; each model class allows some angles:

| class | grasps |
|---|---|
| static | none |
| unconstrained | every face |
| anisotropic | faces across the axis along which the object is free to move |
| fixed-point | the end away from the anchor, on the faces beside the axis that leads there |
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely

from pbrl_control.errors import ControlError
from pbrl_control.planar import Array, rotation, wrap

KINDS = ("static", "unconstrained", "anisotropic", "fixed-point")
ACROSS = math.cos(math.pi / 4) - 1e-9  # a face lies across an axis that is within 45 degrees of its normal
BAND = math.radians(12.0)  # about each of the thesis's two angles of a fixed-point object


@dataclass(frozen=True)
class GraspModel:
    """How an object can move, as far as grasping cares.

    Attributes:
        kind: one of `KINDS`; a string enumeration's member does as well.
        anchor: (2,) of a fixed-point object, in its frame [m].
        free_axis: of an anisotropic object: the angle in its frame of the axis along which it rolls [rad].

    Raises:
        ControlError: the kind is unknown, or lacks its anchor or axis.
    """

    kind: str
    anchor: Array | None = None
    free_axis: float | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ControlError(f"model class: expected one of {', '.join(KINDS)}, got {str(self.kind)!r}")
        if self.kind == "fixed-point" and (self.anchor is None or not _finite_point(self.anchor)):
            raise ControlError(f"fixed-point model: expected a finite anchor (x, y), got {self.anchor}")
        if self.kind == "anisotropic" and (self.free_axis is None or not math.isfinite(self.free_axis)):
            raise ControlError(f"anisotropic model: expected the angle of its free axis, got {self.free_axis}")

    def refusal(self) -> str:
        """Return why the object cannot be grasped to any use; empty where it can."""
        return "static: nothing moves it, so there is nothing to grasp it for" if self.kind == "static" else ""

    def angles(self, footprint: Array, centre: Array, count: int, rng: np.random.Generator) -> Array:
        """Return angles (count,) of rays from the centre, in the object's frame [rad].

        What the class allows is cut into as many equal parts, with one ray in each; faces are looked at later.

        Args:
            footprint: (k, 2) corners in the object's frame [m].
            centre: (2,) of the rays [m].
            count: how many.
            rng: for the place within each part.
        """
        share = (np.arange(count) + rng.random(count)) / count
        if self.kind != "fixed-point":
            return math.pi * (2.0 * share - 1.0)
        bands = fixed_point_angles(footprint, centre, np.asarray(self.anchor, dtype=float))
        which, within = np.divmod(share * len(bands), 1.0)
        return np.array([wrap(bands[int(i)] + BAND * (2.0 * x - 1.0)) for i, x in zip(which, within, strict=True)])

    def face_fault(self, normal: float) -> str:
        """Return why a face must not be grasped, from the angle of its normal [rad]; empty where it may."""
        if self.kind != "anisotropic" or self.free_axis is None:
            return ""
        along = abs(math.cos(normal - self.free_axis))
        return "" if along >= ACROSS else "anisotropic: the face is not across the axis along which the object rolls"


def fixed_point_angles(footprint: Array, centre: Array, anchor: Array) -> tuple[float, ...]:
    """Return the angles `+-atan2(sqrt(3) / 2, w / 2h)` about the way out from the anchor [rad], in the object's frame.

    w is the footprint's width along that way and h the one across it. The way is the side of the smallest
    rectangle around the footprint along which the anchor lies further from its middle; an anchor in the middle
    leaves both ends of the longer side, four angles.
    """
    corners = np.asarray(shapely.minimum_rotated_rectangle(shapely.multipoints(footprint)).exterior.coords)
    sides = np.diff(corners[:3], axis=0)
    lengths = np.hypot(*sides.T)
    units = sides / lengths[:, None]
    offsets = units @ (anchor - centre)
    middle = bool(np.abs(offsets).max() < 0.05 * lengths.max())
    best = int(np.argmax(lengths)) if middle else _leading(offsets, lengths)
    w, h = lengths[best], lengths[1 - best]
    axis = math.atan2(units[best, 1], units[best, 0])
    outward = [axis + math.pi] if offsets[best] > 0.0 else [axis]
    ways = [axis, axis + math.pi] if middle else outward
    spread = math.atan2(math.sqrt(3.0) / 2.0, w / (2.0 * h))
    return tuple(wrap(way + sign * spread) for way in ways for sign in (1.0, -1.0))


def _leading(offsets: Array, lengths: Array) -> int:
    """Return the side along which the anchor is further out; of equal ones the longer."""
    out = np.abs(offsets)
    return int(np.argmax(lengths)) if abs(out[0] - out[1]) < 1e-9 else int(np.argmax(out))


def _finite_point(point: Array) -> bool:
    values = np.asarray(point, dtype=float)
    return values.shape == (2,) and bool(np.isfinite(values).all())


def ray_hits(footprint: Array, centre: Array, angle: float) -> Array | None:
    """Return the outermost point (2,) where the ray from the centre at the angle [rad] leaves the footprint."""
    reach = 2.0 * float(np.hypot(*(footprint - centre).T).max()) + 1.0
    ray = shapely.linestrings([centre, centre + rotation(angle) @ np.array([reach, 0.0])])
    hits = shapely.intersection(ray, shapely.linearrings(footprint))
    points = shapely.get_coordinates(hits)
    return None if len(points) == 0 else points[int(np.argmax(np.hypot(*(points - centre).T)))]
