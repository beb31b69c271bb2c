"""Takes the pictures of overhead cameras with Bullet's software renderer; no graphics card is needed.

That renderer takes a quarter of a second for a whole picture of 1280 x 960, and its time goes with the pixels. So only
the rectangles around tags are rendered, each as a picture of its own through a part of the lens, with everything that
stands there: what covers a tag covers it in the picture. The rest of a picture is the colour of the floor.

A rectangle is rendered without lens errors and with several rays a pixel, bent as the lens bends it, averaged, blurred,
and given the sensor's noise. Exposure is short: nothing moves while a picture is taken.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from bullet_sim.camera_settings import CameraSettings
from bullet_sim.cameras import Camera
from bullet_sim.client import BulletClient, Pose
from bullet_sim.quiet import bullet

Array = NDArray[np.float64]
Image = NDArray[np.uint8]
Box = tuple[int, int, int, int]

FLOOR_GREY = 216
"""Of the floor where nothing is rendered."""
MARGIN = 4
"""Rendered around a plate [px]."""
GRAZING = 0.3
"""Cosine of the angle between a plate's normal and the ray to the camera below which nobody could read it."""
NEAR, FAR = 0.3, 12.0
"""Of the frustum [m]."""
SAMPLED_AT = np.array([0.0, 1.0])
"""Where in a pixel, from its upper left corner, Bullet's software renderer looks: at the lower left one (measured)."""


class Plates(Protocol):
    """What is to be photographed."""

    def outlines(self) -> list[tuple[Pose, Array]]:
        """Give the pose of each plate, z out of it, and its corners (4, 3) [m] in `world`."""


class Photographer:
    """All cameras of a room.

    Attributes:
        cameras: by number.
    """

    def __init__(
        self,
        client: BulletClient,
        cameras: Sequence[Camera],
        plates: Plates,
        settings: CameraSettings,
        rng: Generator,
    ) -> None:
        """Stand by.

        Args:
            client: the world.
            cameras: where they hang.
            plates: the tags to look at.
            settings: how to render.
            rng: draws the sensors' noise.
        """
        self.cameras = tuple(cameras)
        self._client, self._plates, self._settings, self._rng = client, plates, settings, rng

    def take(self) -> list[Image]:
        """Take a picture with every camera at once.

        Returns:
            (lines, width) grey levels, by camera.
        """
        plates = self._plates.outlines()
        pictures = []
        for camera in self.cameras:
            boxes = [(0, 0, camera.width, camera.lines)] if self._settings.whole else _boxes(camera, plates)
            picture = np.full((camera.lines, camera.width), FLOOR_GREY, np.uint8)
            for left, top, right, bottom in boxes:
                picture[top:bottom, left:right] = self._expose(camera, (left, top, right, bottom))
            pictures.append(picture)
        return pictures

    def _expose(self, camera: Camera, box: Box) -> Image:
        """Render a rectangle as lens and sensor show it."""
        many = self._settings.oversampling
        left, top, right, bottom = box
        fine = self._through_lens(camera, box, many).astype(np.float32)
        light = cv2.resize(fine, (right - left, bottom - top), interpolation=cv2.INTER_AREA) if many > 1 else fine
        if self._settings.blur > 0:
            light = cv2.GaussianBlur(light, (0, 0), self._settings.blur, borderType=cv2.BORDER_REPLICATE)
        noise = self._settings.noise * self._rng.standard_normal(light.shape, dtype=np.float32)
        return np.clip(np.rint(light + noise), 0, 255).astype(np.uint8)

    def _through_lens(self, camera: Camera, box: Box, many: int) -> Image:
        """Render a rectangle with `many` rays along each side of a pixel, bent as the lens bends it."""
        left, top, right, bottom = box
        wide, high = right - left, bottom - top
        pitch = 1.0 / (camera.matrix[0, 0] * many)
        columns, rows = np.meshgrid(np.arange(left - 1, right + 1), np.arange(top - 1, bottom + 1))
        pixels = np.stack([columns, rows], axis=-1).reshape(-1, 1, 2).astype(float)
        stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 20, 1e-7)
        rays = cv2.undistortPointsIter(pixels, camera.matrix, camera.distortion, np.eye(3), np.eye(3), stop)
        rays = rays.reshape(high + 2, wide + 2, 2)
        # From the pixels' middles to those of the rays in them; the rim of one pixel is there to be cut off.
        fine = cv2.resize(rays, None, fx=many, fy=many, interpolation=cv2.INTER_LINEAR)[many:-many, many:-many]
        low, size = fine.reshape(-1, 2).min(axis=0), np.ptp(fine.reshape(-1, 2), axis=0)
        counts = np.ceil(size / pitch).astype(int) + 3
        begin = low - 1.5 * pitch
        flat = self._render(camera, begin, begin + counts * pitch, (int(counts[0]), int(counts[1])))
        where = ((fine - begin) / pitch - SAMPLED_AT).astype(np.float32)
        bent = cv2.remap(flat, where[..., 0], where[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(bent, dtype=np.uint8)

    def _render(self, camera: Camera, low: Array, high: Array, counts: tuple[int, int]) -> Image:
        """Render what is seen between two corners of the plane at distance 1, x to the right and y down."""
        x, y, z = camera.pose.matrix.T
        turn = np.array([x, -y, -z])  # OpenGL looks along -z with y up
        view = np.eye(4)
        view[:3, :3], view[:3, 3] = turn, -turn @ camera.pose.position
        projection = bullet.computeProjectionMatrix(
            NEAR * low[0], NEAR * high[0], -NEAR * high[1], -NEAR * low[1], NEAR, FAR
        )
        image = self._client.api.getCameraImage(
            counts[0],
            counts[1],
            view.T.ravel().tolist(),
            projection,
            lightDirection=(0.3, -0.2, 1.0),
            shadow=0,
            flags=bullet.ER_NO_SEGMENTATION_MASK,
            renderer=bullet.ER_TINY_RENDERER,
        )
        pixels = np.asarray(image[2], dtype=np.uint8).reshape(counts[1], counts[0], 4)
        return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_RGBA2GRAY), dtype=np.uint8)


def _boxes(camera: Camera, plates: Sequence[tuple[Pose, Array]]) -> list[Box]:
    """Give the rectangles (left, top, right, bottom) [px] around the plates that a camera sees whole."""
    boxes = []
    for pose, corners in plates:
        normal = pose.matrix[:, 2]
        ray = camera.pose.position - corners.mean(axis=0)
        if normal @ ray < GRAZING * math.sqrt(float(ray @ ray)):
            continue
        pixels = camera.project(corners)
        if not np.isfinite(pixels).all():
            continue
        low, high = np.floor(pixels.min(axis=0)), np.ceil(pixels.max(axis=0)) + 1
        if (low < 0).any() or (high > (camera.width, camera.lines)).any():
            continue
        left, top = (max(0, int(edge) - MARGIN) for edge in low)
        right, bottom = min(camera.width, int(high[0]) + MARGIN), min(camera.lines, int(high[1]) + MARGIN)
        boxes.append((left, top, right, bottom))
    return boxes
