"""Reads the pictures of one moment: which body is where, from all cameras together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_model.errors import ModelError
from pbrl_model.tags.calibration import CameraCalibration
from pbrl_model.tags.finder import SeenTag, TagFinder
from pbrl_model.tags.pose import BodyPose, View, solve_pose
from pbrl_model.tags.sheet import TagMount

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

WORST_FIT = 2.0
"""Root mean square reprojection error [px] above which views contradict each other."""
PIXEL_ERROR = 0.1
"""Of a corner [px], for the standard deviations that are given."""
MOST_UNSURE = 0.03
"""Standard deviation of a place [m] above which a reading is not given."""


@dataclass(frozen=True)
class Picture:
    """One picture of one camera: (height, width) grey levels.

    Raises:
        ModelError: it is not one of this camera.
    """

    camera: CameraCalibration
    image: Image

    def __post_init__(self) -> None:
        self.camera.check(self.image)


@dataclass(frozen=True)
class BodyReading:
    """Where a body is.

    Attributes:
        name: of the body.
        position: (3,) [m] of its frame in `world`.
        quaternion: (4,) x y z w.
        sd_position: (3,) standard deviation [m] that the corners' noise makes; calibration is not in it.
        sd_turn: (3,) the same of the turn about the axes of `world` [rad].
        residual: root mean square reprojection error [px].
        cameras: names of those that were used.
    """

    name: str
    position: Array
    quaternion: Array
    sd_position: Array
    sd_turn: Array
    residual: float
    cameras: tuple[str, ...]


class TagReader:
    """Finds tags in pictures and says where the bodies are that wear them.

    Args:
        dictionary: OpenCV's name of the family of tags.
        worn: mounts by body (see `sheet.worn_tags`).
    """

    def __init__(self, dictionary: str, worn: Mapping[str, tuple[TagMount, ...]]) -> None:
        self._finder = TagFinder(dictionary)
        self._corners = {mount.id: (name, mount.corners) for name, mounts in worn.items() for mount in mounts}
        self._order = tuple(worn)

    def find(self, pictures: Sequence[Picture]) -> list[list[SeenTag]]:
        """Return the tags of the sheet in each picture."""
        found = [self._finder.find(picture.image, picture.camera) for picture in pictures]
        return [[tag for tag in tags if tag.id in self._corners] for tags in found]

    def read(self, pictures: Sequence[Picture]) -> list[BodyReading]:
        """Return where the bodies are whose tags are seen, in the order of the sheet.

        Args:
            pictures: taken at one moment, one a camera.
        """
        views: dict[str, list[View]] = {}
        for picture, tags in zip(pictures, self.find(pictures), strict=True):
            for tag in tags:
                name, corners = self._corners[tag.id]
                views.setdefault(name, []).append(View(picture.camera, corners, tag.rays))
        readings = (read_body(name, views[name]) for name in self._order if name in views)
        return [reading for reading in readings if reading is not None]


def read_body(name: str, views: Sequence[View]) -> BodyReading | None:
    """Return a body's pose from what is seen of it; None where that does not say.

    Views that contradict the others (a tag misread, a camera that was knocked) are left out one by one.
    """
    left = list(views)
    pose = _solve(left)
    while pose is not None and pose.residual > WORST_FIT and len(left) > 1:
        trials = [(_solve(left[:k] + left[k + 1 :]), k) for k in range(len(left))]
        pose, worst = min(trials, key=lambda trial: math.inf if trial[0] is None else trial[0].residual)
        del left[worst]
    if pose is None or pose.residual > WORST_FIT:
        return None
    sd = PIXEL_ERROR * np.sqrt(np.diag(pose.covariance))
    if not (sd[:3] < MOST_UNSURE).all():
        return None
    cameras = tuple(dict.fromkeys(view.camera.name for view in left))
    return BodyReading(name, pose.position, pose.quaternion, sd[:3], sd[3:], pose.residual, cameras)


def _solve(views: Sequence[View]) -> BodyPose | None:
    try:
        return solve_pose(views)
    except (ModelError, np.linalg.LinAlgError):
        return None
