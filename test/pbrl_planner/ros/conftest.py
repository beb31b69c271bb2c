"""A node of this package beside one that plays all others: robot, cart, clock; both spun in turn, in one thread."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Point, PoseStamped, PoseWithCovarianceStamped, Quaternion, TransformStamped, Vector3
from nav_msgs.msg import Odometry
from pbrl_msgs.msg import Body, Grasp, Grasps, Scene
from rclpy.action import ActionClient
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from pbrl_bringup.graph import free_domain
from pbrl_control.planar import Array
from pbrl_control.ros.qos import LATCHED
from pbrl_planner.costmap import CostField
from pbrl_planner.ros.conversions import field_to_msg, pose_to_msg, stamp_of

PATIENCE = 120.0  # [s] of the wall clock
STREAM = QoSProfile(depth=10)
CART = [[-0.5, -0.275], [0.5, -0.275], [0.5, 0.275], [-0.5, 0.275]]
BEFORE = 0.65 + 0.484
"""From `base` to the middle of the cart [m]."""


class Stage:
    """Spins nodes; plays the robot.

    Attributes:
        time: that the clock says [s].
        pose: (3,) of the robot in `map`, which `odom` is, too.
        twist: (3,) of it.
    """

    def __init__(self) -> None:
        self.node = Node("stage")
        self.executor = EventsExecutor()
        self.executor.add_node(self.node)
        self.time, self.pose, self.twist = 1.0, np.array([1.0, 1.5, 0.0]), np.zeros(3)
        self._out: dict[str, Publisher] = {}
        self._nodes = [self.node]
        self._clients: list[ActionClient] = []

    def add(self, kind: Callable[..., Any], **parameters: Any) -> Any:
        """Put a node on the stage."""
        told = [Parameter(name, value=value) for name, value in ({"use_sim_time": True} | parameters).items()]
        node = kind(parameter_overrides=told)
        self.executor.add_node(node)
        self._nodes.append(node)
        return node

    def send(self, topic: str, message: Any, qos: QoSProfile = STREAM) -> None:
        if topic not in self._out:
            self._out[topic] = self.node.create_publisher(type(message), topic, qos)
            self.until(lambda: self._out[topic].get_subscription_count() > 0)
        self._out[topic].publish(message)

    def hear(self, kind: type, topic: str, qos: QoSProfile = STREAM) -> list:
        heard: list = []
        self.node.create_subscription(kind, topic, heard.append, qos)
        return heard

    def until(self, condition: Callable[[], Any]) -> None:
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, "did not happen"
            self.executor.spin_once(timeout_sec=0.02)

    def ask(self, kind: Any, name: str, goal: Any, told: Callable[[Any], None] = lambda _: None) -> list:
        """Send a goal; return a list into which its result comes."""
        client = ActionClient(self.node, kind, name)
        self._clients.append(client)
        self.until(client.server_is_ready)
        results: list = []

        def accepted(future: Any) -> None:
            future.result().get_result_async().add_done_callback(lambda done: results.append(done.result().result))

        sent = client.send_goal_async(goal, feedback_callback=lambda message: told(message.feedback))
        sent.add_done_callback(accepted)
        self.until(sent.done)
        return results

    def tick(self, step: float = 0.05) -> None:
        """Move on for a time [s], tell of robot and cart, and then what time it is."""
        c, s = np.cos(self.pose[2]), np.sin(self.pose[2])
        vx, vy, w = self.twist
        self.time += step
        self.pose = self.pose + step * np.array([c * vx - s * vy, s * vx + c * vy, w])
        self.tell_robot()
        self.tell_time()

    def track(self, tracker: Any) -> None:
        """Tell of robot and cart until a node knows where they are."""
        self.tell_cart()
        deadline = time.monotonic() + PATIENCE
        while tracker.missing or tracker.state(self.time) is None:
            assert time.monotonic() < deadline, tracker.missing
            self.tick()
            self.until(lambda: abs(tracker.whereabouts.time - self.time) < 1e-6 and self._heard_cart(tracker))

    def _heard_cart(self, tracker: Any) -> bool:
        seen = tracker.last_sight()
        return tracker.cart is None or (seen is not None and abs(seen.time - self.time) < 1e-6)

    def tell_time(self) -> None:
        self.send("/clock", Clock(clock=stamp_of(self.time)))

    def pass_time(self, node: Node, step: float) -> None:
        """Move the clock on by a time [s], and nothing else; return once a node has heard it, however busy it is."""
        self.time += step
        told = self.time - 1e-6

        def heard() -> bool:
            if node.get_clock().now().nanoseconds * 1e-9 < told:
                self.tell_time()  # again: a simulator's last word may have come after it
                return False
            return True

        self.until(heard)

    def tell_robot(self) -> None:
        stamp = stamp_of(self.time)
        odometry = Odometry(child_frame_id="base")
        odometry.header.frame_id, odometry.header.stamp = "odom", stamp
        odometry.pose.pose = pose_to_msg(self.pose)
        odometry.twist.twist.linear.x, odometry.twist.twist.linear.y = float(self.twist[0]), float(self.twist[1])
        odometry.twist.twist.angular.z = float(self.twist[2])
        self.send("/odom", odometry)
        place = PoseWithCovarianceStamped()
        place.header.frame_id, place.header.stamp = "map", stamp
        place.pose.pose = pose_to_msg(self.pose)
        self.send("/amcl_pose", place)
        cart = PoseStamped(pose=pose_to_msg(np.array([BEFORE, 0.0, 0.0])))
        cart.header.frame_id, cart.header.stamp = "base", stamp
        self.send("/cart_pose/hands", cart)

    def tell_cart(self, hands: tuple[str, ...] = ("left", "right"), *more: Body) -> None:
        footprint = [Point(x=x, y=y) for x, y in CART]
        cart = Body(name="cart", footprint=footprint, height=0.9, movable=True)
        self.send("/scene", Scene(bodies=[cart, *more]), LATCHED)
        self.tell_grasps(hands)

    def tell_grasps(self, hands: tuple[str, ...]) -> None:
        self.send("/grasps", Grasps(grasps=[Grasp(gripper=side, object="cart") for side in hands]), LATCHED)

    def tell_floor(self, topic: str, field: CostField) -> None:
        self.send(topic, field_to_msg(field), LATCHED)

    def tell_laser(self, frame: str, place: Array) -> None:
        each = TransformStamped(child_frame_id=frame)
        each.header.frame_id = "base"
        x, y, yaw = map(float, place)
        each.transform.translation = Vector3(x=x, y=y, z=0.3)
        each.transform.rotation = Quaternion(z=float(np.sin(yaw / 2)), w=float(np.cos(yaw / 2)))
        self.send("/tf_static", TFMessage(transforms=[each]), LATCHED)

    def close(self) -> None:
        self.executor.shutdown()
        for client in self._clients:
            client.destroy()
        for node in reversed(self._nodes):
            node.destroy_node()


@pytest.fixture
def stage() -> Iterator[Stage]:
    with free_domain() as domain:
        rclpy.init(domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        made = Stage()
        yield made
        made.close()
        rclpy.try_shutdown()
