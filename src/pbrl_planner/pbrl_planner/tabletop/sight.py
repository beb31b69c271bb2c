"""Finds items in a picture from over the table: threshold, contour, box (thesis 3.1.4), and which item each box is.

Items are darker than the table. What a camera sees of a box is its top and a little of its sides; where the box is then
follows from what would be seen of it there: the middle and the direction of the seen area are brought to agree. Which
way round an item lies is told by a lighter label at the end that its x points to, or else by how it lay before.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from pbrl_control.planar import Array, placed, wrap
from pbrl_model.tags.calibration import CameraCalibration
from pbrl_planner.tabletop.desk import Item, Table

Image = NDArray[np.uint8]

FARTHEST = 1e6
"""A corner further from the picture than this [px] is that of a camera which cannot be."""
DARK = 0.75
"""Of the table's brightness: what is darker belongs to an item."""
SMALLEST = 1e-4
"""Area [m^2] below which a dark spot is dirt."""
UNLIKE = 0.2
"""By which share of its sides a box may look longer or shorter than an item that it is taken for."""
NEARBY = 0.5
"""[m] away from where an item was that count as much as a side that is twice as long."""
OBLONG = 1.15
"""Sides of a box from which the seen area itself has a clear direction."""
LABELLED = 15.0
"""Grey levels by which the end with the label is lighter."""
WHOLE = 0.97
"""Share of an item's picture that has to be dark where it is taken to lie as it lay."""
ROUNDS = 4
SQUARE = math.pi / 2.0


@dataclass(frozen=True)
class TallItem:
    """An item and how tall it is, which decides what is seen of its sides.

    Attributes:
        item: seen from above.
        height: [m].
    """

    item: Item
    height: float


@dataclass(frozen=True)
class Sight:
    """What a picture shows.

    Attributes:
        poses: (3,) of each item that was found, by name [m, m, rad].
        missing: names of the items that were not.
        strange: middles (2,) of dark boxes that are none of the items [m].
    """

    poses: Mapping[str, Array]
    missing: tuple[str, ...]
    strange: tuple[Array, ...]

    def complaint(self) -> str:
        """Return what is wrong, in words; empty where every item was found."""
        if not self.missing:
            return ""
        more = f"; {len(self.strange)} boxes were seen that are none of them" if self.strange else ""
        return f"not seen: {', '.join(self.missing)}{more}; put them on the table, apart from each other"


class ItemFinder:
    """Finds known items on a table.

    Args:
        table: outside which nothing is looked for.
        items: that there are.
        obstacles: that are known, and where each is (3,): what is dark there is looked through.
    """

    def __init__(
        self, table: Table, items: Sequence[TallItem], obstacles: Sequence[tuple[TallItem, Array]] = ()
    ) -> None:
        self.table, self.items, self.obstacles = table, tuple(items), tuple(obstacles)

    def find(self, image: Image, camera: CameraCalibration, before: Mapping[str, Array] | None = None) -> Sight:
        """Find the items in a picture.

        Args:
            image: (height, width) grey levels.
            camera: that took it.
            before: where items were, (3,) by name; it decides between items alike and which way round they lie.
        """
        known, dark = before or {}, self._dark(image, camera)
        poses, strange = self._matched(image, dark, camera, known)
        # Where items touch, two are one blob: one that lies where it lay is taken out of it, then the other is seen.
        for tall in self.items:
            name = tall.item.name
            if name not in poses and name in known and _is_there(dark, known[name], tall, camera):
                rest = dark.copy()
                _cut_out(rest, known[name], tall, camera)
                again, left = self._matched(image, rest, camera, known)
                if len(again) >= len(poses):
                    poses, strange, dark = {**again, name: known[name]}, left, rest
        missing = tuple(tall.item.name for tall in self.items if tall.item.name not in poses)
        return Sight(poses, missing, tuple(strange))

    def _matched(
        self, image: Image, dark: Image, camera: CameraCalibration, known: Mapping[str, Array]
    ) -> tuple[dict[str, Array], list[Array]]:
        """Return the poses of items that blobs are taken for, and the middles of other blobs."""
        blobs = self._blobs(dark, camera)
        costs = np.array([[self._unlike(blob, camera, tall, known) for tall in self.items] for blob in blobs])
        poses: dict[str, Array] = {}
        taken = set()
        rows, columns = linear_sum_assignment(np.minimum(costs, 1e3)) if len(blobs) else ((), ())
        for row, column in zip(rows, columns, strict=True):
            if math.isfinite(costs[row, column]):
                tall = self.items[column]
                poses[tall.item.name] = _pose(image, blobs[row], camera, tall, known.get(tall.item.name))
                taken.add(int(row))
        return poses, [_on_plane(blob, camera, 0.0).mean(axis=0) for k, blob in enumerate(blobs) if k not in taken]

    def _dark(self, image: Image, camera: CameraCalibration) -> Image:
        """Return where the table is dark, and no obstacle is known to be."""
        low, high = self.table.low, self.table.high
        corners = np.array([[low[0], low[1], 0.0], [high[0], low[1], 0.0], [*high, 0.0], [low[0], high[1], 0.0]])
        top = _filled(image.shape, camera.project(corners))
        if not top.any():
            return top
        bright = float(np.percentile(image[top > 0], 90))
        dark = ((image < DARK * bright) & (top > 0)).astype(np.uint8)
        for tall, pose in self.obstacles:
            _cut_out(dark, pose, tall, camera)
        return dark

    def _blobs(self, dark: Image, camera: CameraCalibration) -> list[Array]:
        """Return the outlines (k, 2) [px] of what is dark."""
        dark = np.asarray(cv2.morphologyEx(dark, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)))
        found, _ = cv2.findContours(dark, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        outlines = [np.asarray(each[:, 0], dtype=float) for each in found if len(each) >= 4]
        return [each for each in outlines if _area(_on_plane(each, camera, 0.0)) > SMALLEST]

    def _unlike(self, blob: Array, camera: CameraCalibration, tall: TallItem, known: Mapping[str, Array]) -> float:
        """Return how little an outline looks like an item; infinite where it is none."""
        (x, y), sides, _ = cv2.minAreaRect(_on_plane(blob, camera, tall.height).astype(np.float32))
        longer, shorter = max(sides), min(sides)
        # A pixel is lost at each edge, and a little of the sides is seen.
        slack = UNLIKE * tall.item.width + 2.0 * _pixel(camera)
        off = max(abs(longer - tall.item.length), abs(shorter - tall.item.width))
        if off > slack:
            return math.inf
        before = known.get(tall.item.name)
        away = 0.0 if before is None else math.hypot(x - before[0], y - before[1])
        return off / tall.item.length + away / NEARBY


def _pose(image: Image, blob: Array, camera: CameraCalibration, tall: TallItem, before: Array | None) -> Array:
    """Return the pose (3,) of an item from its outline in the picture."""
    seen = _on_plane(blob, camera, tall.height)
    middle, angle, _ = _shape(seen)
    square = tall.item.length < OBLONG * tall.item.width
    pose = np.array([*middle, angle])
    for _ in range(ROUNDS):
        would = _on_plane(_silhouette(pose, tall, camera), camera, tall.height)
        there, turned, _ = _shape(would)
        off = angle - turned
        period = SQUARE if square else math.pi
        pose = np.array([*(pose[:2] + middle - there), pose[2] + off - period * round(off / period)])
    return _right_way_round(image, pose, camera, tall, square, before)


def _right_way_round(
    image: Image, pose: Array, camera: CameraCalibration, tall: TallItem, square: bool, before: Array | None
) -> Array:
    """Turn a pose (3,) so that its x points to the label, or else as it did before."""
    turns = [k * (SQUARE if square else math.pi) for k in range(4 if square else 2)]
    reach = 0.42 * tall.item.length
    light = []
    for turn in turns:
        ahead = placed(np.array([[reach, 0.0]]), np.array([pose[0], pose[1], pose[2] + turn]))[0]
        column, row = np.rint(camera.project(np.array([[*ahead, tall.height]]))[0]).astype(int)
        patch = image[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3]
        light.append(float(patch.mean()) if patch.size else 0.0)
    order = np.argsort(light)
    if light[order[-1]] - light[order[-2]] > LABELLED:
        turn = turns[int(order[-1])]
    else:
        heading = 0.0 if before is None else float(before[2])
        turn = min(turns, key=lambda each: abs(wrap(float(pose[2]) + each - heading)))
    return np.array([pose[0], pose[1], wrap(float(pose[2]) + turn)])


def _silhouette(pose: Array, tall: TallItem, camera: CameraCalibration) -> Array:
    """Return the outline (k, 2) [px] that an item would have at a pose (3,)."""
    corners = placed(tall.item.half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), pose)
    points = np.vstack([np.column_stack((corners, np.full(4, z))) for z in (0.0, tall.height)])
    return np.asarray(cv2.convexHull(camera.project(points).astype(np.float32))[:, 0], dtype=float)


def _is_there(dark: Image, pose: Array, tall: TallItem, camera: CameraCalibration) -> bool:
    """Say whether all that would be dark with an item at a pose (3,) is."""
    seen = _painted(dark.shape, pose, tall, camera)
    return bool(seen.any()) and float(dark[seen > 0].mean()) >= WHOLE


def _cut_out(dark: Image, pose: Array, tall: TallItem, camera: CameraCalibration) -> None:
    """Make bright what would be dark with an item at a pose (3,), and a pixel around it."""
    dark[cv2.dilate(_painted(dark.shape, pose, tall, camera), np.ones((3, 3), np.uint8)) > 0] = 0


def _painted(shape: tuple[int, ...], pose: Array, tall: TallItem, camera: CameraCalibration) -> Image:
    """Return a picture in which an item at a pose (3,) is 1."""
    return _filled(shape, _silhouette(pose, tall, camera))


def _filled(shape: tuple[int, ...], corners: Array) -> Image:
    """Return a picture in which a convex polygon (k, 2) [px] is 1; nothing is, where it lies beyond all pictures."""
    picture = np.zeros(shape, np.uint8)
    if (np.abs(corners) < FARTHEST).all():  # it is drawn row by row, and further away rows are counted in thousands
        cv2.fillConvexPoly(picture, np.rint(corners).astype(np.int32), (1,))
    return picture


def _shape(outline: Array) -> tuple[Array, float, float]:
    """Return middle (2,), direction [rad] and area of what an outline (k, 2) encloses.

    The direction is that of the longer axis; of what is about as wide as long it is a side's.
    """
    origin = outline.mean(axis=0)
    flat = (outline - origin).astype(np.float32)
    moments = cv2.moments(flat)
    area = moments["m00"]
    middle = origin + np.array([moments["m10"], moments["m01"]]) / area
    spread, cross = moments["mu20"] - moments["mu02"], 2.0 * moments["mu11"]
    total = moments["mu20"] + moments["mu02"]
    if math.hypot(spread, cross) > (OBLONG**2 - 1.0) / (OBLONG**2 + 1.0) * total:
        return middle, 0.5 * math.atan2(cross, spread), area
    return middle, math.radians(cv2.minAreaRect(flat)[2]), area


def _area(outline: Array) -> float:
    x, y = outline.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0)


def _on_plane(pixels: Array, camera: CameraCalibration, height: float) -> Array:
    """Return where pixels (k, 2) look at the plane at a height over the table, (k, 2) [m]."""
    rays = np.column_stack((camera.rays(pixels), np.ones(len(pixels)))) @ camera.rotation.T
    scale = (height - camera.position[2]) / rays[:, 2]
    return np.asarray(camera.position[:2] + scale[:, None] * rays[:, :2])


def _pixel(camera: CameraCalibration) -> float:
    """Return how wide a pixel is on the table [m]."""
    return float(abs(camera.position[2]) / camera.matrix[0, 0])
