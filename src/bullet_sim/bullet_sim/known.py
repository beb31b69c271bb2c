"""What everybody may know of a scene: its geometry. The concealed part is not read here."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from bullet_sim.catalogue import Body, Fixture, OnCasters
from bullet_sim.observations import KnownBody, KnownScene
from bullet_sim.scene import Scene

KEEP_OUT = "keep_out_"
"""Beginning of the name of a place that nothing may enter, as it is told: it is there for planners, and no thing."""
KEPT_CLEAR = 0.10
"""By so much it is told to be wider than it is [m]: plans are not followed to the millimetre."""
KEPT_HEIGHT = 3.0
"""[m]"""


def known_scene(scene: Scene, time: float) -> KnownScene:
    """Describe the geometry of a scene as it was at its start.

    Args:
        scene: read from its file.
        time: stamp [s] for the description.
    """
    bodies = tuple(_known_body(name, body) for name, body in scene.bodies.items())
    bodies += tuple(_kept_out(number, corners) for number, corners in enumerate(scene.keep_out))
    return KnownScene(time, bodies, np.array(scene.room.outline))


def _kept_out(number: int, corners: Sequence[tuple[float, float]]) -> KnownBody:
    """Describe a place that nothing may enter as something built in, higher than any robot and a little wider."""
    wide = orient(Polygon(corners).buffer(KEPT_CLEAR, join_style="mitre")).exterior.coords[:-1]
    return KnownBody(
        name=f"{KEEP_OUT}{number}",
        footprint=np.array(wide),
        height=KEPT_HEIGHT,
        nominal_mass=math.nan,
        movable=False,
        pose=np.zeros(3),
        casters=np.zeros((0, 2)),
    )


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
