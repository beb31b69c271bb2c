"""A lens and its inverse, and calibrations that cannot be."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_model.errors import ModelError
from pbrl_model.tags.calibration import calibration

GOOD = {
    "name": "3",
    "size": (640, 480),
    "matrix": [500.0, 0, 320, 0, 510, 240, 0, 0, 1],
    "distortion": [-0.2, 0.05, 0.001, -0.002, 0.0],
    "position": (1.0, 2.0, 3.0),
    "quaternion": (1.0, 0.0, 0.0, 0.0),
}


@pytest.mark.parametrize("lens", [[], [-0.1, 0.01, 0, 0], GOOD["distortion"], [0.2, 0.1, 0, 0, 0, 0.25, 0.1, 0]])
def test_rays_and_pixels_are_inverse(lens):
    camera = calibration(**GOOD | {"distortion": lens})
    pixels = np.random.default_rng(0).uniform([0, 0], [639, 479], (200, 2))
    np.testing.assert_allclose(camera.pixels(camera.rays(pixels)), pixels, atol=1e-4)


def test_a_point_is_seen_along_its_ray():
    camera = calibration(**GOOD)
    points = np.random.default_rng(1).uniform([0.2, 1.2, 0.0], [1.8, 2.8, 1.0], (50, 3))
    rays = camera.rays(camera.project(points))
    along = (points - camera.position) @ camera.rotation
    np.testing.assert_allclose(rays, along[:, :2] / along[:, 2:], atol=1e-7)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"matrix": [0.0] * 9}, "calibrate it"),
        ({"matrix": [500.0] * 6}, "expected a calibrated matrix"),
        ({"matrix": [float("nan"), *GOOD["matrix"][1:]]}, "expected a calibrated matrix"),
        ({"size": (0, 480)}, "size"),
        ({"distortion": [0.1] * 3}, "expected 0, 4, 5 or 8"),
        ({"distortion": [float("inf")] * 5}, "distortion coefficients"),
        ({"position": (1.0, 2.0)}, r"position \(3,\)"),
        ({"quaternion": (0.0,) * 4}, "unit quaternion"),
        ({"quaternion": (float("nan"), 0, 0, 1)}, "unit quaternion"),
    ],
)
def test_a_calibration_that_cannot_be_is_refused(change, words):
    with pytest.raises(ModelError, match=words) as caught:
        calibration(**GOOD | change)
    assert "camera 3" in str(caught.value) and "\n" not in str(caught.value)
