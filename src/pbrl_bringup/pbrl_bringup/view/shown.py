"""What the page shows of a recording: one form for a bag and for a running graph.

Times are seconds since `origin` on the recording's clock. Lists, never objects with names as keys: a name can be
anything, and the page shows it as text only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrl_bag import BodyGeometry, Recording
from pbrl_bringup.files import without_nan
from pbrl_bringup.view.tracks import METRES, BandTrack, PoseTrack, force_track, listed, pose_track, wrench_track

Array = NDArray[np.float64]

FIRST = 1200
"""Samples of a stream, and cells of a band, that the first picture is drawn from."""


@dataclass(frozen=True)
class Shown:
    """Everything that can be drawn.

    Attributes:
        title: names the recording.
        still: what does not change with time, in the form of the page's `/data`.
        origin: time of the recording at which the page's clock is zero [s].
        end: of the recording, on the page's clock [s].
        objects: track of each object in the order of `still["objects"]`; None: it was not seen.
        grippers: track of each gripper in the order of `still["grippers"]`.
        wrenches: what each gripper felt, likewise.
        forces: horizontal force of each gripper in world axes, likewise.
        residuals: wrench that the model lacks, of the objects named in `still["residuals"]`.
    """

    title: str
    still: dict[str, Any]
    origin: float
    end: float
    objects: Sequence[PoseTrack | None]
    grippers: Sequence[PoseTrack | None]
    wrenches: Sequence[BandTrack | None]
    forces: Sequence[BandTrack | None]
    residuals: Sequence[BandTrack] = field(default_factory=tuple)

    def data(self, most: int = FIRST) -> dict[str, Any]:
        """Return what the page asks for first: all that is still, and the streams with at most `most` samples."""
        return {
            "title": self.title,
            "origin": self.origin,
            "end": round(self.end, 4),
            **without_nan(self.still),  # plans, models and places are as somebody said them
            "streams": self.detail(0.0, self.end, most),
        }

    def detail(self, start: float, end: float, most: int) -> dict[str, Any]:
        """Return the streams between two times [s], at most `most` samples or cells of each."""

        def told(tracks: Sequence[PoseTrack | BandTrack | None]) -> list[dict[str, Any] | None]:
            return [None if track is None else track.to_json(start, end, most) for track in tracks]

        return {
            "from": start,
            "to": end,
            "objects": told(self.objects),
            "grippers": told(self.grippers),
            "wrenches": told(self.wrenches),
            "forces": told(self.forces),
            "residuals": told(self.residuals),
        }


def shown_of(recording: Recording, title: str, span: tuple[float, float] | None = None) -> Shown:
    """Return what can be drawn of a recording, whatever of it is missing.

    Args:
        recording: whole or in part.
        title: names it.
        span: begin and end of the page's time on the recording's clock [s]; None: of the recording.
    """
    objects = sorted(set(recording.bodies) | set(recording.object_poses))
    grippers = sorted(set(recording.wrenches) | set(recording.gripper_poses) | {g.gripper for g in recording.grasps})
    origin, end = _span(recording) if span is None else span
    poses, felt = recording.object_poses, recording.wrenches
    still = {
        "notes": list(recording.notes),
        "room": points(recording.room),
        "objects": [_object(name, recording.bodies.get(name)) for name in objects],
        "grippers": [_gripper(name, recording) for name in grippers],
        "grasps": [
            {
                "gripper": grasp.gripper,
                "object": grasp.object,
                "start": grasp.start - origin,
                "end": grasp.end - origin,
                "open": grasp.end >= end,
                "contact": listed(grasp.contact, METRES),
            }
            for grasp in recording.grasps
        ],
        "plans": [],
        "regions": [],
        "residuals": [],
    }
    return Shown(
        title=title,
        still=still,
        origin=origin,
        end=end - origin,
        objects=[pose_track(poses[name], origin) if name in poses else None for name in objects],
        grippers=[
            pose_track(recording.gripper_poses[name], origin) if name in recording.gripper_poses else None
            for name in grippers
        ],
        wrenches=[wrench_track(felt[name], origin) if name in felt else None for name in grippers],
        forces=[
            force_track(felt[name], recording.gripper_poses.get(name), origin) if name in felt else None
            for name in grippers
        ],
    )


def points(rows: Array) -> list[list[float | None]]:
    """Return (n, 2) points [m] as lists."""
    return [listed(row, METRES) for row in np.asarray(rows, dtype=float).reshape(-1, 2)]


def _span(recording: Recording) -> tuple[float, float]:
    """Return the times of the first and the last thing in a recording [s]."""
    groups = (recording.object_poses, recording.gripper_poses, recording.wrenches)
    times = [stream.time for group in groups for stream in group.values() if len(stream.time)]
    edges = [float(t) for time in times for t in (time[0], time[-1])]
    edges += [t for grasp in recording.grasps for t in (grasp.start, grasp.end)]
    return (min(edges), max(edges)) if edges else (0.0, 0.0)


def _object(name: str, body: BodyGeometry | None) -> dict[str, Any]:
    if body is None:
        return {"name": name, "outline": [], "casters": [], "movable": True, "mass": None, "pose": None, "model": None}
    return {
        "name": name,
        "outline": points(body.footprint),
        "casters": points(body.casters),
        "movable": body.movable,
        "mass": body.nominal_mass if np.isfinite(body.nominal_mass) else None,
        "pose": listed(body.pose, METRES),
        "model": None,
    }


def _gripper(name: str, recording: Recording) -> dict[str, Any]:
    felt = recording.wrenches.get(name)
    if felt is None:
        return {"name": name, "felt": "", "torque": False}
    axes = "the sensor's axes" if felt.frame == "sensor" else "world axes"
    whose = "as read, weight and bias included" if felt.exerted_on == "gripper" else "on the object"
    return {"name": name, "felt": f"{axes}, {whose}", "torque": bool(np.isfinite(felt.torque).any())}
