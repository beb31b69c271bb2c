"""Open-loop prediction: the recorded forces on a simulated body, without and with what was learned."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import BodyGeometry
from pbrl_model.geometry import MassProperties
from pbrl_model.parameters import BodyParameters
from pbrl_model.rollout import rollout
from pbrl_model.sensing.motion import Motion
from pbrl_model.sensing.windows import Windows, whole_windows

Array = NDArray[np.float64]

UNKNOWN_MASS = 15.0
"""Mass of a body that nobody has said anything of [kg]."""


@dataclass(frozen=True)
class Prediction:
    """Predicted poses of one episode.

    Attributes:
        time: (n,) [s] on the recording's clock.
        poses: (draws, n, 3) of the body's frame in world.
    """

    time: Array
    poses: Array

    @property
    def mean(self) -> Array:
        """Return (n, 3) the mean pose over the draws."""
        return self.poses.mean(axis=0)


@dataclass(frozen=True)
class PathError:
    """How far predicted poses are from recorded ones.

    Attributes:
        rmse_position: over all recorded poses [m].
        rmse_yaw: likewise [rad]; NaN where the orientation is not observed.
        final_position: at the last recorded pose [m], root mean square over windows.
        final_yaw: likewise [rad].
    """

    rmse_position: float
    rmse_yaw: float
    final_position: float
    final_yaw: float


def unlearned(geometry: BodyGeometry) -> BodyParameters:
    """Return the model before learning: nominal mass, no wheel."""
    return BodyParameters(mass=UNKNOWN_MASS if math.isnan(geometry.nominal_mass) else geometry.nominal_mass)


def predict(motion: Motion, rows: Array, body: MassProperties) -> Prediction:
    """Predict a whole episode from its first state with the recorded wrench.

    Args:
        motion: the episode.
        rows: (draws, 12) kernel rows, such as `Posterior.rows()`, or `unlearned(...).to_vector()[None]`.
        body: centre of mass and inertia over mass.
    """
    windows = whole_windows([motion])
    return Prediction(motion.time, predict_windows(windows, rows, body)[:, 0])


def predict_windows(windows: Windows, rows: Array, body: MassProperties) -> Array:
    """Return (draws, W, T + 1, 3) predicted poses of each window from its mean start."""
    return rollout(rows, windows.initial, windows.wrench, body.inertia_per_mass, body.com, windows.dt, windows.steps)


def path_error(windows: Windows, poses: Array) -> PathError:
    """Compare the mean prediction with the recorded poses.

    Headings are not wrapped: both start alike, and a body that is predicted to spin once too often is not right.

    Args:
        windows: W of them.
        poses: (draws, W, T + 1, 3) of `predict_windows`.
    """
    which = np.arange(len(windows))[:, None]
    mean = poses.mean(axis=0)
    before, after = mean[which, windows.step], mean[which, windows.step + 1]
    difference = windows.pose - (before + windows.fraction[..., None] * (after - before))
    placed, turned = windows.seen[..., 0], windows.seen[..., 2]
    squares = np.sum(difference[..., :2] ** 2, axis=-1)
    last = [int(np.flatnonzero(row)[-1]) for row in placed]
    ends = turned[which[:, 0], last]
    return PathError(
        _root_mean(squares[placed]),
        _root_mean(difference[..., 2][turned] ** 2),
        _root_mean(squares[which[:, 0], last]),
        _root_mean(difference[which[:, 0], last, 2][ends] ** 2),
    )


def _root_mean(squares: Array) -> float:
    return float(np.sqrt(squares.mean())) if squares.size else math.nan
