"""Furniture on casters in Bullet: what a table or a cart is made of as one body, and under it its casters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

from bullet_sim.boxes import combine, compound
from bullet_sim.carts import cart_boxes, cart_slabs
from bullet_sim.casters import Casters, LinkTable, add_caster_links
from bullet_sim.catalogue import OfficeTable, UtilityCart
from bullet_sim.client import GRAVITY, BulletClient, yaw_quaternion
from bullet_sim.errors import SimError
from bullet_sim.fittings import Fitting
from bullet_sim.furniture import Furniture
from bullet_sim.tables import table_boxes, table_slabs


def build_on_casters(
    client: BulletClient,
    name: str,
    settings: OfficeTable | UtilityCart,
    rng: Generator,
    *,
    mass: float | None = None,
    locked: tuple[str, ...] = (),
    fixed: tuple[str, ...] = (),
    fittings: Sequence[Fitting] = (),
) -> Furniture:
    """Put a table or a cart on its casters.

    Args:
        client: the world.
        name: of the body.
        settings: what it is like.
        rng: draws the swivel angles the casters were left at.
        mass: true mass with casters [kg]; default: the nominal one.
        locked: names of its braked casters.
        fixed: names of its casters that do not swivel.
        fittings: what else is built into it; its mass is part of the body's.

    Raises:
        SimError: a mass that its casters alone exceed.
    """
    mass = settings.nominal_mass if mass is None else mass
    make, swivels = settings.casters, settings.swivels
    base_mass = mass - len(swivels) * (make.wheel_mass + make.fork_mass) - sum(fitting.mass for fitting in fittings)
    if base_mass < (0.3 if fittings else 0.5) * mass:
        extra = " and well over its loads'" if fittings else ""
        raise SimError(
            f"body {name!r}: expected a mass over twice its casters'{extra}, got {mass} kg; make the casters lighter"
        )
    if isinstance(settings, OfficeTable):
        boxes, slabs = table_boxes(settings, base_mass), table_slabs(settings)
    else:
        boxes, slabs = cart_boxes(settings, base_mass), cart_slabs(settings)
    centre, inertia = combine(boxes)
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
            fixed=caster in fixed,
        )
        for (caster, place), angle in zip(swivels.items(), angles, strict=True)
    ]
    for fitting in fittings:
        fitting.fit(client, links, centre)
    body = client.api.createMultiBody(
        baseMass=base_mass,
        baseCollisionShapeIndex=compound(client, boxes, centre, visual=False),
        baseVisualShapeIndex=compound(client, boxes, centre, visual=True),
        basePosition=[settings.pose[0], settings.pose[1], centre[2]],
        baseOrientation=yaw_quaternion(settings.pose[2]).tolist(),
        **links.columns,
    )
    client.add(name, body)
    client.api.changeDynamics(body, -1, localInertiaDiagonal=inertia.tolist(), lateralFriction=0.3, restitution=0)
    casters = Casters(client, name, placed, make, share=mass * GRAVITY / len(placed))
    tag = np.array([0, 0, settings.height - centre[2]])
    for fitting in fittings:
        fitting.ready(client, name, tag.tolist())
    return Furniture(client, name, settings, tag, slabs=slabs, casters=casters, fittings=fittings)
