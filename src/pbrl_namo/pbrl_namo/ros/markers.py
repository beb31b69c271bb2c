"""The executive's thoughts, drawn for RViz: regions, Q-values, the chosen obstacle, its planned way, forces."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose
from shapely import Polygon
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from pbrl_control.planar import Array, compose
from pbrl_namo.executive.jobs import Move
from pbrl_namo.executive.report import NamoStatus
from pbrl_namo.ros.conversions import WORLD
from pbrl_namo.scene import NamoScene

FLOOR, TEXT, LINE = 0.02, 0.10, 0.02
"""Height of lines above the floor, of letters, width of lines [m]."""
STEP = 0.1
"""Between two poses of a planned way that are drawn [s]."""
ARROW = 0.5
"""Length of a goal's heading [m]."""
FREE = ColorRGBA(r=0.45, g=0.55, b=0.65, a=1.0)
HERE = ColorRGBA(r=0.1, g=0.65, b=0.2, a=1.0)
WANTED = ColorRGBA(r=0.1, g=0.35, b=0.9, a=1.0)
CUT_OFF = ColorRGBA(r=0.6, g=0.0, b=0.1, a=1.0)
CHOSEN = ColorRGBA(r=0.95, g=0.5, b=0.05, a=1.0)
INK = ColorRGBA(r=0.1, g=0.1, b=0.1, a=1.0)


@dataclass(frozen=True)
class Floor:
    """What was planned in last.

    Attributes:
        scene: things where they stood.
        regions: free-space regions of it, as the planner numbers them.
    """

    scene: NamoScene
    regions: tuple[Polygon, ...]


class Drawing:
    """Takes away what is not drawn any more, and nothing that others have drawn."""

    def __init__(self) -> None:
        self._shown: set[tuple[str, int]] = set()

    def update(self, markers: list[Marker], stamp: Time) -> MarkerArray:
        """Return a message that shows these markers and no others of this drawing's."""
        shown = {(marker.ns, marker.id) for marker in markers}
        gone = [Marker(ns=ns, id=number, action=Marker.DELETE) for ns, number in sorted(self._shown - shown)]
        self._shown = shown
        for marker in [*markers, *gone]:
            marker.header.frame_id, marker.header.stamp = WORLD, stamp
        return MarkerArray(markers=[*gone, *markers])


def draw(status: NamoStatus, move: Move | None, floor: Floor | None) -> list[Marker]:
    """Draw one moment.

    Args:
        status: of the executive.
        move: that is at hand; None: none.
        floor: that was planned in; None: nothing was planned yet.
    """
    markers = _goal(status.goal)
    if floor is None:
        return markers
    markers += _regions(status, floor) + _values(status, floor.scene)
    if move is not None and status.object == move.object and move.object in floor.scene.movable:
        markers += _chosen(status, move, floor.scene)
    return markers


def poses_along(move: Move, pose: Array) -> Array:
    """Return poses (n, 3) in `world` [m, rad] through which a move leads a thing, every `STEP` seconds, ends included.

    Args:
        move: twists of the thing's origin in its own axes.
        pose: (3,) from which it sets out.
    """
    poses = [np.asarray(pose, dtype=float)]
    for twist, duration in move.segments:
        steps = max(1, math.ceil(duration / STEP - 1e-9))
        step = _displacement(np.asarray(twist, dtype=float) * duration / steps)
        for _ in range(steps):
            poses.append(compose(poses[-1], step))
    return np.array(poses)


def _displacement(screw: Array) -> Array:
    """Return the pose (3,) to which a constant twist leads in a unit of time: the exponential map of the plane."""
    x, y, turn = screw
    if abs(turn) < 1e-9:
        return np.array([x, y, turn])
    s, c = math.sin(turn) / turn, (1.0 - math.cos(turn)) / turn
    return np.array([s * x - c * y, c * x + s * y, turn])


def _goal(goal: Array) -> list[Marker]:
    marker = Marker(ns="namo/goal", id=0, color=WANTED, pose=_identity())
    if math.isnan(goal[2]):
        marker.type = Marker.CYLINDER
        marker.pose.position = _point(goal[0], goal[1])
        marker.scale.x = marker.scale.y = 0.3
        marker.scale.z = LINE
        return [marker]
    marker.type = Marker.ARROW
    marker.scale.x, marker.scale.y, marker.scale.z = 0.05, 0.12, 0.12
    tip = goal[:2] + ARROW * np.array([math.cos(goal[2]), math.sin(goal[2])])
    marker.points = [_point(*goal[:2]), _point(*tip)]
    return [marker]


def _regions(status: NamoStatus, floor: Floor) -> list[Marker]:
    """Draw each region's border and number; numbers only where they are those that the status speaks of."""
    numbered, markers = status.regions == len(floor.regions), []
    for number, region in enumerate(floor.regions):
        color = _region_color(status, number) if numbered else FREE
        border = Marker(ns="namo/regions", id=number, type=Marker.LINE_LIST, color=color, pose=_identity())
        border.scale.x = LINE
        for ring in (region.exterior, *region.interiors):
            corners = np.array(ring.coords)
            for start, end in pairwise(corners):
                border.points += [_point(*start), _point(*end)]
        markers.append(border)
        if numbered:
            inside = region.representative_point()
            markers.append(_text("namo/region_names", number, f"region {number}", inside.x, inside.y, color=color))
    return markers


def _region_color(status: NamoStatus, number: int) -> ColorRGBA:
    if number == status.region:
        return HERE
    if number == status.target:
        return WANTED
    return CUT_OFF if number in status.cut_off else FREE


def _values(status: NamoStatus, scene: NamoScene) -> list[Marker]:
    """Write on each thing what its openings are worth."""
    markers = []
    for number, name in enumerate(sorted({choice.object for choice in status.choices} & set(scene.movable))):
        lines = [name] + [
            f"{choice.start} to {choice.end}: Q {choice.value:.1f}, p {choice.probability:.2f}"
            for choice in status.choices
            if choice.object == name
        ]
        middle = shapely.centroid(scene.outline(name))
        markers.append(_text("namo/values", number, "\n".join(lines), middle.x, middle.y, 1.0))
    return markers


def _chosen(status: NamoStatus, move: Move, scene: NamoScene) -> list[Marker]:
    """Draw the obstacle that is at hand, the way that it is to go, and what is expected and felt there."""
    name, poses = move.object, poses_along(move, scene.poses[move.object])
    outline = _strip("namo/chosen", 0, np.array(scene.outline(name).exterior.coords), 2.0 * LINE)
    end = _strip("namo/planned", 0, np.array(scene.movable[name].at(poses[-1]).exterior.coords), LINE)
    way = _strip("namo/planned", 1, poses[:, :2], LINE)
    lines = [f"{name}: {move.model_class or 'nothing is known of it'}"]
    expected = move.expected_force if math.isnan(status.expected_force) else status.expected_force
    for what, force in (("expected", expected), ("limit", status.force_limit), ("felt", status.felt_force)):
        if not math.isnan(force):
            lines.append(f"{what} {force:.0f} N")
    return [outline, end, way, _text("namo/forces", 0, "\n".join(lines), *poses[0][:2], 1.5, CHOSEN)]


def _strip(ns: str, number: int, points: Array, width: float) -> Marker:
    marker = Marker(ns=ns, id=number, type=Marker.LINE_STRIP, color=CHOSEN, pose=_identity())
    marker.scale.x = width
    marker.points = [_point(*point) for point in points]
    return marker


def _text(ns: str, number: int, text: str, x: float, y: float, height: float = TEXT, color: ColorRGBA = INK) -> Marker:
    marker = Marker(ns=ns, id=number, type=Marker.TEXT_VIEW_FACING, color=color, pose=_identity(), text=text)
    marker.pose.position = _point(x, y, height)
    marker.scale.z = TEXT
    return marker


def _identity() -> Pose:
    pose = Pose()
    pose.orientation.w = 1.0
    return pose


def _point(x: float, y: float, z: float = FLOOR) -> Point:
    return Point(x=float(x), y=float(y), z=float(z))
