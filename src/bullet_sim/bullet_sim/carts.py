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

SHELF_SHARE, BAR_SHARE, RAILS_SHARE = 0.36, 0.06, 0.12
"""Of the mass without casters: in each shelf, and in each bar with its brackets; the posts have the rest.

Without an upper shelf its rails have the third, and the lower shelf what is left over.
"""

SHEET, TUBE = (0.66, 0.69, 0.72, 1.0), (0.30, 0.32, 0.35, 1.0)


def cart_boxes(cart: UtilityCart, mass: float) -> list[Box]:
    """Split a cart without casters into shelves, posts, bars and brackets.

    Shelves of sheet steel have folded rims: they are as thick as the bars to whoever touches them, and each weighs
    what its sheet weighs. A cart of 0.90 x 0.60 m and 30 kg has its centre of mass at 0.54 m. One without an upper
    shelf has rails in its place, as wide as posts, which hold the posts together and the bars.
    """
    x, y = cart.shelf[0] / 2, cart.shelf[1] / 2
    top, low_shelf = cart.height - cart.bar / 2, cart.lower_shelf - cart.bar / 2
    sheet = np.array([x, y, cart.bar / 2])
    if cart.upper_shelf:
        share = SHELF_SHARE
        upper = [Box(share * mass, sheet, np.array([0.0, 0.0, top]), SHEET)]
    else:
        share = 2 * SHELF_SHARE - RAILS_SHARE
        upper = _rails(cart, top, RAILS_SHARE * mass)
    shelves = [*upper, Box(share * mass, sheet, np.array([0.0, 0.0, low_shelf]), SHEET)]
    low, high = cart.casters.height, cart.height - cart.bar
    corners = [(i * (x - POST / 2), j * (y - POST / 2)) for i in (-1, 1) for j in (-1, 1)]
    weight = (1 - 2 * SHELF_SHARE - 2 * BAR_SHARE) * mass / len(corners)
    posts = [
        Box(weight, np.array([POST, POST, high - low]) / 2, np.array([*corner, (low + high) / 2]), TUBE)
        for corner in corners
    ]
    return [*shelves, *posts, *(box for side in (-1, 1) for box in _bar_boxes(cart, side, BAR_SHARE * mass))]


def _rails(cart: UtilityCart, level: float, mass: float) -> list[Box]:
    """Give the four rails between the posts' upper ends."""
    x, y, half = cart.shelf[0] / 2, cart.shelf[1] / 2, POST / 2
    length, width = np.array([x, half, cart.bar / 2]), np.array([half, y - POST, cart.bar / 2])
    return [
        *(Box(mass / 4, length, np.array([0.0, side * (y - half), level]), TUBE) for side in (-1, 1)),
        *(Box(mass / 4, width, np.array([side * (x - half), 0.0, level]), TUBE) for side in (-1, 1)),
    ]


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
    rim = [(-cart.shelf[0] / 2, cart.shelf[0] / 2)] if cart.upper_shelf else []
    spans = ((-x, cart.bar - x), *rim, (x - cart.bar, x))
    return tuple(Slab(np.array([[start, -y], [end, -y], [end, y], [start, y]]), 0.0, -cart.bar) for start, end in spans)
