"""The PR2's observations as ROS messages on their topics; those that every robot gives are `bullet_sim.messages`'."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, WrenchStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Odometry as OdometryMsg
from numpy.typing import NDArray
from pbrl_msgs.msg import Grasps, Scene
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, LaserScan
from std_msgs.msg import Header, String
from tf2_msgs.msg import TFMessage

from bullet_sim import messages as shared
from bullet_sim.messages import Messages, heading, stamp, to_messages, translate
from pr2_cart_sim.observations import BaseOdometry, CartReading, KnownMap, Localisation, Scan

__all__ = ["LATCHED", "MESSAGE_TYPES", "to_messages"]

LATCHED = (*shared.LATCHED, "/map")
"""Topics whose last message late subscribers get too: transient local, depth 1."""

SCANS = {"base": "/scan", "tilt": "/tilt_scan"}
"""Topic by laser."""

MESSAGE_TYPES: dict[str, Callable[[], Any]] = {
    "/clock": Clock,
    "/joint_states": JointState,
    "/odom": OdometryMsg,
    "/amcl_pose": PoseWithCovarianceStamped,
    "/tf": TFMessage,
    "/tf_static": TFMessage,
    "/robot_description": String,
    "/scene": Scene,
    "/map": OccupancyGrid,
    "/grasps": Grasps,
    "/scan": LaserScan,
    "/tilt_scan": LaserScan,
    "/wrist_ft/left": WrenchStamped,
    "/wrist_ft/right": WrenchStamped,
    "/cart_pose/hands": PoseStamped,
    "/cart_pose/checkerboard": PoseStamped,
}
"""Every topic that the simulator publishes and its message class."""

ODOMETRY_VARIANCE = 1e-3
"""Variance [m^2], [rad^2] given with odometry and, per second, with its twist."""


@translate.register
def _(observation: BaseOdometry) -> Messages:
    message = OdometryMsg(header=Header(stamp=stamp(observation.time), frame_id="odom"), child_frame_id="base")
    _place(message.pose.pose, observation.pose)
    twist = message.twist.twist
    twist.linear.x, twist.linear.y, twist.angular.z = observation.twist.tolist()
    message.pose.covariance = message.twist.covariance = _planar_covariance(np.full(3, ODOMETRY_VARIANCE))
    return [("/odom", message)]


@translate.register
def _(observation: Localisation) -> Messages:
    message = PoseWithCovarianceStamped(header=Header(stamp=stamp(observation.time), frame_id="map"))
    _place(message.pose.pose, observation.pose)
    message.pose.covariance = _planar_covariance(observation.sigma**2)
    return [("/amcl_pose", message)]


@translate.register
def _(observation: Scan) -> Messages:
    low, high = observation.span
    message = LaserScan(
        header=Header(stamp=stamp(observation.time), frame_id=observation.frame),
        angle_min=observation.angle_min,
        angle_max=observation.angle_min + (len(observation.ranges) - 1) * observation.increment,
        angle_increment=observation.increment,
        scan_time=observation.period,
        range_min=low,
        range_max=high,
        ranges=array("f", observation.ranges.astype(np.float32).tobytes()),
    )
    return [(SCANS[observation.laser], message)]


@translate.register
def _(observation: CartReading) -> Messages:
    message = PoseStamped(header=Header(stamp=stamp(observation.time), frame_id="base"))
    _place(message.pose, observation.pose)
    return [(f"/cart_pose/{observation.source}", message)]


@translate.register
def _(observation: KnownMap) -> Messages:
    grid, when = observation.grid, stamp(observation.time)
    message = OccupancyGrid(header=Header(stamp=when, frame_id="map"))
    message.info.map_load_time = when
    message.info.resolution = grid.resolution
    message.info.height, message.info.width = grid.cells.shape
    message.info.origin.position.x, message.info.origin.position.y = grid.origin
    message.data = array("b", grid.cells.astype(np.int8).tobytes())
    return [("/map", message)]


def _place(pose: Any, planar: NDArray[np.float64]) -> None:
    """Write a planar pose (3,) into a message's pose."""
    pose.position.x, pose.position.y, theta = planar.tolist()
    pose.orientation = heading(theta)


def _planar_covariance(variance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the covariance (36,) of a pose whose x, y and heading have these variances."""
    return np.diag([*variance[:2], *[shared.UNOBSERVED] * 3, variance[2]]).ravel()
