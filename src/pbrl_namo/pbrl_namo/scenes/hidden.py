"""What is true of furniture and not told: locked casters and loads, and scenes that a simulator reads with it.

The library plans without any of this. It is drawn here so that experiments have rooms whose physics nobody knows, and
written in the form of `config/scenes/*.yaml`, whose part `concealed` never leaves the simulator.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import shapely

from pbrl_control.planar import Array
from pbrl_namo.errors import NamoError
from pbrl_namo.scene import Movable, NamoScene
from pbrl_namo.scenes.furniture import MAKES, Furniture
from pbrl_namo.scenes.settings import HiddenSettings

KINDS = ("free", "locked_caster", "static", "heavy")
CASTERS = ("front_left", "front_right", "rear_left", "rear_right")
"""Names of the casters under the corners of tables and carts; front is +x, left is +y of the thing."""

FLOOR_MASS = 30.0
"""Mass [kg/m^2] of a thing of which nobody says how heavy it is."""

LEAST, LOWEST, LIGHTEST = 0.2, 0.2, 4.0
"""Shortest side [m], height [m] and mass [kg] of what stands on casters in the simulator; lesser things slide."""

FIXED_HEIGHT = 1.0
"""Of walls and of what is built in, and of walls around the room [m]."""


def draw_hidden(
    scene: NamoScene, rng: np.random.Generator, settings: HiddenSettings | None = None
) -> dict[str, dict[str, Any]]:
    """Draw what is hidden in each movable thing.

    Args:
        scene: its movable things.
        rng: draws kinds, casters and loads.
        settings: how often each kind is.

    Returns:
        By name: `kind`, one of `KINDS`; `locked_casters`, names of `CASTERS` that are braked, wheel and swivel; `mass`,
        the true one [kg]. Things without casters are `free` or `heavy`.

    Raises:
        NamoError: the shares of the kinds are more than the whole.
    """
    settings = settings or HiddenSettings()
    shares = np.array([0.0, settings.locked_caster, settings.static, settings.heavy])
    if shares.sum() > 1.0 + 1e-12:
        raise NamoError(f"hidden: expected shares of at most 1 together, got {shares.sum():g}; lower one")
    shares[0] = max(0.0, 1.0 - shares.sum())
    hidden: dict[str, dict[str, Any]] = {}
    for name, thing in scene.movable.items():
        kind = str(rng.choice(KINDS, p=shares / shares.sum()))
        order, factor = rng.permutation(len(CASTERS)), float(rng.uniform(*settings.heavier))
        if body_kind(thing) == "block" and kind != "heavy":
            kind = "free"
        locked = {"locked_caster": 1, "static": 2}.get(kind, 0)
        mass = nominal_mass(thing) * (factor if kind == "heavy" else 1.0)
        casters = sorted(CASTERS[index] for index in order[:locked])
        hidden[name] = {"kind": kind, "locked_casters": casters, "mass": round(mass, 3)}
    return hidden


def nominal_mass(thing: Movable) -> float:
    """Return what a thing is taken to weigh [kg]: what is told, or by its floor area."""
    return thing.mass if math.isfinite(thing.mass) else FLOOR_MASS * shapely.Polygon(thing.footprint).area


def body_kind(thing: Movable) -> str:
    """Return what a thing is in a simulator's scene: its make's kind; a table if it can be one; else a block."""
    if isinstance(thing, Furniture):
        return MAKES[thing.make].body
    size = _size(thing.footprint)
    large = size is not None and min(size) >= LEAST and thing.height >= LOWEST and nominal_mass(thing) >= LIGHTEST
    return "office_table" if large else "block"


def scene_yaml(
    scene: NamoScene,
    hidden: Mapping[str, Mapping[str, Any]],
    *,
    name: str = "office",
    posture: str = "square_table_push",
) -> dict[str, Any]:
    """Return a scene in the form of `config/scenes/*.yaml`, of plain values.

    The goal of the robot is no part of that form; who plans tells the planner.

    Args:
        scene: room, things and start.
        hidden: as `draw_hidden` gives it; a thing that is not named is as it looks.
        name: of the scene.
        posture: of the robot's arms at the start.

    Raises:
        NamoError: something hidden names no movable thing, or a kind that does not fit it.
    """
    for told in hidden:
        if told not in scene.movable:
            raise NamoError(f"hidden: expected one of {', '.join(scene.movable) or 'no things'}, got {told!r}")
    bodies = {thing: _body(scene.movable[thing], scene.poses[thing]) for thing in scene.movable}
    for thing, outline in scene.fixed.items():
        middle = np.array(outline.centroid.coords[0])
        corners = shapely.get_coordinates(outline.exterior)[:-1] - middle
        pose = [*map(float, middle), 0.0]
        bodies[thing] = {"kind": "fixture", "polygon": corners.tolist(), "height": FIXED_HEIGHT, "pose": pose}
    return {
        "name": name,
        "room": {"outline": shapely.get_coordinates(scene.room.exterior)[:-1].tolist(), "wall_height": FIXED_HEIGHT},
        "robot": {"pose": [float(value) for value in scene.start], "posture": posture},
        "bodies": bodies,
        "concealed": _concealed(scene, hidden),
    }


def _body(thing: Movable, pose: Array) -> dict[str, Any]:
    """Return one movable thing as a body of a scene."""
    kind = body_kind(thing)
    told: dict[str, Any] = {"kind": kind, "height": float(thing.height), "nominal_mass": float(nominal_mass(thing))}
    if kind == "block":
        return {**told, "polygon": thing.footprint.tolist(), "pose": [float(value) for value in pose]}
    size = _size(thing.footprint)
    assert size is not None
    return {**told, "size": list(size), "pose": [float(value) for value in pose]}


def _concealed(scene: NamoScene, hidden: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return the part of a scene that is not told: locked casters and true masses."""
    found: dict[str, dict[str, Any]] = {}
    for name, told in hidden.items():
        if told["locked_casters"]:
            if body_kind(scene.movable[name]) == "block":
                raise NamoError(f"hidden: expected no casters under {name!r}, it is a block; got {told['kind']!r}")
            found.setdefault("locked_casters", {})[name] = list(told["locked_casters"])
        if told["kind"] == "heavy":
            found.setdefault("mass", {})[name] = float(told["mass"])
    return found


def _size(footprint: Array) -> tuple[float, float] | None:
    """Return the extent along x and y [m] of a rectangle about its frame's origin; None where it is none."""
    half = np.abs(footprint).max(axis=0)
    outline, whole = shapely.Polygon(footprint), shapely.box(*-half, *half)
    same = outline.symmetric_difference(whole).area <= 1e-9 * whole.area
    return (float(2.0 * half[0]), float(2.0 * half[1])) if same else None
