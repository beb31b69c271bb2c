"""Scenes in the SVG format of the open project `namosim`: walls, movable things, robots and where they are to go.

The sheet is the room. Its shapes say by their attribute `type`, or by that of a group they are in, what they are:
`wall`, `movable`, `room` for a floor smaller than the sheet. An element `namo_config` lists agents and their goals by
id; the shape with the agent's id is the robot where it starts, that with the goal's id where it is to be. Headings are
an attribute `angle` [deg], or a small path from tail to tip of type `orientation` beside the shape in its group.

What is in a drawing and is not understood is told in sentences. What would make a scene another one than was drawn, a
wall without an area for instance, is an error.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from shapely import Polygon

from pbrl_control.navigation.footprint import Footprint
from pbrl_control.planar import Array, rotation
from pbrl_namo.errors import NamoError
from pbrl_namo.regions.free_space import drive_radius
from pbrl_namo.scene import Movable, NamoScene
from pbrl_namo.scenes.svg_drawing import Drawing, Drawn, local, read_drawing
from pbrl_namo.scenes.svg_frame import read_numbers
from pbrl_namo.scenes.svg_path import Outline

FIXED, MOVABLE, ROOM = ("wall", "fixed", "static"), ("movable",), ("room", "floor")
OF_AGENTS = ("shape", "orientation", "robot", "goal")
LAYERS = {"movables": "movable", "walls": "wall", "goals": "goal", "robots": "robot"}
"""Layers, by id or label, that say what the shapes in them are where these do not; also with `_layer` behind."""

LARGEST = 1000.0
"""Coordinate on the floor [m] up to which a drawing is taken for a room."""

FLAT = 1e-6
"""How much [m] chords of a curve may be off after those on one line are joined."""

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z")


@dataclass(frozen=True)
class SvgScene:
    """A scene from a drawing.

    Attributes:
        scene: room, things, robot and goal.
        agent: whose start and goal they are.
        goals: all goals of that agent; the scene's is the one asked for, else the first.
        margin: that the drawing's own planner keeps around its robot, a cell of its grid if it does not say [m].
        notes: what was not understood, or taken in a way that one should know of, in sentences.
    """

    scene: NamoScene
    agent: str
    goals: tuple[str, ...]
    margin: float
    notes: tuple[str, ...]


def load_svg(path: str | Path, agent: str = "", goal: str = "", fit: Footprint | None = None) -> SvgScene:
    """Read a scene from a file; see `read_svg`.

    Raises:
        NamoError: the file cannot be read, or its content not be used.
    """
    file = Path(path)
    try:
        text = file.read_bytes()
    except OSError as error:
        raise NamoError(f"scene {file}: expected a readable SVG file, got {error.strerror or error}") from error
    return read_svg(text, agent, goal, fit, what=f"scene {file.name}")


def read_svg(
    text: bytes, agent: str = "", goal: str = "", fit: Footprint | None = None, *, what: str = "scene"
) -> SvgScene:
    """Read a scene.

    Args:
        text: of an SVG file.
        agent: id of the robot; may be left out where there is one.
        goal: id of its goal; the first where it is left out.
        fit: a robot to put into the place of the one drawn; all is scaled so that it passes where that one does.
        what: the text is, for messages.

    Raises:
        NamoError: the drawing cannot be used, or has no such agent or goal; the message names what it has.
    """
    drawing = read_drawing(text, what)
    notes = list(drawing.notes)
    _check_names(drawing, what)
    agents = _agents(drawing, notes)
    name = _choose(agent, list(agents), f"{what}: agent")
    end = _choose(goal, agents[name], f"{what}: goal of {name!r}", first=True)
    if not goal and len(agents[name]) > 1:
        notes.append(f"{name!r} has {len(agents[name])} goals; the first, {end!r}, is taken.")
    shape, heading = _posed(drawing, name, f"{what}: robot")
    if heading is None:
        notes.append(f"No heading of {name!r} is drawn; it looks along x.")
    start = np.array([*shape.centroid.coords[0], heading or 0.0])
    goal_shape, goal_heading = _posed(drawing, end, f"{what}: goal")
    target = np.array([*goal_shape.centroid.coords[0], math.nan if goal_heading is None else goal_heading])
    drawn = Footprint.polygon((shapely.get_coordinates(shape)[:-1] - start[:2]) @ rotation(float(start[2])))
    factor = 1.0 if fit is None else drive_radius(fit, 0.0) / drive_radius(drawn, 0.0)
    taken = {name, end}.union(*agents.values())
    room, fixed, movable, poses = _things(drawing, taken, notes, factor, what)
    for other in [other for other in agents if other != name]:
        fixed[_free_name(other, fixed, movable)] = _scaled(_posed(drawing, other, f"{what}: robot")[0], factor)
        notes.append(f"{other!r} is another robot; it stands in the way where it is drawn and does not move.")
    robot = drawn if fit is None else fit
    scale = np.array([factor, factor, 1.0])
    scene = NamoScene(room, fixed, movable, poses, scale * start, scale * target, robot)
    return SvgScene(scene, name, tuple(agents[name]), factor * _margin(drawing, what), tuple(notes))


def _check_names(drawing: Drawing, what: str) -> None:
    """Raise NamoError where two shapes have one id: which of them is meant could not be told."""
    seen: set[str] = set()
    for shape in drawing.shapes:
        if shape.name and shape.name in seen:
            raise NamoError(f"{what}: expected every id once, got {shape.name!r} twice; rename one")
        seen.add(shape.name)


def _agents(drawing: Drawing, notes: list[str]) -> dict[str, list[str]]:
    """Return the agents with their goals, by the configuration, or by the types of shapes where there is none."""
    if drawing.config is not None:
        notes.append("Behaviours and their parameters in namo_config are another planner's, and not used.")
        agents = [element for element in drawing.config if local(element.tag) in ("agent", "agent_config")]
        ends = [[goal.get("goal_id", "") for goal in agent if local(goal.tag) == "goal"] for agent in agents]
        return {agent.get("agent_id", ""): goals for agent, goals in zip(agents, ends, strict=True)}
    robots = [shape.name for shape in drawing.shapes if _role(shape) == "robot" and shape.name]
    goals = [shape for shape in drawing.shapes if _role(shape) == "goal" and shape.name]
    return {robot: [goal.name for goal in goals if goal.attributes.get("agent_id", robot) == robot] for robot in robots}


def _margin(drawing: Drawing, what: str) -> float:
    """Return the margin that the configuration asks for [m]; 0 where it says nothing of it."""
    for key in ("collision_margin_cm", "cell_size_cm"):
        told = None if drawing.config is None else drawing.config.get(key)
        if told is not None:
            numbers = read_numbers(told, f"{what}: namo_config: {key}")
            if len(numbers) != 1 or not 0.0 <= numbers[0] <= 100.0 * LARGEST:
                raise NamoError(f"{what}: namo_config: {key}: expected one length in centimetres, got {told[:40]!r}")
            return numbers[0] / 100.0
    return 0.0


def _choose(asked: str, known: Sequence[str], what: str, *, first: bool = False) -> str:
    """Return what was asked for, or the only one (or the first); raise NamoError with what there is."""
    if asked in known and asked:
        return asked
    if not known:
        raise NamoError(
            f"{what}: expected one in namo_config, got none; add it, and draw a shape with its id (a ROS map with "
            "shapes over its picture is another format)"
        )
    if asked or (len(known) > 1 and not first):
        raise NamoError(f"{what}: expected one of {', '.join(map(repr, known))}, got {asked!r}; name one of them")
    return known[0]


def _posed(drawing: Drawing, name: str, what: str) -> tuple[Polygon, float | None]:
    """Return the shape of a robot or a goal, and its heading [rad]; None where it is not drawn."""
    own = [shape for shape in drawing.shapes if shape.name == name]
    members = own or [shape for shape in drawing.shapes if any(group[0] == name for group in shape.groups)]
    arrows = [shape for shape in members if shape.attributes.get("type") == "orientation"]
    arrows += [shape for shape in drawing.shapes if shape.name in (f"{name}_dir", f"{name}_direction")]
    bodies = [shape for shape in members if shape not in arrows]
    bodies = [shape for shape in bodies if shape.attributes.get("type") == "shape"] or bodies
    if len(bodies) != 1:
        raise NamoError(f"{what}: expected one shape with the id {name!r} or in a group of that id, got {len(bodies)}")
    polygon = _one_polygon(bodies[0], what)
    for key in ("angle", "orientation"):
        if key in bodies[0].attributes:
            told = read_numbers(bodies[0].attributes[key], f"{what} {name!r}: {key}")
            if len(told) != 1:
                raise NamoError(f"{what} {name!r}: {key}: expected one number of degrees, got {len(told)}")
            return polygon, math.remainder(math.radians(told[0]), 2.0 * math.pi)
    if not arrows or not arrows[0].outlines:
        return polygon, None
    (x0, y0), (x1, y1) = arrows[0].outlines[0].points[:2]
    return polygon, math.atan2(y1 - y0, x1 - x0)


def _things(
    drawing: Drawing, taken: set[str], notes: list[str], factor: float, what: str
) -> tuple[Polygon, dict[str, Polygon], dict[str, Movable], dict[str, Array]]:
    """Return the room, what is fixed, what can be moved, and where that is: all times a factor."""
    room = shapely.box(0.0, 0.0, *(factor * drawing.sheet))
    fixed: dict[str, Polygon] = {}
    movable: dict[str, Movable] = {}
    poses: dict[str, Array] = {}
    for shape in drawing.shapes:
        if shape.name in taken or any(group[0] in taken for group in shape.groups):
            continue
        role = _role(shape)
        name = _free_name(shape.name or role or "thing", fixed, movable)
        if name != shape.name and role in (*FIXED, *MOVABLE):
            notes.append(f"{shape} is called {name!r}.")
        if role in FIXED:
            pieces = _pieces(shape, what)
            names = [name] if len(pieces) == 1 else [f"{name}_{number + 1}" for number in range(len(pieces))]
            fixed.update({n: _scaled(p, factor) for n, p in zip(names, pieces, strict=True)})
        elif role in MOVABLE:
            outline = _scaled(_one_polygon(shape, what), factor)
            middle = np.array(outline.centroid.coords[0])
            movable[name] = Movable(shapely.get_coordinates(outline.exterior)[:-1] - middle)
            poses[name] = np.array([*middle, 0.0])
            if not room.covers(outline):
                notes.append(f"{name!r} is partly outside the sheet.")
        elif role in ROOM:
            room = _scaled(_one_polygon(shape, what), factor)
        elif role in OF_AGENTS:
            notes.append(f"{shape} of type {role!r} belongs to no agent, and is left out.")
        else:
            notes.append(f"{shape} has {f'the unknown type {role!r}' if role else 'no type'}, and is left out.")
    return room, fixed, movable, poses


def _role(shape: Drawn) -> str:
    """Return what a shape is: its own type, else that of the innermost group that has one, or is a known layer."""
    if "type" in shape.attributes:
        return shape.attributes["type"].strip().lower()
    for name, kind, label in reversed(shape.groups):
        layer = LAYERS.get(name.removesuffix("_layer")) or LAYERS.get(label.removesuffix("_layer"))
        if kind or layer:
            return kind.strip().lower() or layer or ""
    return ""


def _free_name(wanted: str, *taken: dict[str, Polygon] | dict[str, Movable]) -> str:
    """Return a name of letters, digits and underscores that is not taken yet, as near to the wanted one as can be."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", wanted)
    name = name if NAME.match(name) else f"thing_{name}"
    number, found = 2, name
    while any(found in names for names in taken):
        found, number = f"{name}_{number}", number + 1
    return found


def _one_polygon(shape: Drawn, what: str) -> Polygon:
    """Return the only outline of a shape, without holes."""
    polygons = [_polygon(outline, shape, what) for outline in shape.outlines]
    whole = [polygon for polygon in polygons if not any(o.contains(polygon) for o in polygons if o is not polygon)]
    if len(whole) != 1:
        raise NamoError(f"{what}: {shape}: expected one outline, got {len(whole)}; draw them as things of their own")
    return whole[0]


def _pieces(shape: Drawn, what: str) -> list[Polygon]:
    """Return the polygons without holes that a wall is made of; one with holes is cut into triangles."""
    polygons = [_polygon(outline, shape, what) for outline in shape.outlines]
    if not polygons:
        raise NamoError(f"{what}: {shape}: expected an outline, got none")
    area: shapely.geometry.base.BaseGeometry = polygons[0]
    for polygon in polygons[1:]:
        area = area.symmetric_difference(polygon)
    pieces: list[Polygon] = []
    for part in shapely.get_parts(area):
        whole = not part.interiors
        pieces += [part] if whole else list(shapely.get_parts(shapely.constrained_delaunay_triangles(part)))
    return pieces


def _polygon(outline: Outline, shape: Drawn, what: str) -> Polygon:
    """Return the polygon of an outline; a line that is open is closed, as it is when it is filled."""
    points = outline.array()
    if not np.isfinite(points).all() or np.abs(points).max() > LARGEST:
        raise NamoError(f"{what}: {shape}: expected coordinates of at most {LARGEST:.0f} m, got larger ones")
    if len({tuple(point) for point in points.tolist()}) < 3:
        raise NamoError(f"{what}: {shape}: expected an outline with an area, got a line; draw its edges")
    polygon = Polygon(points)
    polygon = polygon.simplify(FLAT) if outline.curved else polygon
    if not polygon.is_valid or polygon.area <= 0.0:
        raise NamoError(f"{what}: {shape}: expected an outline that does not cross itself, and has an area")
    return polygon


def _scaled(polygon: Polygon, factor: float) -> Polygon:
    return polygon if factor == 1.0 else shapely.transform(polygon, lambda points: factor * points)
