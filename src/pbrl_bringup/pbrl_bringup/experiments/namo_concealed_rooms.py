"""Rooms in which a carpet's edge, a tether or a thing that nobody sees is in the way of what looks best.

A table on free casters and a cupboard close the room, so that the table has to be moved. What a planner who knows
nothing of it would do first is worked out beforehand, and the effect is put where that motion meets it on its way. A
room is kept where this takes to be known: who takes what was felt for the table's own friction runs into it again, and
who knows where it is has another way. Only the simulator is told.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely

from bullet_sim.scene import Scene
from bullet_sim.settings import parse_settings
from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments.namo_concealing import Meeting, conceal
from pbrl_bringup.experiments.namo_rooms import DRAWS, GOAL, HEIGHT, MASSES, SIZES, SQUARE, closed, outline_of
from pbrl_control.planar import Array, compose, inverse
from pbrl_model.parameters import BodyParameters
from pbrl_namo.beliefs.belief import ObjectBelief
from pbrl_namo.beliefs.stops import Stop
from pbrl_namo.executive.mission import job_seed
from pbrl_namo.manipulation.plan import ManipulationPlan
from pbrl_namo.planner import plan
from pbrl_namo.scene import Movable, NamoScene
from pbrl_namo.settings import NamoSettings
from pbrl_namo.thinking import unlearned

CUPBOARD = "cupboard"
LENGTH, HALF_WIDTH = (-1.5, 6.0), 2.325
TABLE, CLOSET = (2.6, 0.925), ((2.2, -2.075), (2.95, -2.075), (2.95, -0.475), (2.2, -0.475))
MET = (0.35, 0.55)
"""Share of the first motion after which the effect is met, drawn between the two."""
FREE, HEAVY = 0.02, 0.2
"""Friction coefficients of a table that rolls freely, and of what somebody takes it for who felt the effect and knows
nothing of it."""
PASSAGE = shapely.box(1.2, CLOSET[2][1], 4.5, 0.45)
"""Between table and cupboard: what is concealed is not to close it."""


@dataclass(frozen=True)
class Concealing:
    """A room.

    Attributes:
        kind: of `KINDS`.
        scene: for the simulator.
        goal: (3,), of any heading [m, rad].
        seed: of the mission that it was drawn for.
    """

    kind: str
    scene: Scene
    goal: Array
    seed: int

    def outlines(self) -> list[Array]:
        """Return the corners (k, 2) of what is concealed and lies or stands on the floor, in `world` [m]."""
        concealed = self.scene.concealed
        found = [np.array(tile.polygon) for tile in concealed.floor_patch]
        return found + [np.array(body.polygon) + np.array(body.pose[:2]) for body in concealed.unseen_body]

    def cords(self) -> dict[str, Array]:
        """Return where a cord is tied to a thing, in its frame, and hooked, in `world` (2, 2), by thing [m]."""
        return {name: np.array([cord.point[:2], cord.anchor[:2]]) for name, cord in self.scene.concealed.tether.items()}


def draw_concealing(rng: np.random.Generator, kind: str) -> Concealing:
    """Draw a room.

    Args:
        rng: of the draws.
        kind: of what is concealed, one of `KINDS`.

    Raises:
        BringupError: none of the draws has a place for it.
    """
    for _ in range(DRAWS):
        pose = np.array([*(np.array(TABLE) + rng.uniform(-0.05, 0.05, 2)), rng.uniform(-0.06, 0.06)])
        start = np.array([rng.uniform(-0.5, 0.4), rng.uniform(-0.9, 0.9), rng.uniform(-math.pi, math.pi)])
        goal = np.array([GOAL[0] + rng.uniform(-0.3, 0.3), GOAL[1] + rng.uniform(-0.8, 0.8), math.nan])
        seen, seed = seen_room(pose, start, goal), int(rng.integers(2**31))
        if not closed(seen):
            continue
        believed = unlearned(seen.movable[SQUARE], NamoSettings())
        chosen = plan(seen, {SQUARE: believed}, job_seed(seed, 1)).chosen
        if chosen is None or chosen.plan is None:
            continue
        meeting = conceal(kind, seen, chosen.plan, float(rng.uniform(*MET)), PASSAGE)
        if meeting is not None and _kept(seen, chosen.plan, meeting, seed):
            return Concealing(kind, _told(pose, start, meeting.concealed), goal, seed)
    raise BringupError(f"room: expected one of {DRAWS} draws to have a place for a {kind}, none had")


def _kept(scene: NamoScene, what: ManipulationPlan, meeting: Meeting, seed: int) -> bool:
    """Tell whether it takes to know what was met, and whether that helps.

    Who takes the table for free, or for heavy, is to run into it again; who knows what was met, and that the table
    rolls freely, is to find something else to do.
    """
    leave = compose(inverse(scene.poses[SQUARE]), what.drive_to)
    there = scene.moved({SQUARE: meeting.pose}, compose(meeting.pose, leave))
    for friction in (FREE, HEAVY):
        again = _chosen(there, friction, seed, ())
        if again is None or not meeting.stopping(there, again):
            return False
    if meeting.solid is not None:
        there = replace(there, fixed={**there.fixed, "unseen": meeting.solid})
    return _chosen(there, FREE, seed, meeting.stops) is not None


def _chosen(scene: NamoScene, friction: float, seed: int, stops: tuple[Stop, ...]) -> ManipulationPlan | None:
    """Return what is done next by who believes this of the table."""
    row = BodyParameters(mass=MASSES[SQUARE], mu_ground=friction).to_vector()[None]
    chosen = plan(scene, {SQUARE: ObjectBelief(outline_of(SQUARE), row, stops)}, job_seed(seed, 2)).chosen
    return None if chosen is None else chosen.plan


def seen_room(pose: Array, start: Array, goal: Array) -> NamoScene:
    """Return what can be seen of a room: table's pose (3,), base's start (3,) and goal (3,) in `world` [m, rad]."""
    movable = {SQUARE: Movable(outline_of(SQUARE), HEIGHT, MASSES[SQUARE])}
    return NamoScene.of(_room(), {CUPBOARD: np.array(CLOSET)}, movable, {SQUARE: pose}, start, goal)


def _room() -> Array:
    (low, high), y = LENGTH, HALF_WIDTH
    return np.array([[low, -y], [high, -y], [high, y], [low, y]])


def _told(pose: Array, start: Array, concealed: dict[str, Any]) -> Scene:
    bodies = {
        SQUARE: {
            "kind": "office_table",
            "size": list(SIZES[SQUARE]),
            "height": HEIGHT,
            "nominal_mass": MASSES[SQUARE],
            "pose": pose.tolist(),
        },
        CUPBOARD: {"kind": "fixture", "polygon": [list(corner) for corner in CLOSET], "height": 1.0},
    }
    told = {
        "name": "namo-concealed",
        "room": {"outline": _room().tolist()},
        "robot": {"pose": start.tolist()},
        "bodies": bodies,
        "concealed": concealed,
    }
    return parse_settings(told, Scene, "a room that conceals something")
