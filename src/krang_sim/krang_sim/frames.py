"""Where the robot's links are in its base; see `bullet_sim.frames`."""

from __future__ import annotations

from bullet_sim.frames import RobotFrames, relative_poses

__all__ = ["RobotFrames", "relative_poses"]
