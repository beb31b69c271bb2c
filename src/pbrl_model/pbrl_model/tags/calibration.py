"""A calibrated camera: OpenCV's lens model, and where the camera is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pbrl_model.errors import ModelError

Array = NDArray[np.float64]

COEFFICIENTS = (0, 4, 5, 8)
"""How many numbers a lens model may have: none, `plumb_bob` without and with k3, `rational_polynomial`."""
STOP = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 1e-9)
"""When the inversion of the lens model has converged."""


@dataclass(frozen=True)
class CameraCalibration:
    """What is known of a camera, as `sensor_msgs/CameraInfo` and `/tf_static` say it.

    Attributes:
        name: of the camera, for messages.
        width: of a picture [px].
        height: of a picture [px].
        matrix: (3, 3) K [px]; pixel (0, 0) is the middle of the first pixel.
        distortion: (0, 4, 5 or 8,) k1, k2, p1, p2, k3, ...
        position: (3,) [m] of the optical frame in `world`.
        rotation: (3, 3) from the optical frame (z where it looks, x right, y down) to `world`.
    """

    name: str
    width: int
    height: int
    matrix: Array
    distortion: Array
    position: Array
    rotation: Array

    def check(self, image: NDArray[np.uint8]) -> None:
        """Raise a ModelError where an image is no picture of this camera: (height, width) grey levels."""
        if image.shape != (self.height, self.width) or image.dtype != np.uint8:
            raise ModelError(
                f"camera {self.name}: expected {self.height} x {self.width} grey levels uint8, "
                f"got {image.shape} {image.dtype}"
            )

    def rays(self, pixels: Array) -> Array:
        """Return where pixels look: x, y (n, 2) at distance 1 along the axis, without the lens's distortion.

        Args:
            pixels: (n, 2) [px].
        """
        points = np.asarray(pixels, dtype=float).reshape(-1, 1, 2)
        rays = cv2.undistortPointsIter(points, self.matrix, self.distortion, np.eye(3), np.eye(3), STOP)
        return np.asarray(rays[:, 0], dtype=float)

    def project(self, points: Array) -> Array:
        """Return where points (n, 3) [m] of `world` in front of the camera are in the picture, (n, 2) [px]."""
        local = (np.asarray(points, dtype=float) - self.position) @ self.rotation
        return self.pixels(local[:, :2] / local[:, 2:])

    def pixels(self, rays: Array) -> Array:
        """Return where rays (n, 2) are in the picture, (n, 2) [px]: the inverse of `rays`."""
        points = np.column_stack([rays, np.ones(len(rays))])
        seen = cv2.projectPoints(points, np.zeros(3), np.zeros(3), self.matrix, self.distortion)[0]
        return np.asarray(seen[:, 0], dtype=float)


def calibration(
    name: str,
    size: tuple[int, int],
    matrix: Sequence[float] | Array,
    distortion: Sequence[float] | Array,
    position: Sequence[float] | Array,
    quaternion: Sequence[float] | Array,
) -> CameraCalibration:
    """Check what came from outside and return it as a calibration.

    Args:
        name: of the camera.
        size: width and height [px].
        matrix: (9,) or (3, 3) K [px].
        distortion: coefficients, in OpenCV's order.
        position: (3,) [m] of the optical frame in `world`.
        quaternion: (4,) x y z w of the optical frame in `world`.

    Raises:
        ModelError: a number that is none, a focal length or size that is not positive, a lens model of another length.
    """
    lens = np.array(distortion, dtype=float).ravel()
    k = np.array(matrix, dtype=float)
    place, turn = np.array(position, dtype=float), np.array(quaternion, dtype=float)
    if k.size != 9 or not np.isfinite(k).all() or min(k.ravel()[[0, 4]]) <= 0 or min(size) < 1:
        raise ModelError(
            f"camera {name}: expected a calibrated matrix K and a size, got {k.ravel().tolist()} and {list(size)} px; "
            "calibrate it"
        )
    if len(lens) not in COEFFICIENTS or not np.isfinite(lens).all():
        raise ModelError(f"camera {name}: expected 0, 4, 5 or 8 distortion coefficients, got {lens.tolist()}")
    whole = place.shape == (3,) and turn.shape == (4,) and np.isfinite([*place, *turn]).all()
    if not whole or abs(float(turn @ turn) - 1.0) > 1e-2:
        raise ModelError(
            f"camera {name}: expected position (3,) and unit quaternion (4,), got {place.tolist()} and {turn.tolist()}"
        )
    return CameraCalibration(
        name, int(size[0]), int(size[1]), k.reshape(3, 3), lens, place, Rotation.from_quat(turn).as_matrix()
    )
