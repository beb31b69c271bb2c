"""What an office table is made of: a slab on four legs, and bars that join the legs."""

from __future__ import annotations

import numpy as np

from bullet_sim.boxes import Box
from bullet_sim.catalogue import OfficeTable
from bullet_sim.furniture import Slab

BOARD_DENSITY = 680.0
"""Chipboard [kg/m^3]; what a table weighs beyond its top is frame."""

HEAVIEST_TOP = 0.65
"""Bound on the share of a table's mass in its top, for tables lighter than chipboard."""

LEG = 0.05
"""Side [m] of a table's square legs."""

BAR = 0.04
"""Side [m] of the bars that join the legs."""

BAR_HEIGHT = 0.3
"""Where along the legs those bars are, from below."""

LEG_SHARE, RAIL_SHARE = 0.30, 0.05
"""Of the frame's mass: in the legs, and in the two short bars; the long bar between those has the rest."""

WOOD, STEEL = (0.76, 0.60, 0.42, 1.0), (0.55, 0.57, 0.60, 1.0)


def table_slabs(table: OfficeTable) -> tuple[Slab, ...]:
    """Give what of a table can be clamped: the edge of its top."""
    return (Slab(table.footprint, 0.0, -table.slab),)


def table_boxes(table: OfficeTable, mass: float) -> list[Box]:
    """Split a table without casters into top, legs and an H of bars that joins the legs low down.

    The top is chipboard and the rest is frame. With the shares above, a table of 1.50 x 0.75 m and 33 kg has its
    centre of mass at 0.57 m and a yaw inertia a fifth above that of a uniform slab.
    """
    size = np.array(table.size)
    top = min(BOARD_DENSITY * size[0] * size[1] * table.slab, HEAVIEST_TOP * mass)
    frame = mass - top
    slab = Box(top, np.array([*size, table.slab]) / 2, np.array([0, 0, table.height - table.slab / 2]), WOOD)
    length = table.height - table.slab - table.casters.height
    legs = [
        Box(
            LEG_SHARE * frame / len(table.swivels),
            np.array([LEG, LEG, length]) / 2,
            np.array([*place, table.casters.height + length / 2]),
            STEEL,
        )
        for place in table.swivels.values()
    ]
    long = int(np.argmax(size))
    reach = size / 2 - table.leg_inset
    height = table.casters.height + BAR_HEIGHT * length
    stretcher = np.full(3, BAR / 2)
    stretcher[long] = reach[long]
    rail = np.full(3, BAR / 2)
    rail[1 - long] = reach[1 - long]
    ends = [np.array([0.0, 0.0, height]) for _ in range(2)]
    for side, end in zip((-1, 1), ends, strict=True):
        end[long] = side * reach[long]
    rails = [Box(RAIL_SHARE * frame / 2, rail, end, STEEL) for end in ends]
    rest = (1 - LEG_SHARE - RAIL_SHARE) * frame
    return [slab, *legs, *rails, Box(rest, stretcher, np.array([0.0, 0.0, height]), STEEL)]
