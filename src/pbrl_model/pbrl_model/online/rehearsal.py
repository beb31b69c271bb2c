"""Learns once from a made-up push, so that what is compiled or loaded on first use is there before data come."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pbrl_bag.types import BodyGeometry, Grasp, PoseStream, Recording, WrenchStream
from pbrl_model.fitting.options import FitOptions
from pbrl_model.online.learner import OnlineLearner, OnlineOptions

SECONDS, RATE = 2.4, 20.0
"""Length of the push [s] and poses a second: a few short windows."""
PARTICLES = 50


def rehearse() -> None:
    """Search, absorb and report on a crate that is pushed along a line and turned a little."""
    time = np.arange(0.0, SECONDS, 1.0 / RATE)
    travelled = 0.05 * time**2
    position = np.stack([travelled, 0.1 * travelled, np.full_like(time, 0.3)], -1)
    half = 0.1 * travelled
    quaternion = np.stack([0.0 * time, 0.0 * time, np.sin(half), np.cos(half)], -1)
    force = np.tile([1.0, 0.1, 0.0], (len(time), 1))
    crate = np.array([[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]])
    recording = Recording(
        path=Path("rehearsal"),
        bodies={"crate": BodyGeometry("crate", crate, 0.3, 10.0, True, np.zeros(3))},
        object_poses={"crate": PoseStream(time, position, quaternion)},
        gripper_poses={},
        wrenches={"left": WrenchStream(time, force, np.zeros_like(force), exerted_on="object", frame="world")},
        grasps=(Grasp("left", "crate", 0.0, float(time[-1]), np.array([-0.3, 0.0])),),
    )
    learner = OnlineLearner(OnlineOptions(FitOptions(window=0.6), particles=PARTICLES))
    learner.update(recording, at_the_end=True)
