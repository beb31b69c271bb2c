"""Messages of maps, scans, paths and poses to library types and back; plain functions, no node needed."""

from __future__ import annotations

import math
from array import array

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose, PoseStamped, Quaternion, Transform
from nav_msgs.msg import OccupancyGrid, Odometry
from nav_msgs.msg import Path as PathMsg
from numpy.typing import NDArray
from pbrl_msgs.msg import CartPath
from sensor_msgs.msg import LaserScan

from pbrl_control.planar import Array, yaw_of
from pbrl_control.ros.conversions import seconds
from pbrl_planner.costmap import INSCRIBED, LETHAL, UNKNOWN, CostField, RangeScan, StaticMap
from pbrl_planner.errors import PlannerError

MAP = "map"
"""The frame of goals, costmaps and paths (REP 105)."""
UNIT = 0.01
"""By so much the length of a quaternion may differ from one."""
FARTHEST = 1e5
"""[m] from the origin of a frame; further away, numbers have no millimetres any more."""
UPRIGHT = 0.05
"""Sine of the angle by which a pose on the floor may lean."""


def stamp_of(time: float) -> Time:
    """Return a time [s] as a stamp; what is before the beginning of time is zero."""
    nanoseconds = round(time * 1e9) if math.isfinite(time) and time > 0.0 else 0
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def planar_pose(pose: Pose, what: str) -> Array:
    """Return x, y and heading (3,) of a pose that lies on the floor [m, rad].

    Raises:
        PlannerError: it does not, or is no pose.
    """
    p, q = pose.position, pose.orientation
    length = math.hypot(q.x, q.y, q.z, q.w)
    if not abs(length - 1.0) < UNIT:
        raise PlannerError(f"{what}: expected a quaternion of length 1, got length {length:.3g}")
    if math.hypot(q.x, q.y) > UPRIGHT:
        raise PlannerError(f"{what}: expected it upright on the floor, got one that leans")
    found = np.array([p.x, p.y, yaw_of(np.array([q.x, q.y, q.z, q.w]))])
    if not (np.isfinite(found).all() and np.abs(found[:2]).max() <= FARTHEST):
        raise PlannerError(f"{what}: expected finite x and y within {FARTHEST:g} m, and a heading, got {found}")
    return found


def pose_in_map(message: PoseStamped, what: str) -> Array:
    """Return a pose (3,) that is given in `map`.

    Raises:
        PlannerError: it is in another frame, or no pose on the floor.
    """
    frame = message.header.frame_id
    if frame != MAP:
        raise PlannerError(f"{what}: expected it in frame {MAP!r}, got {frame!r}; make {MAP!r} RViz's fixed frame")
    return planar_pose(message.pose, what)


def pose_to_msg(pose: Array) -> Pose:
    """Return a pose (3,) on the floor."""
    found = Pose()
    found.position.x, found.position.y = float(pose[0]), float(pose[1])
    found.orientation = heading_to_msg(float(pose[2]))
    return found


def heading_to_msg(heading: float) -> Quaternion:
    """Return a turn about the vertical [rad]."""
    return Quaternion(z=math.sin(0.5 * heading), w=math.cos(0.5 * heading))


def transform_from_msg(message: Transform) -> Array:
    """Return a transform as a matrix (4, 4)."""
    t, q = message.translation, message.rotation
    x, y, z, w = q.x, q.y, q.z, q.w
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), t.x],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), t.y],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), t.z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def motion_from_msg(message: Odometry) -> tuple[float, Array, Array]:
    """Return when odometry was taken [s], the pose (3,) of `base` in `odom`, and its twist (3,) in `base`.

    Raises:
        PlannerError: it is no pose on the floor, or a number is not finite.
    """
    twist = message.twist.twist
    rates = np.array([twist.linear.x, twist.linear.y, twist.angular.z])
    if not np.isfinite(rates).all():
        raise PlannerError(f"odometry: expected a finite twist, got {rates}")
    return seconds(message.header.stamp), planar_pose(message.pose.pose, "odometry"), rates


def scan_from_msg(message: LaserScan) -> RangeScan:
    """Return a scan.

    Raises:
        PlannerError: it is none.
    """
    ranges = np.array(message.ranges, dtype=float)
    return RangeScan(
        seconds(message.header.stamp),
        float(message.angle_min),
        float(message.angle_increment),
        (float(message.range_min), float(message.range_max)),
        ranges,
    )


def map_from_msg(message: OccupancyGrid) -> StaticMap:
    """Return a map in its frame, `map`.

    Raises:
        PlannerError: it is none.
    """
    corner = planar_pose(message.info.origin, "origin of the map")
    return StaticMap(_cells(message), resolution_of(message), tuple(map(float, corner)))


def resolution_of(message: OccupancyGrid) -> float:
    """Return the size of a cell [m], which comes as a float of 32 bits: 0.05, not 0.0500000007."""
    return float(f"{message.info.resolution:.7g}")


def field_to_msg(field: CostField) -> OccupancyGrid:
    """Return a costmap as Nav2 publishes one: 0 free, 1 to 98 dear, 99 inscribed, 100 lethal, -1 unknown.

    The stamp is that of the last scan in it: who reads it can tell how old it is.
    """
    message = OccupancyGrid()
    message.header.frame_id, message.header.stamp = MAP, stamp_of(field.time)
    message.info.map_load_time = message.header.stamp
    message.info.resolution = float(field.resolution)
    message.info.height, message.info.width = field.cells.shape
    message.info.origin = pose_to_msg(np.array([*field.origin, 0.0]))
    message.data = array("b", TOLD[field.cells].tobytes())
    return message


def field_from_msg(message: OccupancyGrid) -> CostField:
    """Return a costmap that was published as `field_to_msg` or Nav2 does.

    Raises:
        PlannerError: it is in another frame, or turned in it, or has another number of cells than it says.
    """
    if message.header.frame_id != MAP:
        raise PlannerError(f"costmap: expected it in frame {MAP!r}, got {message.header.frame_id!r}")
    x, y, yaw = planar_pose(message.info.origin, "origin of the costmap")
    if abs(yaw) > 1e-6:
        raise PlannerError(f"costmap: expected its axes along the frame's, got it turned by {yaw:.3g} rad")
    resolution = resolution_of(message)
    if not 1e-4 < resolution < 100.0:
        raise PlannerError(f"costmap: expected a resolution from 0.0001 to 100 m, got {resolution}")
    cells = HEARD[_cells(message).view(np.uint8)]
    time = seconds(message.header.stamp)
    return CostField(cells, resolution, (float(x), float(y)), time if time > 0.0 else -math.inf)


def path_to_msg(poses: Array, time: float) -> CartPath:
    """Return poses (n, 4) in `map`, headings and articulations [rad], as a path."""
    stamp = stamp_of(time)
    path = PathMsg()
    path.header.frame_id, path.header.stamp = MAP, stamp
    path.poses = [PoseStamped(header=path.header, pose=pose_to_msg(pose)) for pose in poses]
    return CartPath(path=path, articulation=array("d", [float(pose[3]) for pose in poses]))


def path_from_msg(message: CartPath) -> Array:
    """Return a path's poses (n, 4) in `map`, headings without jumps.

    Raises:
        PlannerError: it is in another frame, empty, or lengths differ.
    """
    frame, count = message.path.header.frame_id, len(message.path.poses)
    if frame != MAP:
        raise PlannerError(f"path: expected it in frame {MAP!r}, got {frame!r}")
    if count == 0 or count != len(message.articulation):
        raise PlannerError(f"path: expected an articulation for each pose, got {len(message.articulation)} for {count}")
    poses = np.array([planar_pose(each.pose, "path") for each in message.path.poses])
    poses[:, 2] = np.unwrap(poses[:, 2])
    return np.column_stack((poses, np.array(message.articulation, dtype=float)))


def _cells(message: OccupancyGrid) -> NDArray[np.int8]:
    rows, columns = message.info.height, message.info.width
    data = np.frombuffer(bytes(message.data), dtype=np.int8)
    if not rows * columns == len(data) > 0:
        raise PlannerError(f"map: expected {columns} by {rows} cells, one at least, got {len(data)}")
    return data.reshape(rows, columns)


def _told() -> NDArray[np.int8]:
    costs = np.arange(256)
    told = 1 + 97 * (costs - 1) // (INSCRIBED - 2)
    told[0], told[INSCRIBED], told[LETHAL], told[UNKNOWN] = 0, 99, 100, -1
    return told.astype(np.int8)


def _heard() -> NDArray[np.uint8]:
    """By the byte of a cell: what is told of it as a cost again, the least that is told so; strange ones: unknown."""
    heard = np.full(256, UNKNOWN)
    told = _told()
    for cost in range(UNKNOWN, -1, -1):
        heard[int(told[cost]) & 255] = cost
    return heard.astype(np.uint8)


TOLD, HEARD = _told(), _heard()
