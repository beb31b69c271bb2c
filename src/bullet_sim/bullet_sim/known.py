"""What everybody may know of a scene: its geometry. The concealed part is not read here."""

from __future__ import annotations

import math

import numpy as np

from bullet_sim.catalogue import Body, Fixture, OnCasters
from bullet_sim.observations import KnownBody, KnownScene
from bullet_sim.scene import Scene


def known_scene(scene: Scene, time: float) -> KnownScene:
    """Describe the geometry of a scene as it was at its start.

    Args:
        scene: read from its file.
        time: stamp [s] for the description.
    """
    bodies = tuple(_known_body(name, body) for name, body in scene.bodies.items())
    return KnownScene(time, bodies, np.array(scene.room.outline))


def _known_body(name: str, body: Body) -> KnownBody:
    swivels = list(body.swivels.values()) if isinstance(body, OnCasters) else []
    built_in = isinstance(body, Fixture)
    return KnownBody(
        name=name,
        footprint=body.footprint,
        height=body.height,
        nominal_mass=math.nan if isinstance(body, Fixture) else body.nominal_mass,
        movable=not built_in,
        pose=np.array(body.pose),
        casters=np.array(swivels).reshape(-1, 2),
    )
