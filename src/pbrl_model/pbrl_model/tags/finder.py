"""Finds tags in one picture: OpenCV reads them, then each side is fitted to the edge of its black square.

OpenCV's own corners are pulled into the square by blur (0.15 px at 0.6 px of blur), which at a tag of 50 px is half a
per cent of its distance: a centimetre of height. A line along a whole side has no corner to be pulled from, and forty
places on it average the pixels' noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pbrl_model.errors import ModelError
from pbrl_model.tags.calibration import CameraCalibration

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

PLACES = np.linspace(0.1, 0.9, 24)
"""Where across a side its edge is looked for, as a share of it; the ends are rounded by blur."""
STEPS = 13
"""Samples across an edge."""
REACH = (1.5, 3.0)
"""How far from a side its edge is looked for, at least and at most [px]; in between half a cell, which is plain."""
ROUNDS = 2
"""The second looks along the lines that the first has found."""
CONTRAST = 15.0
"""Grey levels of 256 between black and white below which a side is no edge."""
CLEAR = 8
"""Places on a side that must show an edge."""


@dataclass(frozen=True)
class SeenTag:
    """One tag in one picture.

    Attributes:
        id: of the tag.
        corners: (4, 2) [px], clockwise from the upper left of the tag as printed.
        rays: (4, 2) the same without the lens, as `CameraCalibration.rays`.
    """

    id: int
    corners: Array
    rays: Array


class TagFinder:
    """Finds the tags of one family.

    Args:
        dictionary: OpenCV's name of the family, e.g. "DICT_APRILTAG_36h11".

    Raises:
        ModelError: OpenCV knows no such family.
    """

    def __init__(self, dictionary: str) -> None:
        number = getattr(cv2.aruco, dictionary, None) if dictionary.startswith("DICT_") else None
        if number is None:
            raise ModelError(
                f"dictionary: expected a family of cv2.aruco such as DICT_APRILTAG_36h11, got {dictionary!r}"
            )
        family = cv2.aruco.getPredefinedDictionary(number)
        self._cells = family.markerSize + 2
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        self._detector = cv2.aruco.ArucoDetector(family, parameters)

    def find(self, image: Image, camera: CameraCalibration) -> list[SeenTag]:
        """Return the tags in a picture, by id; a tag whose sides cannot be fitted is left out.

        Args:
            image: (height, width) grey levels.
            camera: that took it.

        Raises:
            ModelError: the picture is not one of this camera.
        """
        camera.check(image)
        found, ids, _ = self._detector.detectMarkers(image)
        seen = []
        for corners, number in sorted(
            zip(found, [] if ids is None else ids.ravel().tolist(), strict=True), key=lambda one: one[1]
        ):
            rays = fit_sides(image, np.asarray(corners[0], dtype=float), self._cells, camera)
            if rays is not None:
                seen.append(SeenTag(int(number), camera.pixels(rays), rays))
        return seen


def fit_sides(image: Image, corners: Array, cells: int, camera: CameraCalibration) -> Array | None:
    """Fit a line to each side of a tag's black square and return where neighbours meet.

    Lines are fitted where they are straight: to rays, not to pixels that a lens has bent.

    Args:
        image: (height, width) grey levels.
        corners: (4, 2) [px] to within a pixel or so, in order.
        cells: of the tag along a side, border included.
        camera: that took the picture.

    Returns:
        Rays (4, 2) of the corners in the same order; None where a side shows no edge.
    """
    for _ in range(ROUNDS):
        edges = [_edge_points(image, corners[k], corners[(k + 1) % 4], cells) for k in range(4)]
        if any(edge is None for edge in edges):
            return None
        rays = camera.rays(np.concatenate([edge for edge in edges if edge is not None]))
        ends = np.cumsum([len(edge) for edge in edges if edge is not None])[:-1]
        lines = np.array([_line(points) for points in np.split(rays, ends)])
        meet = np.cross(np.roll(lines, 1, axis=0), lines)
        if not (np.abs(meet[:, 2]) > 0.1).all():
            return None
        out = meet[:, :2] / meet[:, 2:]
        corners = camera.pixels(out)
    return out


def _edge_points(image: Image, start: Array, end: Array, cells: int) -> Array | None:
    """Return points (n, 2) [px] on the edge near the line from a corner to the next; None where there is none."""
    along = end - start
    length = float(np.hypot(*along))
    if length < 8.0:
        return None
    inward = np.array([-along[1], along[0]]) / length  # corners run clockwise in a picture, whose y is down
    reach = min(max(0.5 * length / cells, REACH[0]), REACH[1])
    depths = np.linspace(-reach, reach, STEPS)
    places = start + PLACES[:, None] * along
    where = (places[:, None] + depths[:, None] * inward).astype(np.float32)
    profile = cv2.remap(image, where[..., 0], where[..., 1], cv2.INTER_LINEAR)
    drop = -np.diff(profile.astype(float), axis=1)  # white outside, black inside
    drop = np.maximum(drop, 0.0)
    total = drop.sum(axis=1)
    clear = total > CONTRAST
    if clear.sum() < CLEAR:
        return None
    middles = (depths[1:] + depths[:-1]) / 2
    depth = drop[clear] @ middles / total[clear]
    kept = np.abs(depth - np.median(depth)) < 0.75
    return places[clear][kept] + depth[kept, None] * inward


def _line(points: Array) -> Array:
    """Return the line (3,) a, b, c with a x + b y + c = 0 and a^2 + b^2 = 1 nearest to points (n, 2)."""
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle, full_matrices=False)[2][-1]
    return np.array([*normal, -normal @ middle])
