"""What of a recording a fit learns from: the holds of one object that can be used, on one clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pbrl_bag.episodes import Episode, cut_episodes
from pbrl_bag.types import BodyGeometry, Recording
from pbrl_model.errors import ModelError
from pbrl_model.fitting.options import FitOptions
from pbrl_model.geometry import MassProperties, mass_properties
from pbrl_model.sensing.checks import check_recording
from pbrl_model.sensing.motion import Motion, begun_unheard, observe

__all__ = ["body_of", "motions_of", "usable_episodes"]

SHORTEST = 0.5
"""Episodes shorter than this [s] are left out, unless there is no other."""


def motions_of(
    recording: Recording, name: str, options: FitOptions | None = None, delay: float = 0.0
) -> tuple[Motion, ...]:
    """Return the episodes of one object on one clock; but for holds that were under way when recording began.

    Args:
        recording: as read.
        name: of the object.
        options: None: the defaults.
        delay: by how much poses come after wrenches [s], see `observe`.

    Raises:
        ModelError: a stream is missing or broken, every episode is too short, or the pose never changes.
        BagError: an episode is malformed.
    """
    chosen = options or FitOptions()
    check_recording(recording, name)
    com = body_of(recording.bodies[name], _oriented(recording, name)).com
    usable = _heard(recording, usable_episodes(recording, name))
    seen = [np.nan_to_num(np.hstack([each.poses.position, each.poses.quaternion])) for each in usable]
    if all((poses == poses[:1]).all() for poses in seen):
        raise ModelError(f"{name}: expected poses that change while it is held, got the same one all the time")
    return tuple(
        observe(recording, name, episode.grippers, episode.start, episode.end, com, gravity=chosen.gravity, delay=delay)
        for episode in usable
    )


def usable_episodes(recording: Recording, name: str) -> list[Episode]:
    """Return the episodes of one object that last long enough; `motions_of` leaves those out that were not heard whole.

    Raises:
        ModelError: there is none.
        BagError: an episode is malformed.
    """
    episodes = [episode for episode in cut_episodes(recording) if episode.object == name]
    usable = [episode for episode in episodes if episode.duration >= SHORTEST]
    if not usable:
        longest = max((episode.duration for episode in episodes), default=0.0)
        raise ModelError(f"{name}: expected an episode of at least {SHORTEST} s, got at most {longest:.3f} s")
    return usable


def _heard(recording: Recording, episodes: Sequence[Episode]) -> list[Episode]:
    """Return the episodes whose forces were heard from the beginning; all, where none is: what is missing is said."""
    return [each for each in episodes if not begun_unheard(recording, each)] or list(episodes)


def _oriented(recording: Recording, name: str) -> bool:
    return bool(np.any(np.isfinite(recording.object_poses[name].quaternion)))


def body_of(geometry: BodyGeometry, oriented: bool) -> MassProperties:
    """Return mass properties; a body of unknown orientation is taken as the point that is observed."""
    body = mass_properties(geometry.footprint)
    return body if oriented else replace(body, com=np.zeros(2))
