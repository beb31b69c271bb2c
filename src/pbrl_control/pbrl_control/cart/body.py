"""Robot, arms and cart as convex outlines that move with base and articulation (thesis figure 12b)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, Self

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from pbrl_control.errors import ControlError
from pbrl_control.navigation.floor_map import as_polygon
from pbrl_control.planar import Array, rotation

LARGEST = 20.0  # [m] of a corner from its frame


class Articulated(Protocol):
    """Anything that has these: the planner's body, say."""

    @property
    def robot(self) -> Array:
        """Corners (k, 2) in `base` [m]."""
        ...

    @property
    def cart(self) -> Array | None:
        """Corners (k, 2) in the cart's frame [m]."""
        ...

    @property
    def grip(self) -> tuple[float, float]:
        """Where the cart turns, in `base` [m]."""
        ...

    @property
    def shoulders(self) -> Array | None:
        """(2, 2) in `base` [m]."""
        ...

    @property
    def hands(self) -> Array | None:
        """(2, 2) in the cart's frame [m]."""
        ...


@dataclass(frozen=True)
class CartBody:
    """Outlines of a robot and the cart that it holds.

    Attributes:
        robot: (k, 2) corners in `base` [m].
        cart: (k, 2) corners in the cart's frame, whose origin is the grip and whose x axis points ahead [m].
        grip: where the cart turns, in `base` [m].
        shoulders: (2, 2) where the arms leave the robot, left first, in `base` [m]; None: arms take no room.
        hands: (2, 2) where they hold the cart, in its frame [m].
        corners: (c, 2) of convex pieces, one after the other.
        on_cart: (c,) 1 for corners in the cart's frame, 0 for those in `base`.
        first: (p + 1,) where each piece begins.

    Raises:
        ControlError: an outline is no simple polygon, or further away than 20 m.
    """

    robot: Array
    cart: Array
    grip: tuple[float, float]
    shoulders: Array | None = None
    hands: Array | None = None
    corners: Array = field(init=False, repr=False, compare=False)
    on_cart: NDArray[np.uint8] = field(init=False, repr=False, compare=False)
    first: NDArray[np.int64] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        pieces = [(ring, [0] * len(ring)) for ring in _convex_pieces(self.robot, "robot")]
        pieces += [(ring, [1] * len(ring)) for ring in _convex_pieces(self.cart, "cart")]
        if len(self.grip) != 2 or not np.isfinite(self.grip).all():
            raise ControlError(f"body: expected a finite grip (x, y), got {self.grip}")
        if (self.shoulders is None) != (self.hands is None):
            raise ControlError("body: expected shoulders and hands, or neither; got one without the other")
        if self.shoulders is not None and self.hands is not None:
            for name, points in (("shoulders", self.shoulders), ("hands", self.hands)):
                if np.shape(points) != (2, 2) or not np.isfinite(points).all():
                    raise ControlError(f"body: expected {name} as two finite points (2, 2), got {points}")
            left, right = np.asarray(self.shoulders, dtype=float)
            left_hand, right_hand = np.asarray(self.hands, dtype=float)
            # Triangles stay convex however the cart is turned.
            pieces.append((np.array([left, right, right_hand]), [0, 0, 1]))
            pieces.append((np.array([left, right_hand, left_hand]), [0, 1, 1]))
        corners = np.concatenate([ring for ring, _ in pieces])
        if np.abs(corners).max() > LARGEST:
            raise ControlError(f"body: expected corners within {LARGEST:g} m, got {np.abs(corners).max():g} m")
        object.__setattr__(self, "corners", np.ascontiguousarray(corners))
        object.__setattr__(self, "on_cart", np.concatenate([flags for _, flags in pieces]).astype(np.uint8))
        object.__setattr__(self, "first", np.cumsum([0, *(len(ring) for ring, _ in pieces)]).astype(np.int64))

    @classmethod
    def of(cls, body: Articulated) -> Self:
        """Take over the planner's body.

        Raises:
            ControlError: it holds no cart.
        """
        if body.cart is None:
            raise ControlError("body: expected one that holds a cart, got a robot alone")
        grip = (float(body.grip[0]), float(body.grip[1]))
        return cls(body.robot, body.cart, grip, body.shoulders, body.hands)

    def reach(self) -> Array:
        """Return how far corners are from the base's centre, and those of the cart from the grip, at most (2,) [m]."""
        moving = self.corners[self.on_cart == 1]
        cart = float(np.hypot(*moving.T).max())
        robot = float(np.hypot(*self.corners[self.on_cart == 0].T).max())
        return np.array([max(robot, float(np.hypot(*self.grip)) + cart), cart])

    def outlines(self, base: Array, articulation: float) -> list[Array]:
        """Return the convex pieces, (k, 2) each, with `base` at a pose (3,) and the cart turned so [m]."""
        turned = self.corners @ rotation(articulation).T + self.grip
        placed = np.where(self.on_cart[:, None] == 1, turned, self.corners) @ rotation(float(base[2])).T + base[:2]
        return [placed[a:b] for a, b in zip(self.first, self.first[1:], strict=False)]

    def seen_outlines(self, base: Array, cart: Array | None) -> list[Array]:
        """Return what readings are to be taken for one's own: as `outlines`, the cart where it is seen.

        Args:
            base: pose (3,) of `base`.
            cart: pose (3,) of the cart's frame in `base`, by the arms or a checkerboard; None: not known, and only
                readings of the robot can be told.
        """
        base = np.asarray(base, dtype=float)
        if cart is None:
            return [np.asarray(self.robot) @ rotation(float(base[2])).T + base[:2]]
        seen = self.corners @ rotation(float(cart[2])).T + np.asarray(cart)[:2]
        placed = np.where(self.on_cart[:, None] == 1, seen, self.corners) @ rotation(float(base[2])).T + base[:2]
        pieces = [placed[a:b] for a, b in zip(self.first, self.first[1:], strict=False)]
        # A cart seen beside its hands can fold the arms' triangles to nothing.
        return [ring for ring in pieces if Polygon(ring).area > 1e-9]


def _convex_pieces(corners: Array | Sequence[Sequence[float]], name: str) -> list[Array]:
    outline = as_polygon(np.asarray(corners, dtype=float), name)
    if np.isclose(outline.area, outline.convex_hull.area, rtol=1e-9):
        return [np.array(outline.exterior.coords)[:-1]]
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(outline))
    return [np.array(triangle.exterior.coords)[:-1] for triangle in triangles]
