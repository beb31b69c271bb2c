"""What the simulator publishes, as plain values; see `bullet_sim.observations`."""

from __future__ import annotations

from bullet_sim.observations import (
    CameraPicture,
    ClockTick,
    GraspState,
    Hold,
    JointStates,
    KnownBody,
    KnownScene,
    Observation,
    Odometry,
    Outlines,
    RobotDescription,
    TagReading,
    Transforms,
    WristReading,
)

__all__ = [
    "CameraPicture",
    "ClockTick",
    "GraspState",
    "Hold",
    "JointStates",
    "KnownBody",
    "KnownScene",
    "Observation",
    "Odometry",
    "Outlines",
    "RobotDescription",
    "TagReading",
    "Transforms",
    "WristReading",
]
