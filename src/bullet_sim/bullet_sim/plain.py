"""Plain tables in Bullet: a board of even mass on ball feet, and what is built into it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from bullet_sim.boxes import Box, compound
from bullet_sim.casters import CasterLinks, Casters, LinkTable, add_caster_links
from bullet_sim.catalogue import FOOT_RADIUS, CasterSettings, PlainTable
from bullet_sim.client import GRAVITY, BulletClient, yaw_quaternion
from bullet_sim.errors import SimError
from bullet_sim.feet import Feet, Foot
from bullet_sim.fittings import Fitting
from bullet_sim.furniture import Furniture, Slab
from bullet_sim.quiet import bullet
from bullet_sim.tables import LEG, STEEL, WOOD

Array = NDArray[np.float64]

FOOT_MASS = 0.05
"""Of a ball foot [kg]."""

CENTRE_HEIGHT = 0.7
"""Where its centre of mass is, as a share of a table's height."""


def build_plain(
    client: BulletClient,
    name: str,
    table: PlainTable,
    rng: Generator,
    *,
    mass: float | None = None,
    fittings: Sequence[Fitting] = (),
    casters: CasterSettings | None = None,
) -> Furniture:
    """Put a plain table on the floor.

    What is light (feet, casters, struts) is balanced by the board, so that the whole has its centre of mass in the
    middle and the yaw inertia m (a^2 + b^2) / 12 of its outline, evenly filled; loads come on top of an even board
    and take their mass from it.

    Args:
        client: the world.
        name: of the body.
        table: what it is like.
        rng: draws the swivel angles of casters.
        mass: true mass with all that is in it [kg]; default: the nominal one.
        fittings: what is built into it.
        casters: stand under it instead of its feet.

    Raises:
        SimError: a mass that feet and fittings alone exceed.
    """
    mass = table.nominal_mass if mass is None else mass
    foot_mass = FOOT_MASS if casters is None else casters.wheel_mass + casters.fork_mass
    light = [(foot_mass, place) for place in table.feet.values()]
    light += [(fitting.mass, fitting.place) for fitting in fittings if fitting.light]
    even = mass - sum(fitting.mass for fitting in fittings if not fitting.light)
    base_mass, middle, inertia = _balance(table, even, light)
    if base_mass < 0.3 * mass or min(inertia) <= 0:
        raise SimError(f"body {name!r}: expected a mass well over that of its loads and casters, got {mass:g} kg")
    centre = np.array([*middle, CENTRE_HEIGHT * table.height])
    links = LinkTable()
    feet: list[Foot] = []
    placed: list[CasterLinks] = []
    if casters is None:
        feet = [_add_foot(client, links, place, centre) for place in table.feet.values()]
    else:
        placed = _add_casters(client, links, table, casters, centre, rng)
    for fitting in fittings:
        fitting.fit(client, links, centre)
    boxes = _boxes(table, casters.height if casters else 2 * FOOT_RADIUS)
    x, y, theta = table.pose
    cos, sin = np.cos(theta), np.sin(theta)
    body = client.api.createMultiBody(
        baseMass=base_mass,
        baseCollisionShapeIndex=compound(client, boxes, centre, visual=False),
        baseVisualShapeIndex=compound(client, boxes, centre, visual=True),
        basePosition=[x + cos * middle[0] - sin * middle[1], y + sin * middle[0] + cos * middle[1], centre[2]],
        baseOrientation=yaw_quaternion(theta).tolist(),
        **links.columns,
    )
    client.add(name, body)
    client.api.changeDynamics(body, -1, localInertiaDiagonal=inertia, lateralFriction=0.3, restitution=0)
    for foot in feet:
        client.api.changeDynamics(
            body, foot.link, localInertiaDiagonal=[1e-5] * 3, lateralFriction=0, spinningFriction=0, restitution=0
        )
    outline = Slab(table.footprint, 0.0, -table.slab)
    tag = np.array([0.0, 0.0, table.height]) - centre
    for fitting in fittings:
        fitting.ready(client, name, tag.tolist())
    made = Furniture(client, name, table, tag, slabs=(outline,), fittings=fittings)
    if casters is not None:
        made.casters = Casters(client, name, placed, casters, share=mass * GRAVITY / len(placed))
    else:
        made.feet = Feet(client, name, feet, made.motion())
    return made


def _balance(
    table: PlainTable, even: float, light: Sequence[tuple[float, tuple[float, float]]]
) -> tuple[float, Array, list[float]]:
    """Give mass, place (2,) and inertia (3) of a board that makes an even table of `even` kg with its light parts."""
    masses = np.array([mass for mass, _ in light])
    places = np.array([place for _, place in light])
    base = even - masses.sum()
    middle = -masses @ places / base
    x, y, thick = table.size[0] ** 2, table.size[1] ** 2, (table.height / 2) ** 2
    about = masses @ places**2 + base * middle**2
    turning = even * (x + y) / 12 - about.sum()
    return float(base), middle, [even * (y + thick) / 12, even * (x + thick) / 12, float(turning)]


def _add_foot(client: BulletClient, links: LinkTable, place: tuple[float, float], centre: Array) -> Foot:
    """Append one ball foot."""
    ball = client.api.createCollisionShape(bullet.GEOM_SPHERE, radius=FOOT_RADIUS)
    look = client.api.createVisualShape(bullet.GEOM_SPHERE, radius=FOOT_RADIUS, rgbaColor=[0.2, 0.2, 0.2, 1])
    where = [place[0] - centre[0], place[1] - centre[1], FOOT_RADIUS - centre[2]]
    return Foot(links.add(FOOT_MASS, (ball, look), where, -1, (0, 0, 1), rigid=True), place)


def _add_casters(
    client: BulletClient, links: LinkTable, table: PlainTable, make: CasterSettings, centre: Array, rng: Generator
) -> list[CasterLinks]:
    """Append casters in the places of the feet."""
    angles = rng.uniform(-np.pi, np.pi, len(table.feet))
    return [
        add_caster_links(
            client,
            links,
            make,
            caster,
            (place[0] - centre[0], place[1] - centre[1]),
            drop=centre[2] - make.radius,
            angle=float(angle),
            locked=False,
        )
        for (caster, place), angle in zip(table.feet.items(), angles, strict=True)
    ]


def _boxes(table: PlainTable, below: float) -> list[Box]:
    """Give what others bump into: top and legs; their masses are not used."""
    top = Box(0.0, np.array([*table.size, table.slab]) / 2, np.array([0, 0, table.height - table.slab / 2]), WOOD)
    length = table.height - table.slab - below
    half = np.array([LEG, LEG, length]) / 2
    return [top, *(Box(0.0, half, np.array([*place, below + length / 2]), STEEL) for place in table.feet.values())]
