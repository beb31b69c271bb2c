"""The pose of a body from the corners of its tags in any number of cameras: least squares over what all of them see.

One camera that looks at a flat tag knows its place across the view well, its distance and tilt badly, and the tilt up
to a mirror image (Schweighofer and Pinz 2006). The start is OpenCV's IPPE_SQUARE (Collins and Bartoli 2014), which
gives both; each is refined over every corner in every camera (least squares of the reprojection error), and the better
one stays. Cameras weigh what their pixels see: a near one more than a far one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pbrl_model.errors import ModelError
from pbrl_model.tags.calibration import CameraCalibration

Array = NDArray[np.float64]

ROUNDS = 15
CONVERGED = 1e-10
"""Length of the last step [m, rad]."""
DAMPING = 1e-6
"""Share of the normal matrix's diagonal added to it at first; a tenth after each good step, tenfold after a bad one."""
ASIDE = Rotation.from_rotvec([0.11, 0.17, 0.0]).as_matrix()
"""From a camera's frame to one that looks a little aside."""


@dataclass(frozen=True)
class View:
    """One tag of a body in one camera.

    Attributes:
        camera: that sees it.
        points: (4, 3) [m] the tag's corners in the body's frame: upper left, upper right, lower right, lower left.
        rays: (4, 2) where they are seen, as `CameraCalibration.rays`.
    """

    camera: CameraCalibration
    points: Array
    rays: Array


@dataclass(frozen=True)
class BodyPose:
    """Where a body is.

    Attributes:
        position: (3,) [m] of its frame in `world`.
        quaternion: (4,) x y z w.
        covariance: (6, 6) of position [m] and of a turn about the axes of `world` [rad], for errors of 1 px a corner.
        residual: root mean square reprojection error [px].
    """

    position: Array
    quaternion: Array
    covariance: Array
    residual: float


def solve_pose(views: Sequence[View]) -> BodyPose:
    """Return the pose of a body that explains all views best.

    Raises:
        ModelError: there is no view, or OpenCV finds no start.
    """
    if not views:
        raise ModelError("pose: expected at least one view of a tag, got none")
    largest = max(views, key=_extent)
    refined = [_refine(views, *start) for start in _starts(largest)]
    if not refined:
        raise ModelError("pose: expected four corners of a square, OpenCV finds no pose for them")
    return min(refined, key=lambda pose: pose.residual)


def _extent(view: View) -> float:
    """Return how large a tag is seen [px]."""
    return float(np.ptp(view.rays, axis=0).min() * view.camera.matrix[0, 0])


def _starts(view: View) -> list[tuple[Array, Array]]:
    """Return the poses (position, rotation matrix) of the body that one view allows."""
    right, up = view.points[1] - view.points[0], view.points[0] - view.points[3]
    size = float(np.linalg.norm(right))
    tag = np.column_stack([right / size, up / size, np.cross(right, up) / size**2])
    middle = view.points.mean(axis=0)
    half = size / 2
    square = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
    # For a tag exactly square to the view, OpenCV gives a mirrored pose; seen by a camera turned aside it is not.
    aside = np.column_stack([view.rays, np.ones(4)]) @ ASIDE.T
    _, turns, places, _ = cv2.solvePnPGeneric(
        square, (aside[:, :2] / aside[:, 2:]).reshape(-1, 1, 2), np.eye(3), np.zeros(5), flags=cv2.SOLVEPNP_IPPE_SQUARE
    )
    camera = view.camera.rotation @ ASIDE.T
    starts = []
    for turn, place in zip(turns, places, strict=True):
        if not (np.isfinite(turn).all() and np.isfinite(place).all()):
            continue
        body = camera @ cv2.Rodrigues(turn)[0] @ tag.T
        centre = view.camera.position + camera @ place.ravel()
        starts.append((centre - body @ middle, body))
    return starts


def _refine(views: Sequence[View], position: Array, rotation: Array) -> BodyPose:
    """Minimise the reprojection error from a start (Levenberg-Marquardt)."""
    damping = DAMPING
    error, jacobian = _reprojection(views, position, rotation)
    for _ in range(ROUNDS):
        normal = jacobian.T @ jacobian
        normal[np.diag_indices(6)] *= 1.0 + damping
        step = np.linalg.solve(normal, -jacobian.T @ error)
        there, turned = position + step[:3], Rotation.from_rotvec(step[3:]).as_matrix() @ rotation
        trial, slopes = _reprojection(views, there, turned)
        if not trial @ trial <= error @ error:
            damping *= 10.0
            continue
        position, rotation, error, jacobian = there, turned, trial, slopes
        damping /= 10.0
        if np.linalg.norm(step) < CONVERGED:
            break
    return BodyPose(
        position,
        Rotation.from_matrix(rotation).as_quat(),
        np.asarray(np.linalg.inv(jacobian.T @ jacobian), dtype=float),
        float(np.sqrt(np.mean(error**2))),
    )


def _reprojection(views: Sequence[View], position: Array, rotation: Array) -> tuple[Array, Array]:
    """Return errors (m,) [px] and their Jacobian (m, 6) by position and turn about the axes of `world`."""
    errors, rows = [], []
    for view in views:
        lever = view.points @ rotation.T
        camera, focal = view.camera.rotation, view.camera.matrix[[0, 1], [0, 1]]
        x, y, z = ((lever + position - view.camera.position) @ camera).T
        errors.append(((np.column_stack([x / z, y / z]) - view.rays) * focal).ravel())
        by_point = np.zeros((len(x), 2, 3))
        by_point[:, 0, 0], by_point[:, 0, 2] = 1 / z, -x / z**2
        by_point[:, 1, 1], by_point[:, 1, 2] = 1 / z, -y / z**2
        by_place = focal[:, None] * (by_point @ camera.T)
        by_turn = np.cross(lever[:, None, :], by_place)  # d(R p) = w x (R p), so J (w x l) = (l x J) . w
        rows.append(np.concatenate([by_place, by_turn], axis=2).reshape(-1, 6))
    return np.concatenate(errors), np.concatenate(rows)
