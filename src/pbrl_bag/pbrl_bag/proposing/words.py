"""What names of topics, frames and joints say of what they are of."""

from __future__ import annotations

import re

HANDS = re.compile(
    r"gripper|hand|wrist|tool|tcp|eef|(^|[/_])ee([/_]|$)|end_?effector|flange|palm|finger|(^|[/_])ft([/_]|$)"
)
ROBOT = re.compile(
    r"(^|[/_])(base|odom|odometry|torso|camera|head|imu|laser|map|world|footprint|arm|shoulder|elbow|link\d*)([/_]|$)"
)
LEFT, RIGHT = re.compile(r"(^|[/_])(left|l)([/_]|$)"), re.compile(r"(^|[/_])(right|r)([/_]|$)")
COMPENSATED = re.compile(r"compensat|external|contact|filtered_net")
NOT_A_NAME = re.compile(r"(pose|poses|odom|odometry|tf|transform|mocap|vicon|optitrack|ar_tags|_)+", re.IGNORECASE)


def side_of(name: str) -> str:
    """Return "left", "right", or nothing where a name does not say."""
    low = name.lower()
    return "left" if LEFT.search(low) else "right" if RIGHT.search(low) else ""
