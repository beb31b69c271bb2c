"""Office tables in Bullet: a slab on four legs, and under each leg a caster."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from bullet_sim.casters import Casters, LinkTable, add_caster_links
from bullet_sim.catalogue import OfficeTable
from bullet_sim.client import GRAVITY, BulletClient, yaw_quaternion
from bullet_sim.errors import SimError
from bullet_sim.furniture import Furniture, Slab
from bullet_sim.quiet import bullet

Array = NDArray[np.float64]

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


def build_table(
    client: BulletClient,
    name: str,
    table: OfficeTable,
    rng: Generator,
    *,
    mass: float | None = None,
    locked: tuple[str, ...] = (),
) -> Furniture:
    """Put an office table on its casters.

    Args:
        client: the world.
        name: of the body.
        table: what it is like.
        rng: draws the swivel angles the casters were left at.
        mass: true mass with casters [kg]; default: the nominal one.
        locked: names of its braked casters.

    Raises:
        SimError: a mass that its casters alone exceed.
    """
    mass = table.nominal_mass if mass is None else mass
    make, swivels = table.casters, table.swivels
    base_mass = mass - len(swivels) * (make.wheel_mass + make.fork_mass)
    if base_mass < 0.5 * mass:
        raise SimError(
            f"body {name!r}: expected a mass over twice its casters', got {mass} kg; make the casters lighter"
        )
    boxes = _table_boxes(table, base_mass)
    centre, inertia = _combine(boxes)
    links = LinkTable()
    angles = rng.uniform(-np.pi, np.pi, len(swivels))
    placed = [
        add_caster_links(
            client,
            links,
            make,
            caster,
            place,
            drop=centre[2] - make.radius,
            angle=float(angle),
            locked=caster in locked,
        )
        for (caster, place), angle in zip(swivels.items(), angles, strict=True)
    ]
    body = client.api.createMultiBody(
        baseMass=base_mass,
        baseCollisionShapeIndex=_compound(client, boxes, centre, visual=False),
        baseVisualShapeIndex=_compound(client, boxes, centre, visual=True),
        basePosition=[table.pose[0], table.pose[1], centre[2]],
        baseOrientation=yaw_quaternion(table.pose[2]).tolist(),
        **links.columns,
    )
    client.add(name, body)
    client.api.changeDynamics(body, -1, localInertiaDiagonal=inertia.tolist(), lateralFriction=0.3, restitution=0)
    casters = Casters(client, name, placed, make, share=mass * GRAVITY / len(placed))
    slab = Slab(table.footprint, 0.0, -table.slab)
    return Furniture(client, name, table, np.array([0, 0, table.height - centre[2]]), slab=slab, casters=casters)


@dataclass(frozen=True)
class _Box:
    """A part of a body: mass [kg], half extents (3,) [m], centre (3,) [m] over the floor, colour."""

    mass: float
    half: Array
    centre: Array
    colour: tuple[float, float, float, float]


def _table_boxes(table: OfficeTable, mass: float) -> list[_Box]:
    """Split a table without casters into top, legs and an H of bars that joins the legs low down.

    The top is chipboard and the rest is frame. With the shares above, a table of 1.50 x 0.75 m and 33 kg has its
    centre of mass at 0.57 m and a yaw inertia a fifth above that of a uniform slab.
    """
    size = np.array(table.size)
    top = min(BOARD_DENSITY * size[0] * size[1] * table.slab, HEAVIEST_TOP * mass)
    frame = mass - top
    slab = _Box(top, np.array([*size, table.slab]) / 2, np.array([0, 0, table.height - table.slab / 2]), WOOD)
    length = table.height - table.slab - table.casters.height
    legs = [
        _Box(
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
    rails = [_Box(RAIL_SHARE * frame / 2, rail, end, STEEL) for end in ends]
    rest = (1 - LEG_SHARE - RAIL_SHARE) * frame
    return [slab, *legs, *rails, _Box(rest, stretcher, np.array([0.0, 0.0, height]), STEEL)]


def _combine(boxes: list[_Box]) -> tuple[Array, Array]:
    """Give centre of mass (3,) and the diagonal (3,) of the inertia about it of a set of boxes.

    Casters stand symmetrically about the middle as a rule; where a scene puts them elsewhere, the small offset of
    the legs in x and y is left out, so that the base's axes stay principal axes.
    """
    masses = np.array([box.mass for box in boxes])
    height = float(masses @ [box.centre[2] for box in boxes] / masses.sum())
    centre = np.array([0.0, 0.0, height])
    inertia = np.zeros(3)
    for box in boxes:
        square = (2 * box.half) ** 2 / 12 + (box.centre - centre) ** 2
        inertia += box.mass * (square.sum() - square)
    return centre, inertia


def _compound(client: BulletClient, boxes: list[_Box], centre: Array, *, visual: bool) -> int:
    """Make one shape of a set of boxes, about `centre`."""
    places = [(box.centre - centre).tolist() for box in boxes]
    arguments: dict[str, object] = {
        "shapeTypes": [bullet.GEOM_BOX] * len(boxes),
        "halfExtents": [box.half.tolist() for box in boxes],
    }
    if visual:
        colours = [box.colour for box in boxes]
        return int(client.api.createVisualShapeArray(**arguments, visualFramePositions=places, rgbaColors=colours))
    return int(client.api.createCollisionShapeArray(**arguments, collisionFramePositions=places))
