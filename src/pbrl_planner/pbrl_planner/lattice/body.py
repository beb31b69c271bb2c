"""A robot and the cart that it holds as one outline with a joint in it (thesis 4.5, figure 12b), and what it sweeps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Point, Polygon

from pbrl_control.errors import ControlError
from pbrl_control.navigation.floor_map import as_polygon
from pbrl_control.planar import Array
from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice.sweep_kernel import cover_all

FINE = 0.25  # of a cell that a corner moves at most between two poses whose outlines are put together
LARGEST = 20.0  # [m] from the robot's centre to a corner

PR2_HALF = 0.334  # [m] of its base, which is 0.668 m wide and long
PR2_GRIP = 0.65  # [m] that its grippers are ahead of its centre
PR2_HANDS = 0.25  # [m] that each of them is aside
CART_LENGTH, CART_WIDTH = 0.90, 0.60  # [m] of a steel cart, held by a short side


@dataclass(frozen=True)
class ArticulatedBody:
    """Outlines that move together; the cart turns about the grip.

    Attributes:
        robot: (k, 2) corners in the robot's frame [m].
        cart: (k, 2) corners in the cart's frame, whose origin is the grip and whose x axis points ahead [m]; None: no
            cart is held.
        grip: where the cart turns, in the robot's frame [m].
        shoulders: (2, 2) where the arms leave the robot, left first, in its frame [m]; None: arms take no room.
        hands: (2, 2) where they hold the cart, in the cart's frame [m].

    Raises:
        PlannerError: an outline is no simple polygon, or further away than 20 m.
    """

    robot: Array
    cart: Array | None = None
    grip: tuple[float, float] = (0.0, 0.0)
    shoulders: Array | None = None
    hands: Array | None = None

    def __post_init__(self) -> None:
        try:
            for name in ("robot", "cart"):
                corners = getattr(self, name)
                if corners is not None:
                    ring = as_polygon(np.asarray(corners, dtype=float), f"the {name}").exterior.coords
                    object.__setattr__(self, name, np.array(ring)[:-1])
        except ControlError as error:
            raise PlannerError(str(error)) from error
        if not np.isfinite(self.grip).all() or self.radius > LARGEST:
            raise PlannerError(f"body: expected corners within {LARGEST:g} m of the robot, got {self.radius:g} m")
        for name in ("shoulders", "hands"):
            points = getattr(self, name)
            if points is not None and not (np.shape(points) == (2, 2) and np.isfinite(points).all()):
                raise PlannerError(f"body: expected {name} as two finite points (2, 2), got {points}")

    @classmethod
    def pr2_with_cart(cls, length: float = CART_LENGTH, width: float = CART_WIDTH) -> Self:
        """Return the PR2 with its hands on a cart's short side, arms included."""
        aside = np.array([[0.0, PR2_HANDS], [0.0, -PR2_HANDS]])
        return cls(
            rectangle(-PR2_HALF, PR2_HALF, PR2_HALF),
            rectangle(0.0, length, width / 2.0),
            (PR2_GRIP, 0.0),
            aside + np.array([PR2_HALF - 0.05, 0.0]),
            aside,
        )

    @property
    def radius(self) -> float:
        """Of the circle about the robot's centre that nothing leaves, whatever the articulation [m]."""
        reach = float(np.hypot(*self.robot.T).max())
        if self.cart is not None:
            reach = max(reach, math.hypot(*self.grip) + float(np.hypot(*self.cart.T).max()))
        return reach

    @property
    def inner_radius(self) -> float:
        """Of the circle about the robot's centre that it covers however it turns [m]; 0: the centre is outside."""
        outline, centre = Polygon(self.robot), Point(0.0, 0.0)
        return float(outline.exterior.distance(centre)) if outline.contains(centre) else 0.0

    @property
    def cart_middle(self) -> Array | None:
        """The middle (2,) of the cart in its frame [m]; None without one."""
        return None if self.cart is None else np.array(Polygon(self.cart).centroid.coords[0])

    def in_world(self, points: Array, poses: Array, part: str) -> Array:
        """Return points (k, 2) of a part in the axes of poses (n, 4), as (n, k, 2) [m].

        Args:
            points: in the part's frame.
            poses: x, y, heading, articulation.
            part: "robot" or "cart".
        """
        held = np.asarray(points, dtype=float)[None]
        if part == "cart":
            held = _turned(held, poses[:, 3]) + np.asarray(self.grip)
        return _turned(held, poses[:, 2]) + poses[:, None, :2]

    def outlines(self, poses: Array) -> dict[str, Array]:
        """Return the outlines of the robot, the cart and the arms at poses (n, 4), each as (n, k, 2) [m]."""
        found = {"robot": self.in_world(self.robot, poses, "robot")}
        if self.cart is not None:
            found["cart"] = self.in_world(self.cart, poses, "cart")
        if self.cart is not None and self.shoulders is not None and self.hands is not None:
            left, right = self.in_world(self.shoulders, poses, "robot").transpose(1, 0, 2)
            hands = self.in_world(self.hands, poses, "cart").transpose(1, 0, 2)
            found["arms"] = np.stack((left, right, hands[1], hands[0]), axis=1)
        return found

    def area(self, poses: Array) -> float:
        """Return the area that is swept along poses (n, 4), put together from outlines at them [m^2]."""
        return float(shapely.union_all([shapely.polygons(rings) for rings in self.outlines(poses).values()]).area)

    def mask(self, poses: Array, resolution: float, parts: tuple[str, ...] = ()) -> NDArray[np.bool_]:
        """Return the cells that are touched on the way through poses (n, 4).

        Args:
            poses: relative to the centre of the middle cell, in order; straight between one and the next.
            resolution: of a cell [m].
            parts: of which; empty: all.

        Returns:
            (2 r + 1, 2 r + 1), rows along y, large enough for all of it. All cells that are touched are in it; a cell
            can be in it that is missed by a quarter of a cell.
        """
        fine = self.between(np.asarray(poses, dtype=float), resolution * FINE)
        outlines = self.outlines(fine)
        away = float(np.abs(fine[:, :2]).max()) + self.radius
        reach = math.ceil(away / resolution) + 2
        found = np.zeros((2 * reach + 1, 2 * reach + 1), dtype=np.uint8)
        for name, rings in outlines.items():
            if parts and name not in parts:
                continue
            for piece in convex_pieces(rings[0]):
                cover_all(np.ascontiguousarray(rings[:, piece]), resolution, 0.5 * FINE * resolution, reach, found)
        return found.astype(bool)

    def between(self, poses: Array, most: float) -> Array:
        """Return poses (n, 4) with more between them, so that no corner moves further than `most` [m] to the next."""
        corners = np.concatenate(list(self.outlines(poses).values()), axis=1)
        moved = np.hypot(*np.diff(corners, axis=0).transpose(2, 0, 1)).max(axis=1)
        # A corner's arc is longer than its chord: a little more than what would do on a straight line.
        counts = np.maximum(np.ceil(1.05 * moved / most), 1).astype(int)
        parts = [
            a + (b - a) * (np.arange(count)[:, None] / count)
            for a, b, count in zip(poses, poses[1:], counts, strict=False)
        ]
        return np.concatenate([*parts, poses[-1:]])


def rectangle(back: float, front: float, half: float) -> Array:
    """Return the corners (4, 2) of a rectangle from `back` to `front` along x, `half` to either side [m]."""
    return np.array([[back, -half], [front, -half], [front, half], [back, half]])


def convex_pieces(ring: Array) -> list[NDArray[np.int64]]:
    """Return convex pieces of a simple polygon (k, 2), as numbers of its corners in order."""
    sides = np.roll(ring, -1, axis=0) - ring
    after = np.roll(sides, -1, axis=0)
    bends = sides[:, 0] * after[:, 1] - sides[:, 1] * after[:, 0]
    if (bends >= -1e-12).all() or (bends <= 1e-12).all():
        return [np.arange(len(ring))]
    pieces = []
    for triangle in shapely.get_parts(shapely.constrained_delaunay_triangles(Polygon(ring))):
        corners = np.array(triangle.exterior.coords)[:-1]
        pieces.append(np.argmin(np.hypot(*(corners[:, None] - ring[None]).transpose(2, 0, 1)), axis=1))
    return pieces


def _turned(points: Array, angles: Array) -> Array:
    """Return points (n or 1, k, 2) turned by angles (n,), as (n, k, 2)."""
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    x, y = points[..., 0], points[..., 1]
    return np.stack((c * x - s * y, s * x + c * y), axis=-1)
