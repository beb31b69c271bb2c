"""The PR2's URDF, and the same with a base that slides and turns over the floor, as Bullet is given it."""

from __future__ import annotations

import re
import tempfile
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from bullet_sim.client import BulletClient, Pose
from bullet_sim.description import installed_description

NAME = "pr2"
SIDES = ("left", "right")
BASE_JOINTS = ("base_x", "base_y", "base_turn")
"""Of the base over the floor, in `world`; only Bullet has them, the robot's description ends at `base`."""
ARM_JOINTS = {
    side: tuple(
        f"{side[0]}_{joint}_joint"
        for joint in (
            "shoulder_pan",
            "shoulder_lift",
            "upper_arm_roll",
            "elbow_flex",
            "forearm_roll",
            "wrist_flex",
            "wrist_roll",
        )
    )
    for side in SIDES
}
BODY_JOINTS = (
    "torso_lift_joint",
    "head_pan_joint",
    "head_tilt_joint",
    "laser_tilt_mount_joint",
    *ARM_JOINTS["left"],
    *ARM_JOINTS["right"],
)
"""The 18 joints that are commanded and reported, in the order of every array of joints here."""

Array = NDArray[np.float64]

_SLIDER = (
    '<link name="{child}"><inertial><mass value="0.01"/>'
    '<inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
_JOINT = (
    '<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
    '<limit lower="-1000" upper="1000" effort="10000" velocity="10"/></joint>'
)


def description_path() -> Path:
    """Find the PR2's URDF in the installed workspace; raise SimError where it is not."""
    return installed_description("pr2")


@dataclass(frozen=True)
class Limits:
    """Limits of `BODY_JOINTS`: position (infinite for those that turn on), speed, force; metres or radians."""

    lower: Array
    upper: Array
    velocity: Array
    effort: Array


def read_limits() -> Limits:
    """Read the joints' limits from the URDF."""
    joints = {joint.get("name"): joint for joint in ElementTree.parse(description_path()).getroot().iter("joint")}
    told = [joints[name].find("limit") for name in BODY_JOINTS]
    rows = {"lower": "-inf", "upper": "inf", "velocity": "nan", "effort": "nan"}
    columns = [
        np.array([float(limit.get(key, missing)) for limit in told if limit is not None])
        for key, missing in rows.items()
    ]
    return Limits(*columns)


def load_on_planar_base(client: BulletClient) -> int:
    """Load the PR2 with `BASE_JOINTS` between `world` and its base; their angles are the base's pose.

    Bullet is not told the limits of positions, which the drives keep: as constraints they would triple its work.

    Args:
        client: where it will live, as body `NAME`.

    Returns:
        Bullet's number.
    """
    text = description_path().read_text(encoding="utf-8").replace("</robot>", f"{_planar_base()}</robot>")
    text = re.sub(r'lower="[^"]*" upper="[^"]*"', 'lower="1" upper="-1"', text)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "pr2.urdf"
        file.write_text(text, encoding="utf-8")
        still = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
        return client.load_urdf(NAME, str(file), still, useFixedBase=True)


def _planar_base() -> str:
    """Give links and joints from a fixed root to `base`."""
    links = "".join(_SLIDER.format(child=child) for child in ("anchor", "slide_x", "slide_y"))
    rows = zip(
        BASE_JOINTS,
        ("prismatic", "prismatic", "continuous"),
        ("anchor", "slide_x", "slide_y"),
        ("slide_x", "slide_y", "base"),
        ("1 0 0", "0 1 0", "0 0 1"),
        strict=True,
    )
    return links + "".join(
        _JOINT.format(name=name, kind=kind, parent=parent, child=child, axis=axis)
        for name, kind, parent, child, axis in rows
    )
