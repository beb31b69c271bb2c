"""Where a wheel or a hinge may be, as pages draw it: draws, their mean, and the region that holds 95 % of them."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pbrl_bringup.report_data import Hinge, Point, Pose, Wheel
from pbrl_bringup.verdict import spread_radius

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

CLOUD = 400  # dots of the posterior
CHI_95 = math.sqrt(5.991)  # radius that holds 95 % of a normal in the plane, in standard deviations
DIGITS = 5  # of metres and radians in a page's data: a hundredth of a millimetre


def wheel_of(draws: Mapping[str, Array], shown: Rows) -> Wheel:
    """Return the wheel of a posterior.

    Args:
        draws: (n,) of `wheel_x`, `wheel_y` [m] in the body's frame, and `wheel_theta` [rad] if there is one.
        shown: which draws become dots.
    """
    points = np.column_stack([draws["wheel_x"], draws["wheel_y"]])
    theta = draws.get("wheel_theta", np.zeros(len(points)))
    mean = points.mean(axis=0)
    return Wheel(
        draws=poses_of(np.column_stack([points, theta])[shown]),
        mean=(float(mean[0]), float(mean[1])),
        ellipse=points_of(ellipse(points)),
        radius95=spread_radius(points),
    )


def hinge_of(draws: Mapping[str, Array], shown: Rows) -> Hinge:
    """Return the hinge of a posterior.

    Args:
        draws: (n,) of `hinge_x`, `hinge_y` and `hinge_radius` [m] in world.
        shown: which draws become dots.
    """
    rows = np.column_stack([draws["hinge_x"], draws["hinge_y"], draws["hinge_radius"]])
    return Hinge(
        draws=poses_of(rows[shown]),
        mean=(float(rows[:, 0].mean()), float(rows[:, 1].mean()), float(rows[:, 2].mean())),
        ellipse=points_of(ellipse(rows[:, :2])),
    )


def ellipse(points: Array, count: int = 73) -> Array:
    """Return the (count, 2) outline that holds 95 % of a normal with the moments of the (n, 2) points."""
    turn = np.linspace(0.0, 2.0 * np.pi, count)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    values, vectors = np.linalg.eigh(np.cov(points.T))
    axes = vectors * np.sqrt(np.maximum(values, 0.0))
    return points.mean(axis=0) + CHI_95 * circle @ axes.T


def poses_of(rows: Array) -> list[Pose]:
    """Return (n, 3) poses rounded."""
    return [(float(x), float(y), float(t)) for x, y, t in np.round(rows, DIGITS)]


def points_of(rows: Array) -> list[Point]:
    """Return (n, 2) points rounded [m]."""
    return [(float(x), float(y)) for x, y in np.round(rows, DIGITS)]
