"""Rendered pictures against the camera's own geometry: tags are where the lens puts them, and hidden where covered."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from bullet_sim.camera_settings import CameraSettings
from bullet_sim.cameras import ceiling_cameras
from bullet_sim.client import BulletClient, Pose, yaw_quaternion
from bullet_sim.photographer import Photographer
from bullet_sim.quiet import bullet
from bullet_sim.tag_plates import TagPlates
from bullet_sim.tag_sheet import TagMount, TagSheet

ROOM = [[-1.5, -1.0], [1.5, -1.0], [1.5, 1.0], [-1.5, 1.0]]
SIZE = 0.2
SQUARE = SIZE / 2 * np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0.0]])
LENSES = {"straight": (0.0,) * 5, "barrel": (-0.10, 0.012, 0.0, 0.0, 0.0), "askew": (-0.1, 0.01, 0.002, -0.001, 0.0)}
SHEET = TagSheet()


class Studio:
    """One camera over a small room, and one tag."""

    def __init__(self, seed: int = 0, **settings: object) -> None:
        made = CameraSettings.model_validate({"grid": (1, 1)} | settings)
        self.client = BulletClient()
        self.plates = TagPlates(self.client, SHEET, {"box": (TagMount(id=5, size=SIZE, position=(0, 0, 0)),)})
        (self.camera,) = ceiling_cameras(made, ROOM, np.random.default_rng(seed))
        self.photographer = Photographer(self.client, [self.camera], self.plates, made, np.random.default_rng(seed))

    def shoot(self, pose: Pose) -> np.ndarray:
        self.plates.move({"box": pose})
        return self.photographer.take()[0]


@pytest.fixture
def studio():
    opened = []

    def make(**settings):
        opened.append(Studio(**settings))
        return opened[-1]

    yield make
    for each in opened:
        each.client.close()


def corners_in(image: np.ndarray) -> np.ndarray | None:
    """OpenCV's corners, good to half a pixel; their mean is ten times as good."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    found, ids, _ = cv2.aruco.ArucoDetector(SHEET.family, parameters).detectMarkers(image)
    return None if ids is None or ids.ravel().tolist() != [5] else found[0][0].astype(float)


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0, 0.3), (0.7, 0.45, 0.8, -2.0), (-0.8, -0.5, 0.4, 1.2)])
def test_a_tag_is_where_the_lens_puts_it(studio, lens, place):
    made = studio(distortion=LENSES[lens], oversampling=3)
    pose = Pose(np.array(place[:3]), yaw_quaternion(place[3]))
    seen = corners_in(made.shoot(pose))
    expected = made.camera.project(pose.position + SQUARE @ pose.matrix.T)
    assert seen is not None
    np.testing.assert_allclose(seen, expected, atol=0.5)
    np.testing.assert_allclose(seen.mean(axis=0), expected.mean(axis=0), atol=0.1)


def test_what_covers_a_tag_covers_it_in_the_picture(studio):
    made = studio()
    pose = Pose(np.zeros(3), yaw_quaternion(0.0))
    assert corners_in(made.shoot(pose)) is not None
    api = made.client.api
    look = api.createVisualShape(bullet.GEOM_BOX, halfExtents=[0.03, 0.3, 0.01])
    api.createMultiBody(0, -1, look, [0.02, 0.0, 0.5])
    assert corners_in(made.shoot(pose)) is None


def test_a_tag_turned_away_is_not_seen(studio):
    made = studio()
    assert corners_in(made.shoot(Pose(np.zeros(3), np.array([1.0, 0, 0, 0])))) is None


def test_around_tags_a_picture_is_the_same_as_a_whole_one(studio):
    pose = Pose(np.array([0.4, -0.3, 0.5]), yaw_quaternion(0.7))
    small = {"noise": 0.0, "width": 640, "lines": 480, "field_of_view": 0.9}
    part = studio(**small).shoot(pose)
    whole = studio(**small, whole=True).shoot(pose)
    corners = studio(**small).camera.project(pose.position + 1.2 * SQUARE @ pose.matrix.T)
    left, top = np.floor(corners.min(axis=0)).astype(int)
    right, bottom = np.ceil(corners.max(axis=0)).astype(int)
    off = np.abs(part[top:bottom, left:right].astype(int) - whole[top:bottom, left:right])
    assert np.mean(off) < 2.0  # the grid of rays lies elsewhere: edges differ by what a ray more or less makes
    first, second = corners_in(part), corners_in(whole)
    assert first is not None and second is not None
    np.testing.assert_allclose(first.mean(axis=0), second.mean(axis=0), atol=0.06)


def test_noise_has_the_size_it_is_said_to_have(studio):
    pose = Pose(np.zeros(3), yaw_quaternion(0.0))
    quiet = studio(noise=0.0, blur=0.0).shoot(pose).astype(float)
    loud = studio(noise=3.0, blur=0.0).shoot(pose).astype(float)
    grey = (quiet > 20) & (quiet < 235) & (quiet != 216)
    assert grey.sum() > 100
    assert np.std((loud - quiet)[grey]) == pytest.approx(3.0, rel=0.15)


def test_same_seed_same_bytes(studio):
    pose = Pose(np.zeros(3), yaw_quaternion(0.4))
    first, second, other = (studio(seed=seed).shoot(pose) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, second)
    assert (first != other).any()
