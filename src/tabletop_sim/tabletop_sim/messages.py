"""The tabletop's observations as ROS messages on their topics; see `bullet_sim.messages`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import PoseStamped
from pbrl_msgs.msg import Scene
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from tabletop_sim.scene import DeskScene

LATCHED = ("/tf_static", "/robot_description", "/scene")
"""Topics whose last message late subscribers get too: transient local, depth 1."""


def message_types(scene: DeskScene) -> dict[str, Callable[[], Any]]:
    """List every topic that the simulator publishes and its message class."""
    types: dict[str, Callable[[], Any]] = {
        "/clock": Clock,
        "/joint_states": JointState,
        "/tf": TFMessage,
        "/tf_static": TFMessage,
        "/robot_description": String,
        "/scene": Scene,
    }
    if scene.vision.source == "rendered":
        types |= {"/camera/overhead_0/image_raw": Image, "/camera/overhead_0/camera_info": CameraInfo}
    else:
        names = (name for name, item in scene.items.items() if not item.obstacle)
        types |= {f"/ar_tags/{name}/pose": PoseStamped for name in names}
    return types
