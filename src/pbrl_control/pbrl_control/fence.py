"""The controller's fence: no part of the robot, nor what it holds, is sent where it may not be.

Who plans keeps clear of such places anyway; this holds whoever does not. The robot's interface has a fence of its own,
nearer by, see `bullet_sim.fence`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin
import shapely
from numpy.typing import NDArray

from pbrl_control.errors import ControlError
from pbrl_control.kinematics import ARM_JOINTS, BODY_JOINTS, SIDES, Posture, RobotKinematics
from pbrl_control.limits import LONGEST
from pbrl_control.localizer import BaseLocalizer
from pbrl_control.percept import BodyShape, Grip, Percept, Tag, gripper_tag
from pbrl_control.planar import Array, compose, inverse, placed, rotate_vector
from pbrl_control.settings import FenceSettings
from pbrl_control.types import BodyCommand

TOLD = "keep_out_"
"""Beginning of the name under which /scene tells a place that nothing may enter, a little wider than it is."""
QUARTER_BACK = np.array([0.0, 0.0, -0.5 * math.pi])
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
FENCE = "fence: "
"""Beginning of what is told of it."""
NOISE = 1e-4
"""[m] of a distance that is no approach."""


class Fence:
    """Looks at where a command would lead.

    Args:
        urdf: text of the robot's description, with its collision shapes.
        settings: polygons, and how near one may come.

    Raises:
        ControlError: the description cannot be read, or a polygon is none.
    """

    def __init__(self, urdf: str, settings: FenceSettings) -> None:
        try:
            self._model = pin.buildModelFromXML(urdf)
            self._shapes = pin.buildGeomFromUrdfString(self._model, urdf, pin.GeometryType.COLLISION)
        except (ValueError, RuntimeError) as error:
            raise ControlError(f"robot description: expected URDF with collision shapes, got {error}") from error
        self._data, self._placed = self._model.createData(), self._shapes.createData()
        self._boxes = np.array([_box(shape) for shape in self._shapes.geometryObjects])
        order = (*BODY_JOINTS, *ARM_JOINTS["left"], *ARM_JOINTS["right"])
        self._order = [self._model.joints[self._model.getJointId(name)].idx_q for name in order]
        self._settings = settings
        self._kinematics = RobotKinematics(urdf)
        self._own = [_polygon(corners, f"fence.keep_out.{k}") for k, corners in enumerate(settings.keep_out)]
        self._region = shapely.union_all(self._own)
        self._localizer = BaseLocalizer(self._kinematics)
        self._wheels = np.zeros(3)  # base where commands alone would have it
        self._sent = np.zeros(3)
        self._last: float | None = None
        self._tags: dict[str, Tag] = {}

    @property
    def stands(self) -> bool:
        """Whether there is anything to keep out of."""
        return not self._region.is_empty

    def told(self, bodies: Mapping[str, BodyShape], poses: Mapping[str, Array]) -> None:
        """Take in what /scene tells: places that nothing may enter, by name, are shrunk by what they may be grazed.

        Args:
            bodies: outlines by name.
            poses: (3,) of what is built in [m, rad].
        """
        wide = [_polygon(placed(bodies[name].footprint, poses[name]), name) for name in bodies if _kept(name, poses)]
        self._region = shapely.union_all([*self._own, *(each.buffer(-self._settings.graze) for each in wide)])

    def fault(self, now: float, percept: Percept, command: BodyCommand) -> str:
        """Return why a command must not be done, in a sentence; empty where it may. Call it at each tick, at rest too.

        Args:
            now: [s].
            percept: what is perceived.
            command: that would be sent.
        """
        posture = percept.posture
        if not self.stands or posture is None:
            return ""
        self._see(now, posture, percept.tags)
        if command.moves() and (fault := self._led_in(now, posture, percept, command)):
            command = BodyCommand(report=fault)
        self._sent = np.array([command.base_v, 0.0, command.base_w])
        return command.report if command.report.startswith(FENCE) else ""

    def _see(self, now: float, posture: Posture, tags: Mapping[str, Tag]) -> None:
        """Take in what is seen at `now` [s], and how far the last command has led."""
        if self._last is not None and now < self._last:  # a clock that was set back: a simulation is begun anew
            self._localizer, self._last = BaseLocalizer(self._kinematics), None
        dt = 0.0 if self._last is None else min(now - self._last, LONGEST)
        self._last = now
        self._wheels = compose(self._wheels, dt * self._sent)
        self._localizer.odometry(now, self._wheels)
        self._tags = dict(tags)
        for side in SIDES:
            if gripper_tag(side) in tags:
                self._localizer.tag(side, tags[gripper_tag(side)], posture)

    def _led_in(self, now: float, posture: Posture, percept: Percept, command: BodyCommand) -> str:
        """Return that a command leads where nothing may be, in a sentence; empty where it does not."""
        pose = self._localizer.pose(now)
        if pose is None:
            return f"{FENCE}expected to know where the base is, but {self._localizer.fault(now)}"
        rates = np.concatenate((np.zeros(2), command.left, command.right))
        ahead = self._settings.ahead
        moved = compose(pose, ahead * np.array([command.base_v, 0.0, command.base_w]))
        loads = self._loads(percept.grips, percept.bodies)
        here = self._parts(pose, posture.vector(), loads)
        there = self._parts(moved, posture.vector() + ahead * rates, loads)
        now_off = shapely.distance(_hulls(here), self._region)
        then_off = shapely.distance(_hulls(there), self._region)
        passing = shapely.distance(_hulls(np.concatenate((here, there), axis=1)), self._region)
        worst = np.where((then_off < now_off - NOISE) & (passing < self._settings.clear), passing, math.inf)
        if math.isinf(worst.min()):
            return ""
        return (
            f"fence: expected to stay {self._settings.clear:.2f} m off, would come within {max(worst.min(), 0.0):.2f} m"
        )

    def _loads(self, grips: Mapping[str, Grip], bodies: Mapping[str, BodyShape]) -> list[tuple[str, Array]]:
        """Return each held outline (k, 2) in the planar axes of a gripper that holds it [m].

        Tags of gripper and object are of one picture: what they say of each other is not late.
        """
        loads = []
        for side, grip in grips.items():
            gripper, thing = self._tags.get(gripper_tag(side)), self._tags.get(grip.object)
            if gripper is None or thing is None or grip.object not in bodies:
                continue
            # Outlines are given in the axes of their tag, a quarter turn before its y axis.
            relative = compose(inverse(_planar(gripper)), compose(_planar(thing), QUARTER_BACK))
            loads.append((side, placed(bodies[grip.object].footprint, relative)))
        return loads

    def _parts(self, pose: Array, joints: Array, loads: Sequence[tuple[str, Array]]) -> Array:
        """Return corners (n, k, 2) of every part and load in `world` [m], base and joints where they are given."""
        q = pin.neutral(self._model)
        q[self._order] = joints
        pin.updateGeometryPlacements(self._model, self._data, self._shapes, self._placed, q)
        rows = [box @ m.rotation.T + m.translation for box, m in zip(self._boxes, self._placed.oMg, strict=True)]
        parts = np.array(rows)[..., :2]
        posture = Posture(float(joints[0]), float(joints[1]), joints[2:9], joints[9:])
        for side, outline in loads:
            frame = self._kinematics.frame(posture, f"{side}_ft")
            yaw = math.atan2(frame.rotation[1, 1], frame.rotation[0, 1])
            parts = _beside(parts, placed(outline, np.array([*frame.position[:2], yaw])))
        return placed(parts.reshape(-1, 2), pose).reshape(parts.shape)


def _planar(tag: Tag) -> Array:
    """Return place and yaw (3,) of a tag; the yaw is that of its y axis, which lies level on a gripper."""
    x, y, _ = rotate_vector(tag.quaternion, np.array([0.0, 1.0, 0.0]))
    return np.array([*tag.position[:2], math.atan2(y, x)])


def _kept(name: str, poses: Mapping[str, Array]) -> bool:
    return name.startswith(TOLD) and name in poses


def _polygon(corners: Array | Sequence[tuple[float, float]], what: str) -> shapely.Polygon:
    found = shapely.Polygon(np.asarray(corners, dtype=float))
    if not found.is_valid or found.area <= 0.0:
        raise ControlError(
            f"{what}: expected corners of a polygon that does not cross itself, got {len(corners)} of them"
        )
    return found


def _box(shape: pin.GeometryObject) -> Array:
    """Return the corners (8, 3) of the box about a collision shape, in its own frame [m]."""
    shape.geometry.computeLocalAABB()
    low, high = np.array(shape.geometry.aabb_local.min_), np.array(shape.geometry.aabb_local.max_)
    return low + CORNERS * (high - low)


def _beside(rows: Array, points: Array) -> Array:
    """Return rows (n, k, 2) and one more of points (m, 2), filled up: a corner that is there twice changes no hull."""
    most = max(rows.shape[1], len(points))
    wide = np.concatenate((rows, np.repeat(rows[:, :1], most - rows.shape[1], axis=1)), axis=1)
    last = np.concatenate((points, np.repeat(points[:1], most - len(points), axis=0)))
    return np.concatenate((wide, last[None]))


def _hulls(places: Array) -> NDArray[np.object_]:
    """Return the convex hull of each row of points (n, k, 2)."""
    return shapely.convex_hull(shapely.multipoints(places))
