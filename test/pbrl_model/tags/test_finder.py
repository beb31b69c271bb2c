"""Tags drawn by a projective warp, which shares no code with the simulator, are found where they were drawn."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from pbrl_model.errors import ModelError
from pbrl_model.tags.calibration import CameraCalibration
from pbrl_model.tags.finder import TagFinder

FAMILY = "DICT_APRILTAG_36h11"
SHAPE = (480, 640)
CAMERA = CameraCalibration(
    "0", 640, 480, np.array([[500.0, 0, 319.5], [0, 500, 239.5], [0, 0, 1]]), np.zeros(5), np.zeros(3), np.eye(3)
)
QUADS = {
    "straight": [[300.3, 200.7], [350.3, 200.7], [350.3, 250.7], [300.3, 250.7]],
    "turned": [[170.2, 330.1], [205.6, 365.5], [170.2, 400.9], [134.8, 365.5]],
    "slanted": [[100.4, 100.2], [141.7, 92.3], [148.2, 139.8], [95.9, 144.6]],
    "small": [[500.1, 400.3], [527.4, 404.8], [522.9, 432.1], [495.6, 427.6]],
}
FINE = 8
"""Of the drawing: rays along each side of a pixel."""


def drawing(quads: dict[int, list[list[float]]], blur: float = 0.6, noise: float = 2.0) -> np.ndarray:
    """Draw tags, by id, with their black square's corners in the given pixels."""
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    fine = np.full((SHAPE[0] * FINE, SHAPE[1] * FINE), 200, np.uint8)
    for number, quad in quads.items():
        tag = np.full((1000, 1000), 255, np.uint8)
        tag[100:900, 100:900] = cv2.aruco.generateImageMarker(family, number, 800)
        square = np.array([[100, 100], [900, 100], [900, 900], [100, 900]], np.float32) - 0.5
        target = (np.array(quad, np.float32) + 0.5) * FINE - 0.5
        warp = cv2.getPerspectiveTransform(square, target.astype(np.float32))
        cv2.warpPerspective(tag, warp, fine.shape[::-1], fine, cv2.INTER_LINEAR, cv2.BORDER_TRANSPARENT)
    light = cv2.resize(fine.astype(np.float32), SHAPE[::-1], interpolation=cv2.INTER_AREA)
    light = cv2.GaussianBlur(light, (0, 0), blur)
    return np.clip(np.rint(light + noise * np.random.default_rng(0).normal(size=SHAPE)), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def finder() -> TagFinder:
    return TagFinder(FAMILY)


def test_corners_are_found_to_a_tenth_of_a_pixel(finder):
    quads = dict(enumerate(QUADS.values(), start=3))
    seen = finder.find(drawing(quads), CAMERA)
    assert [tag.id for tag in seen] == list(quads)
    for tag in seen:
        np.testing.assert_allclose(tag.corners, quads[tag.id], atol=0.1)
        np.testing.assert_allclose(CAMERA.pixels(tag.rays), tag.corners, atol=1e-6)


@pytest.mark.parametrize("blur", [0.3, 1.0])
def test_blur_does_not_draw_a_tag_together(finder, blur):
    """OpenCV's own corners lose 0.2 px to each side here, which at 50 px is a centimetre of height from 2 m."""
    (tag,) = finder.find(drawing({9: QUADS["straight"]}, blur, 0.0), CAMERA)
    sides = np.linalg.norm(tag.corners - np.roll(tag.corners, 1, axis=0), axis=1)
    np.testing.assert_allclose(sides, 50.0, atol=0.08)


def test_an_empty_picture_holds_nothing(finder):
    assert finder.find(np.full(SHAPE, 128, np.uint8), CAMERA) == []


def test_noise_alone_is_no_tag(finder):
    noise = np.random.default_rng(1).integers(0, 256, SHAPE).astype(np.uint8)
    assert finder.find(noise, CAMERA) == []


def test_a_covered_tag_is_not_made_up(finder):
    image = drawing({4: QUADS["straight"]})
    image[190:260, 320:332] = 200
    assert finder.find(image, CAMERA) == []


@pytest.mark.parametrize("image", [np.zeros((640, 480), np.uint8), np.zeros(SHAPE), np.zeros((480, 640, 3), np.uint8)])
def test_a_picture_of_another_camera_is_refused(finder, image):
    with pytest.raises(ModelError, match="camera 0: expected 480 x 640 grey levels uint8"):
        finder.find(image, CAMERA)


@pytest.mark.parametrize("name", ["DICT_APRILTAG_36h12", "CORNER_REFINE_SUBPIX", ""])
def test_an_unknown_family_is_refused(name):
    with pytest.raises(ModelError, match="dictionary: expected a family"):
        TagFinder(name)
