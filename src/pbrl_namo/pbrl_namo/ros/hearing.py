"""What is heard of robot and room, as one percept; the streams that a fetch needs."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

from geometry_msgs.msg import PoseStamped, WrenchStamped
from nav_msgs.msg import Odometry
from pbrl_msgs.msg import Grasps, Scene
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from pbrl_bag.errors import BagError
from pbrl_bag.names import relative
from pbrl_bag.ros.diagnostics import Diagnostics
from pbrl_control.errors import ControlError
from pbrl_control.kinematics import SIDES, Posture
from pbrl_control.percept import BodyShape, Grip, Percept, Tag, gripper_tag
from pbrl_control.planar import Array
from pbrl_control.ros.conversions import (
    bodies_from_msg,
    grips_from_msg,
    movable_from_msg,
    posture_from_msg,
    tag_from_msg,
    wrench_from_msg,
)
from pbrl_control.ros.floor_conversions import odometry_from_msg
from pbrl_control.ros.qos import LATCHED, NEWEST
from pbrl_namo.errors import NamoError

JOINT_STATES, SHARE = "/joint_states", "/body_controller/share"

AHEAD = 1.0
"""A stamp that lies further ahead than this is of a clock that has been set back [s]."""


class Hearing:
    """Subscribes to the streams and keeps the last message of each.

    Args:
        node: that hears.
        diagnostics: of the node.
        scene: is told of each /scene; may refuse it.
        odometry: is told when odometry was taken [s], and the pose (3,) of `base` in `odom` [m, rad].
        alive: is told of each sign of life of `JOINT_STATES` and `SHARE`, and when it came on the steady clock [s].
    """

    def __init__(
        self,
        node: Node,
        diagnostics: Diagnostics,
        scene: Callable[[Scene], None],
        odometry: Callable[[float, Array], None],
        alive: Callable[[str, float], None],
    ) -> None:
        self._node, self._scene, self._odometry, self._alive = node, scene, odometry, alive
        self._posture: Posture | None = None
        self._tags: dict[str, Tag] = {}
        self._tag_topics: set[str] = set()
        self._wrenches: dict[str, Array] = {}
        self._grips: dict[str, Grip] = {}
        self._bodies: dict[str, BodyShape] = {}
        self._share = 1.0
        hear = self._subscribe = diagnostics.subscribe
        hear(Scene, "scene", self._on_scene, LATCHED, refuses=(BagError, ControlError, NamoError))
        hear(Grasps, "grasps", self._on_grasps, LATCHED)
        hear(JointState, relative(JOINT_STATES), self._on_joints, NEWEST)
        hear(Odometry, "odom", self._on_odometry, NEWEST)
        hear(Float64, relative(SHARE), self._on_share, NEWEST, needed=False)
        for side in SIDES:
            hear(WrenchStamped, f"wrist_ft/{side}", partial(self._on_wrench, side), NEWEST)
            self._listen_to_tag(gripper_tag(side))

    def percept(self, now: float) -> Percept:
        """Return the latest of every stream, without tags that were seen on a clock that is ahead of `now` [s]."""
        stale = [name for name, tag in self._tags.items() if tag.time > now + AHEAD]
        for name in stale:
            del self._tags[name]
        return Percept(self._posture, dict(self._tags), dict(self._wrenches), self._grips, self._bodies, self._share)

    def _listen_to_tag(self, name: str) -> None:
        if name not in self._tag_topics:
            self._tag_topics.add(name)
            self._subscribe(PoseStamped, f"ar_tags/{name}/pose", partial(self._on_tag, name), NEWEST)

    def _on_scene(self, message: Scene) -> None:
        bodies, movable = bodies_from_msg(message), movable_from_msg(message)
        self._scene(message)  # refuses what is no scene: then nothing of it is taken in
        self._bodies = bodies
        for name in movable:
            self._listen_to_tag(name)

    def _on_grasps(self, message: Grasps) -> None:
        self._grips = grips_from_msg(message)

    def _on_joints(self, message: JointState) -> None:
        try:
            self._posture = posture_from_msg(message)
        except ControlError as error:
            self._node.get_logger().error(str(error), once=True)
        else:
            self._alive(JOINT_STATES, time.monotonic())

    def _on_odometry(self, message: Odometry) -> None:
        self._odometry(*odometry_from_msg(message))

    def _on_share(self, message: Float64) -> None:
        self._share = message.data
        self._alive(SHARE, time.monotonic())

    def _on_wrench(self, side: str, message: WrenchStamped) -> None:
        self._wrenches[side] = wrench_from_msg(message)

    def _on_tag(self, name: str, message: PoseStamped) -> None:
        self._tags[name] = tag_from_msg(message)
