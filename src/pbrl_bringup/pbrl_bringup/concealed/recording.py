"""What a hand's push left behind, as a recording of the contract: streams and known geometry, nothing of the truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bullet_sim.catalogue import Fixture
from bullet_sim.hand_recording import HandRecording, TagTrack
from bullet_sim.scene import Scene
from pbrl_bag.types import BodyGeometry, Grasp, PoseStream, Recording, WrenchStream


def to_recording(made: HandRecording, scene: Scene) -> Recording:
    """Return the recording that learners are given.

    Args:
        made: by `push_by_hand`.
        scene: that it was made in; only what is known of it is used.
    """
    gripper = f"{made.side}_gripper"
    bodies = {
        name: BodyGeometry(name, body.footprint, body.levels[1], body.nominal_mass, True, np.array(body.pose))
        for name, body in scene.bodies.items()
        if not isinstance(body, Fixture)
    }
    return Recording(
        path=Path("concealed"),
        bodies=bodies,
        object_poses={name: _poses(track) for name, track in made.tags.items() if name != gripper},
        gripper_poses={made.side: _poses(made.tags[gripper])},
        wrenches={made.side: WrenchStream(made.wrench.time, made.wrench.force, made.wrench.torque)},
        grasps=tuple(_grasps(made)),
        room=np.array(scene.room.outline),
    )


def _poses(track: TagTrack) -> PoseStream:
    return PoseStream(track.time, track.position, track.quaternion)


def _grasps(made: HandRecording) -> list[Grasp]:
    """Return the intervals between changes of what is held."""
    ends = [change.time for change in made.grasps[1:]] + [made.seconds]
    return [
        Grasp(made.side, change.body, change.time, end, change.contact[:2])
        for change, end in zip(made.grasps, ends, strict=True)
        if change.body is not None
    ]
