"""What a utility cart is made of: two shelves of sheet steel, four posts, and a push bar at each end."""

from __future__ import annotations

import numpy as np

from bullet_sim.boxes import Box
from bullet_sim.catalogue import UtilityCart
from bullet_sim.furniture import Slab

POST = 0.03
"""Side [m] of the posts."""

BRACKET = 0.02
"""Width [m] of the brackets that hold a bar."""

SHELF_SHARE, BAR_SHARE = 0.36, 0.06
"""Of the mass without casters: in each shelf, and in each bar with its brackets; the posts have the rest."""

SHEET, TUBE = (0.66, 0.69, 0.72, 1.0), (0.30, 0.32, 0.35, 1.0)


def cart_boxes(cart: UtilityCart, mass: float) -> list[Box]:
    """Split a cart without casters into shelves, posts, bars and brackets.

    Shelves of sheet steel have folded rims: they are as thick as the bars to whoever touches them, and each weighs
    what its sheet weighs. A cart of 0.90 x 0.60 m and 30 kg has its centre of mass at 0.54 m.
    """
    x, y = cart.shelf[0] / 2, cart.shelf[1] / 2
    levels = (cart.height - cart.bar / 2, cart.lower_shelf - cart.bar / 2)
    shelves = [
        Box(SHELF_SHARE * mass, np.array([x, y, cart.bar / 2]), np.array([0.0, 0.0, level]), SHEET) for level in levels
    ]
    low, high = cart.casters.height, cart.height - cart.bar
    corners = [(i * (x - POST / 2), j * (y - POST / 2)) for i in (-1, 1) for j in (-1, 1)]
    weight = (1 - 2 * SHELF_SHARE - 2 * BAR_SHARE) * mass / len(corners)
    posts = [
        Box(weight, np.array([POST, POST, high - low]) / 2, np.array([*corner, (low + high) / 2]), TUBE)
        for corner in corners
    ]
    return [*shelves, *posts, *(box for side in (-1, 1) for box in _bar_boxes(cart, side, BAR_SHARE * mass))]


def _bar_boxes(cart: UtilityCart, side: int, mass: float) -> list[Box]:
    """Give the push bar at the rear (`side` -1) or front (1), and its two brackets."""
    level = cart.height - cart.bar / 2
    bar = np.array([cart.bar, cart.size[1], cart.bar]) / 2
    bracket = np.array([cart.bar_gap, BRACKET, cart.bar]) / 2
    middle, gap = (cart.size[0] - cart.bar) / 2, cart.shelf[0] / 2 + cart.bar_gap / 2
    ends = (cart.size[1] - BRACKET) / 2
    return [
        Box(0.8 * mass, bar, np.array([side * middle, 0.0, level]), TUBE),
        *(Box(0.1 * mass, bracket, np.array([side * gap, end, level]), TUBE) for end in (-ends, ends)),
    ]


def cart_slabs(cart: UtilityCart) -> tuple[Slab, ...]:
    """Give what of a cart can be clamped: its bars, and the rim of the upper shelf."""
    x, y = cart.size[0] / 2, cart.size[1] / 2
    spans = ((-x, cart.bar - x), (-cart.shelf[0] / 2, cart.shelf[0] / 2), (x - cart.bar, x))
    return tuple(Slab(np.array([[start, -y], [end, -y], [end, y], [start, y]]), 0.0, -cart.bar) for start, end in spans)
