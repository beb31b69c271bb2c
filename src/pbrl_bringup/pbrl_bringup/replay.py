"""Recorded pushes with what the models predict of them, for the page: the same forces, without and with learning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_bag import BodyGeometry, Recording
from pbrl_model.geometry import MassProperties
from pbrl_model.posterior import Posterior
from pbrl_model.predict import predict, predict_windows, unlearned
from pbrl_model.sensing.motion import Motion
from pbrl_model.sensing.windows import shooting_windows

Array = NDArray[np.float64]

DRAWS = 200  # posterior draws that are rolled out
AHEAD = 2.0  # [s] of the prediction that starts again and again


@dataclass(frozen=True)
class Replay:
    """One push and what the models predict of it, on one grid of times.

    Attributes:
        contacts: (2,) [m] in the body's frame, by gripper that held it.
        time: (n,) [s] on the recording's clock.
        recorded: (n, 3) poses of the body's frame.
        wrench: (n, 3) on the body at its centre of mass, world axes.
        before: (n, 3) predicted without learning.
        after: (k, n, 3) predicted by posterior draws.
        fitted: whether the model saw it when it was fitted.
        restart: [s] after which predictions start again from what was recorded; None: never.
        ends: indices of the grid at which predictions end.
    """

    contacts: Mapping[str, Array]
    time: Array
    recorded: Array
    wrench: Array
    before: Array
    after: Array
    fitted: bool = True
    restart: float | None = None
    ends: Sequence[int] = (-1,)

    def end_error(self, poses: Array) -> float:
        """Return the root mean square of the distance [m] from recorded to predicted `poses` where these end."""
        ends = list(self.ends)
        return float(np.sqrt(np.mean(np.sum((poses - self.recorded)[ends, :2] ** 2, axis=1))))


def replay(
    recording: Recording,
    motions: Sequence[Motion],
    posterior: Posterior,
    body: MassProperties,
    rng: np.random.Generator,
    *,
    fitted: bool = True,
) -> list[Replay]:
    """Predict every push of one object.

    Args:
        recording: with the pushes.
        motions: of the object, on one clock.
        posterior: of the object.
        body: its centre of mass and inertia over mass.
        rng: chooses the draws that are rolled out.
        fitted: whether the posterior was learned from these motions.

    Raises:
        ModelError: a prediction is not finite.
    """
    geometry = recording.bodies[posterior.object]
    rows = np.vstack([unlearned(geometry).to_vector()[None], posterior.thinned(DRAWS, rng).rows()])
    replays = []
    for motion in motions:
        still = Replay(
            contacts=contacts_of(recording, motion),
            time=motion.time,
            recorded=recorded_poses(motion, geometry),
            wrench=np.vstack([motion.wrench, motion.wrench[-1:]]),
            before=np.empty((0, 3)),
            after=np.empty((0, 0, 3)),
            fitted=fitted,
        )
        poses = predict(motion, rows, body).poses
        replays.append(replace(still, before=poses[0], after=poses[1:]))
        if motion.time[-1] - motion.time[0] > 2 * AHEAD:
            poses, ends = predict_ahead(motion, rows, body, AHEAD)
            replays.append(replace(still, before=poses[0], after=poses[1:], restart=AHEAD, ends=ends))
    return replays


def predict_ahead(motion: Motion, rows: Array, body: MassProperties, seconds: float) -> tuple[Array, list[int]]:
    """Predict from the recorded state again and again, `seconds` at a time.

    Returns:
        (rows, T + 1, 3) poses, and the indices at which predictions end.
    """
    windows = shooting_windows([motion], seconds, least_poses=1)
    poses = predict_windows(windows, rows, body)
    out = np.full((len(rows), len(motion.time), 3), np.nan)
    ends = []
    for number, (start, steps) in enumerate(zip(windows.start, windows.steps, strict=True)):
        first = round((start - motion.time[0]) / motion.dt)
        out[:, first : first + steps + 1] = poses[:, number, : steps + 1]
        # The next prediction begins where this one ends, on the same index: its last own one is the one before.
        ends.append(first + int(steps) - 1)
    return out, ends


def contacts_of(recording: Recording, motion: Motion) -> dict[str, Array]:
    """Return where the grippers held (2,) [m] in the body's frame, by gripper."""
    middle = 0.5 * (motion.time[0] + motion.time[-1])
    return {
        grasp.gripper: grasp.contact
        for grasp in recording.grasps
        if grasp.object == motion.object and grasp.start <= middle <= grasp.end
    }


def recorded_poses(motion: Motion, geometry: BodyGeometry) -> Array:
    """Return the recorded poses (T + 1, 3) at the times of the grid; the scene's heading where none was observed."""
    pose = motion.pose if motion.oriented else np.where(np.isnan(motion.pose), geometry.pose[2], motion.pose)
    seen = np.all(np.isfinite(pose), axis=1)
    return np.column_stack([np.interp(motion.time, motion.pose_time[seen], pose[seen, k]) for k in range(3)])
