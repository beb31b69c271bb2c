"""A pose from exact corners is exact, its Jacobian is the derivative, its covariance is what noise does."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pbrl_model.errors import ModelError
from pbrl_model.tags.calibration import CameraCalibration, calibration
from pbrl_model.tags.pose import View, _reprojection, solve_pose
from pbrl_model.tags.reader import read_body
from pbrl_model.tags.sheet import TagMount

K = [640.0, 0, 639.5, 0, 640, 479.5, 0, 0, 1]
DOWN = Rotation.from_matrix(np.array([[1, 0, 0], [0, -1, 0], [0, 0, -1.0]]))
FLAT = TagMount(id=0, size=0.2)
SIDE = TagMount(id=1, size=0.1, position=(0.08, 0, -0.1), quaternion=(0, np.sqrt(0.5), 0, np.sqrt(0.5)))


def camera(name: str, x: float, y: float, lean: float = 0.0) -> CameraCalibration:
    turn = (Rotation.from_euler("y", lean) * DOWN).as_quat()
    return calibration(name, (1280, 960), K, [-0.1, 0.01, 0, 0, 0], (x, y, 2.8), turn)


CAMERAS = [camera("0", 0.0, 0.0), camera("1", 1.5, 0.4, 0.3), camera("2", -0.6, 1.2, -0.2)]


def views(position, rotation: Rotation, cameras, mounts=(FLAT,), noise=None) -> list[View]:
    out = []
    for each in cameras:
        for mount in mounts:
            pixels = each.project(np.array(position) + mount.corners @ rotation.as_matrix().T)
            if noise is not None:
                pixels = pixels + noise.normal(0.0, 0.1, pixels.shape)
            out.append(View(each, mount.corners, each.rays(pixels)))
    return out


@pytest.mark.parametrize("cameras", [CAMERAS[:1], CAMERAS[1:2], CAMERAS])
@pytest.mark.parametrize("mounts", [(FLAT,), (FLAT, SIDE)])
def test_exact_corners_give_the_exact_pose(cameras, mounts):
    rng = np.random.default_rng(0)
    for _ in range(10):
        position = rng.uniform([-0.6, -0.5, 0.3], [0.6, 0.5, 1.0])
        turn = Rotation.from_euler("zyx", [rng.uniform(-3, 3), *rng.uniform(-0.3, 0.3, 2)])
        pose = solve_pose(views(position, turn, cameras, mounts))
        np.testing.assert_allclose(pose.position, position, atol=1e-6)
        assert (Rotation.from_quat(pose.quaternion) * turn.inv()).magnitude() < 1e-5
        assert pose.residual < 1e-4


def test_a_tag_exactly_square_to_the_view_is_no_mirror_image():
    """OpenCV's IPPE_SQUARE turns such a tag over."""
    for turn in (Rotation.from_euler("z", angle) for angle in (0.0, np.pi / 2, np.pi)):
        pose = solve_pose(views((0.0, 0.0, 0.78), turn, CAMERAS[:1]))
        np.testing.assert_allclose(pose.position, (0.0, 0.0, 0.78), atol=1e-6)
        assert (Rotation.from_quat(pose.quaternion) * turn.inv()).magnitude() < 1e-4


def test_the_jacobian_is_the_derivative():
    seen = views((0.2, -0.1, 0.8), Rotation.from_euler("z", 0.5), CAMERAS, (FLAT, SIDE))
    position, rotation = np.array([0.25, -0.12, 0.75]), Rotation.from_euler("zyx", [0.6, 0.1, -0.2])
    error, jacobian = _reprojection(seen, position, rotation.as_matrix())
    for axis, step in enumerate(1e-6 * np.eye(6)):
        moved = (Rotation.from_rotvec(step[3:]) * rotation).as_matrix()
        there = _reprojection(seen, position + step[:3], moved)[0]
        np.testing.assert_allclose((there - error) / 1e-6, jacobian[:, axis], rtol=1e-3, atol=2e-2)


def test_the_covariance_is_what_noise_does():
    rng = np.random.default_rng(2)
    position, turn = np.array([0.3, 0.2, 0.78]), Rotation.from_euler("zyx", [0.4, 0.05, 0.1])
    distances = []
    for _ in range(150):
        pose = solve_pose(views(position, turn, CAMERAS[:2], noise=rng))
        off = np.concatenate([pose.position - position, (Rotation.from_quat(pose.quaternion) * turn.inv()).as_rotvec()])
        distances.append(off @ np.linalg.inv(0.1**2 * pose.covariance) @ off)
    assert np.mean(distances) == pytest.approx(6.0, rel=0.15)  # chi-squared with six degrees of freedom


def test_more_cameras_know_height_and_tilt_better():
    """The law behind fusion: information adds, and a second direction adds most where one camera knows least."""
    position, turn = (0.3, 0.2, 0.78), Rotation.identity()
    one = solve_pose(views(position, turn, CAMERAS[:1])).covariance
    three = solve_pose(views(position, turn, CAMERAS)).covariance
    assert (np.diag(three) < np.diag(one)).all()
    assert three[2, 2] < one[2, 2] / 5
    assert np.linalg.eigvalsh(one - three).min() > -1e-12


def test_a_view_that_contradicts_the_others_is_left_out():
    seen = views((0.3, 0.2, 0.78), Rotation.identity(), CAMERAS)
    knocked = View(seen[1].camera, seen[1].points, seen[1].rays + 0.05)
    reading = read_body("table", [seen[0], knocked, seen[2]])
    assert reading is not None
    assert reading.cameras == ("0", "2")
    np.testing.assert_allclose(reading.position, (0.3, 0.2, 0.78), atol=1e-6)


def test_two_views_that_contradict_each_other_still_give_one_that_fits():
    seen = views((0.3, 0.2, 0.78), Rotation.identity(), CAMERAS[:2])
    reading = read_body("table", [seen[0], View(seen[1].camera, seen[1].points, seen[1].rays + 0.05)])
    assert reading is not None and len(reading.cameras) == 1


def test_a_far_tag_gives_no_reading_that_nobody_could_use():
    far = camera("far", 0.0, 0.0)
    object.__setattr__(far, "position", np.array([0.0, 0.0, 30.0]))
    assert read_body("table", views((0.0, 0.0, 0.0), Rotation.identity(), [far])) is None


def test_no_view_no_pose():
    with pytest.raises(ModelError, match="at least one view"):
        solve_pose([])
    assert read_body("table", []) is None


@pytest.mark.parametrize("bad", [np.zeros((4, 2)), np.full((4, 2), np.nan)])
def test_corners_that_are_no_square_give_no_reading(bad):
    assert read_body("table", [View(CAMERAS[0], FLAT.corners, bad)]) is None
