"""Where overhead cameras hang and what they project; laws of the geometry, no pictures."""

from __future__ import annotations

import numpy as np
import pytest

from bullet_sim.camera_settings import CameraSettings
from bullet_sim.cameras import ceiling_cameras
from bullet_sim.errors import SimError
from bullet_sim.scene import Scene, TagSettings, with_tags
from bullet_sim.settings import parse_settings

ROOMS = [
    [[-1.5, -3.5], [5.5, -3.5], [5.5, 3.5], [-1.5, 3.5]],
    [[0.0, 0.0], [4.0, 0.0], [4.0, 6.0], [0.0, 6.0]],
    [[0.0, 0.0], [6.0, 0.0], [6.0, 2.0], [3.0, 4.5], [0.0, 4.0]],
]


def hang(room, seed=0, **settings):
    return ceiling_cameras(CameraSettings(**settings), room, np.random.default_rng(seed))


@pytest.mark.parametrize("room", ROOMS)
def test_every_place_at_table_height_is_seen(room):
    low, high = np.min(room, axis=0), np.max(room, axis=0)
    x, y = np.meshgrid(*(np.linspace(a + 0.1, b - 0.1, 40) for a, b in zip(low, high, strict=True)))
    points = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 0.7775)])
    seen = np.zeros(x.size, bool)
    cameras = hang(room)
    assert len(cameras) == 6
    for camera in cameras:
        pixels = camera.project(points)
        with np.errstate(invalid="ignore"):
            seen |= ((pixels >= 0) & (pixels <= (camera.width - 1, camera.lines - 1))).all(axis=1)
    assert seen.all()


def test_what_is_right_below_is_in_the_middle():
    for camera in hang(ROOMS[0]):
        below = camera.pose.position * (1, 1, 0)
        np.testing.assert_allclose(camera.project(below[None])[0], camera.matrix[:2, 2], atol=1e-6)


def test_a_picture_is_not_mirrored():
    """Seen from above, x to the right and y up in `world` are so in the picture too, but for a turn."""
    camera = hang(ROOMS[0])[0]
    below = camera.pose.position * (1, 1, 0)
    middle, east, north = camera.project(below + np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]]))
    assert np.linalg.det(np.column_stack([east - middle, north - middle])) < 0  # y of pixels runs down


def test_what_is_behind_or_far_aside_has_no_pixel():
    camera = hang(ROOMS[0])[0]
    above = camera.pose.position + np.array([[0, 0, 0.5], [50.0, 0, -0.1]])
    assert np.isnan(camera.project(above)).all()


def test_calibration_errors_have_the_size_they_are_said_to_have():
    cameras = [each for seed in range(60) for each in hang(ROOMS[0], seed, calibration_position=0.002)]
    off = np.array([each.told.position - each.pose.position for each in cameras])
    assert np.std(off) == pytest.approx(0.002, rel=0.1)
    turns = [np.arccos(np.clip((np.trace(c.told.matrix.T @ c.pose.matrix) - 1) / 2, -1, 1)) for c in cameras]
    assert np.sqrt(np.mean(np.square(turns)) / 3) == pytest.approx(0.0005, rel=0.1)


def test_without_errors_cameras_hang_where_they_are_told_to():
    for camera in hang(ROOMS[0], calibration_position=0.0, calibration_angle=0.0):
        np.testing.assert_array_equal(camera.pose.position, camera.told.position)
        np.testing.assert_allclose(camera.pose.matrix, camera.told.matrix, atol=1e-15)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"hight": 2.0}, "did you mean 'height'"),
        ({"grid": [0, 2]}, "grid.0"),
        ({"distortion": [0.0] * 4}, "distortion"),
        ({"field_of_view": 3.2}, "field_of_view"),
        ({"noise": float("nan")}, "noise"),
    ],
)
def test_cameras_that_cannot_be_are_refused(data, words):
    with pytest.raises(SimError, match=words) as caught:
        parse_settings(data, CameraSettings, "cameras.yaml")
    assert "\n" not in str(caught.value)


def test_rendered_tags_have_no_noise_to_say():
    with pytest.raises(SimError, match="expected no sigma_xy where tags are rendered"):
        parse_settings({"source": "rendered", "sigma_xy": 0.001}, TagSettings, "tags.yaml")


def test_the_source_of_tags_changes_nothing_else():
    scene = Scene.model_validate(
        {
            "room": {"outline": ROOMS[1]},
            "robot": {"pose": [2, 3, 0]},
            "sensors": {"tags": {"rate": 5.0, "dropout": 0.5}},
        }
    )
    rendered = with_tags(scene, "rendered")
    assert rendered.sensors.tags.source == "rendered"
    assert rendered.sensors.tags.rate == 5.0
    assert with_tags(rendered, "noise").sensors.tags.rate == 5.0
    assert with_tags(scene, "noise") is scene
