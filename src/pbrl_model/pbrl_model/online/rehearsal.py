"""Learns once from a made-up push, so that what is compiled or loaded on first use is there before data come."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pbrl_bag.types import BodyGeometry, Grasp, PoseStream, Recording, WrenchStream
from pbrl_model.fitting.options import FitOptions
from pbrl_model.online.learner import OnlineLearner, OnlineOptions

SECONDS, RATE = 2.4, 20.0
"""Length of the push [s] and poses a second: a few short windows."""
WINDOW = 0.6
"""[s] of a fit to it."""
PARTICLES = 50


def rehearse() -> None:
    """Search, absorb and report on a made-up push."""
    learner = OnlineLearner(OnlineOptions(FitOptions(window=WINDOW), particles=PARTICLES))
    learner.update(made_up_push(), at_the_end=True)


def made_up_push() -> Recording:
    """Return a recording of a crate, called so, that is pushed along a line and turned a little."""
    time = np.arange(0.0, SECONDS, 1.0 / RATE)
    travelled = 0.05 * time**2
    position = np.stack([travelled, 0.1 * travelled, np.full_like(time, 0.3)], -1)
    half = 0.1 * travelled
    quaternion = np.stack([0.0 * time, 0.0 * time, np.sin(half), np.cos(half)], -1)
    force = np.outer(1.0 + 0.1 * np.sin(20.0 * time), [1.0, 0.1, 0.0])
    crate = np.array([[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]])
    return Recording(
        path=Path("rehearsal"),
        bodies={"crate": BodyGeometry("crate", crate, 0.3, 10.0, True, np.zeros(3))},
        object_poses={"crate": PoseStream(time, position, quaternion)},
        gripper_poses={},
        wrenches={"left": WrenchStream(time, force, np.zeros_like(force), exerted_on="object", frame="world")},
        grasps=(Grasp("left", "crate", 0.0, float(time[-1]), np.array([-0.3, 0.0])),),
    )
