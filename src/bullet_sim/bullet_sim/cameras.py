"""Overhead cameras: where they hang, what their lenses do, and what whoever calibrated them believes.

The thesis tracked robot and tables with six of them (section 6.5) and does not say where they hung; by default they
hang in two rows of three, each over the middle of a sixth of the room.

A camera's own frame is the optical one: z where it looks, x to the right of its picture, y down. Pixel (0, 0) is the
middle of the first pixel, as OpenCV counts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bullet_sim.camera_settings import CameraSettings
from bullet_sim.client import Pose

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Camera:
    """One camera.

    Attributes:
        number: from 0.
        width: of a picture [px].
        lines: its height [px].
        matrix: (3, 3) of the lens [px].
        distortion: (5,) of OpenCV.
        pose: of the optical frame in `world`, where it truly is.
        told: the same, as calibrated.
    """

    number: int
    width: int
    lines: int
    matrix: Array
    distortion: Array
    pose: Pose
    told: Pose

    @property
    def frame(self) -> str:
        """Name of the camera and of its optical frame."""
        return f"overhead_{self.number}"

    def project(self, points: Array) -> Array:
        """Give where points of `world` are in the picture, of the true camera.

        Args:
            points: (n, 3) [m].

        Returns:
            (n, 2) [px]; NaN behind the camera, or so far aside that the lens model does not hold.
        """
        local = (points - self.pose.position) @ self.pose.matrix
        depth = np.where(local[:, 2] > 1e-3, local[:, 2], np.nan)
        flat = local[:, :2] / depth[:, None]
        reach = 1.3 * np.array([self.width, self.lines]) / 2 / self.matrix[[0, 1], [0, 1]]
        flat[(np.abs(flat) > reach).any(axis=1)] = np.nan
        seen = np.isfinite(flat).all(axis=1)
        pixels = np.full((len(points), 2), np.nan)
        if seen.any():
            rays = np.column_stack([flat[seen], np.ones(int(seen.sum()))])
            pixels[seen] = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), self.matrix, self.distortion)[0][:, 0]
        return pixels


def ceiling_cameras(
    settings: CameraSettings, outline: Sequence[Sequence[float]] | Array, rng: Generator
) -> tuple[Camera, ...]:
    """Hang cameras over a room, each over the middle of its part of the room's bounding box, looking straight down.

    Args:
        settings: of what make, how many.
        outline: corners (k, 2) [m] of the room.
        rng: draws the errors of the calibration.
    """
    corners = np.asarray(outline, dtype=float)
    low, size = corners.min(axis=0), np.ptp(corners, axis=0)
    long = int(size[1] > size[0])
    counts = np.array(settings.grid)[[long, 1 - long]]
    part = size / counts
    sideways = part[1] > part[0]  # the width of the picture lies along the longer side of the part
    across = np.array([0.0, 1.0, 0.0]) if sideways else np.array([1.0, 0.0, 0.0])
    down = np.array([0.0, 0.0, -1.0])
    turn = Rotation.from_matrix(np.column_stack([across, np.cross(down, across), down]))
    focal = settings.width / 2 / math.tan(settings.field_of_view / 2)
    matrix = np.array([[focal, 0, (settings.width - 1) / 2], [0, focal, (settings.lines - 1) / 2], [0, 0, 1.0]])
    cameras = []
    for number in range(int(counts.prod())):
        cell = np.array([number // counts[1], number % counts[1]])
        place = np.array([*(low + (cell + 0.5) * part), settings.height])
        errors = rng.normal(size=6)
        off = Rotation.from_rotvec(settings.calibration_angle * errors[3:])
        cameras.append(
            Camera(
                number,
                settings.width,
                settings.lines,
                matrix,
                np.array(settings.distortion),
                Pose(place, turn.as_quat()),
                Pose(place + settings.calibration_position * errors[:3], (off * turn).as_quat()),
            )
        )
    return tuple(cameras)
