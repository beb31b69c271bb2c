"""What is heard of robot and cart, into a `CartTracker`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from pbrl_msgs.msg import Grasps, Scene
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from pbrl_bag.errors import BagError
from pbrl_bag.geometry import bodies_of_scene
from pbrl_bag.ros.diagnostics import Diagnostics
from pbrl_control.fence import TOLD
from pbrl_control.planar import placed
from pbrl_control.ros.conversions import seconds
from pbrl_control.ros.qos import LATCHED
from pbrl_planner.cart.tracker import SOURCES, CartTracker
from pbrl_planner.errors import PlannerError
from pbrl_planner.ros.conversions import MAP, motion_from_msg, planar_pose

STREAM = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
BASE = "base"
"""The robot's frame."""
SAID = 5.0
"""[s] between two warnings of the same kind."""


class Hearing:
    """Subscribes to the streams.

    Args:
        node: that hears.
        diagnostics: of the node.
        tracker: is told.
        again: is called when the clock of odometry has begun again.
    """

    def __init__(
        self, node: Node, diagnostics: Diagnostics, tracker: CartTracker, again: Callable[[], None] = lambda: None
    ) -> None:
        self._node, self._tracker, self._again = node, tracker, again
        hear = diagnostics.subscribe
        hear(Odometry, "odom", self._on_odometry, STREAM)
        hear(PoseWithCovarianceStamped, "amcl_pose", self._on_pose, STREAM)
        hear(Scene, "scene", self._on_scene, LATCHED, refuses=(BagError, PlannerError))
        hear(Grasps, "grasps", self._on_grasps, LATCHED, refuses=(PlannerError,))
        for source in SOURCES:  # one of them will do
            hear(PoseStamped, f"cart_pose/{source}", partial(self._on_cart, source), STREAM, needed=False)

    def _on_odometry(self, message: Odometry) -> None:
        try:
            begun_again = self._tracker.moved(*motion_from_msg(message))
        except PlannerError as error:
            self._warn(error)
            return
        if begun_again:
            self._node.get_logger().warning("the clock of odometry was set back: what was known of places is void")
            self._again()

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        try:
            if message.header.frame_id != MAP:
                raise PlannerError(f"/amcl_pose: expected it in frame {MAP!r}, got {message.header.frame_id!r}")
            self._tracker.localised(seconds(message.header.stamp), planar_pose(message.pose.pose, "/amcl_pose"))
        except PlannerError as error:
            self._warn(error)

    def _on_scene(self, message: Scene) -> None:
        known = bodies_of_scene("/scene", message)
        self._tracker.furniture({name: body.footprint for name, body in known.items() if body.movable})
        self._tracker.kept_out = [
            placed(body.footprint, body.pose) for name, body in known.items() if name.startswith(TOLD)
        ]

    def _on_grasps(self, message: Grasps) -> None:
        self._tracker.grasps({grasp.gripper: grasp.object for grasp in message.grasps})

    def _on_cart(self, source: str, message: PoseStamped) -> None:
        try:
            if message.header.frame_id != BASE:
                raise PlannerError(
                    f"/cart_pose/{source}: expected it in frame {BASE!r}, got {message.header.frame_id!r}"
                )
            pose = planar_pose(message.pose, f"/cart_pose/{source}")
        except PlannerError as error:
            self._warn(error)
            return
        self._tracker.cart_seen(source, seconds(message.header.stamp), pose)

    def _warn(self, error: PlannerError) -> None:
        self._node.get_logger().warning(f"left aside: {error}", throttle_duration_sec=SAID)
