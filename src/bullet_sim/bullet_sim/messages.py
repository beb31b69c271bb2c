"""Observations as ROS messages on their topics: the one place where both are known.

Used by the node, which publishes them, and by runs without middleware, which write them into a recording.
A simulator with observations of its own registers how they are translated: `@translate.register`.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable
from functools import lru_cache, singledispatch
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import (
    Point,
    Pose2D,
    PoseStamped,
    Quaternion,
    Transform,
    TransformStamped,
    Vector3,
    WrenchStamped,
)
from nav_msgs.msg import Odometry as OdometryMsg
from numpy.typing import NDArray
from pbrl_msgs.msg import Body, Grasp, Grasps, Scene
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import ColorRGBA, Header, String
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from bullet_sim.observations import (
    CameraPicture,
    ClockTick,
    GraspState,
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

Array = NDArray[np.float64]
Messages = list[tuple[str, Any]]

ODOMETRY_VARIANCE = 1e-3
"""Variance [m^2], [rad^2] given with odometry and, [(m/s)^2], [(rad/s)^2], with its twist: a few per cent of a push."""
UNOBSERVED = 1e6
"""Variance given for what odometry does not observe: height, roll, pitch."""


def to_messages(observation: Observation) -> Messages:
    """Translate one observation.

    Args:
        observation: what the session's step gave.

    Returns:
        Pairs of topic and message; header stamps are the observation's time.
    """
    return translate(observation)


def stamp(time: float) -> Time:
    """Make a stamp of `time` [s], rounded to the nanosecond."""
    sec, nanosec = divmod(round(time * 1e9), 1_000_000_000)
    return Time(sec=sec, nanosec=nanosec)


@singledispatch
def translate(observation: object) -> Messages:
    """Translate one observation; kinds are added with `translate.register`."""
    raise TypeError(f"expected an observation of a simulator, got {type(observation).__name__}")


@translate.register
def _(observation: ClockTick) -> Messages:
    return [("/clock", Clock(clock=stamp(observation.time)))]


@translate.register
def _(observation: JointStates) -> Messages:
    message = JointState(
        header=Header(stamp=stamp(observation.time)),
        name=list(observation.names),
        position=observation.position.tolist(),
        velocity=observation.velocity.tolist(),
    )
    return [("/joint_states", message)]


@translate.register
def _(observation: Odometry) -> Messages:
    message = OdometryMsg(header=Header(stamp=stamp(observation.time), frame_id="odom"), child_frame_id="base")
    x, y, theta = observation.pose.tolist()
    place = message.pose.pose
    place.position.x, place.position.y = x, y
    place.orientation = heading(theta)
    message.twist.twist.linear.x, message.twist.twist.angular.z = observation.twist.tolist()
    message.pose.covariance = message.twist.covariance = _odometry_covariance()
    return [("/odom", message)]


@lru_cache(maxsize=1)
def _odometry_covariance() -> Array:
    observed = [ODOMETRY_VARIANCE, ODOMETRY_VARIANCE, UNOBSERVED, UNOBSERVED, UNOBSERVED, ODOMETRY_VARIANCE]
    return np.diag(observed).ravel()


@translate.register
def _(observation: Transforms) -> Messages:
    when = stamp(observation.time)
    rows = zip(
        observation.parents,
        observation.children,
        observation.positions.tolist(),
        observation.quaternions.tolist(),
        strict=True,
    )
    transforms = [
        TransformStamped(
            header=Header(stamp=when, frame_id=parent),
            child_frame_id=child,
            transform=Transform(translation=_vector(position), rotation=_quaternion(quaternion)),
        )
        for parent, child, position, quaternion in rows
    ]
    return [("/tf_static" if observation.static else "/tf", TFMessage(transforms=transforms))]


@translate.register
def _(observation: RobotDescription) -> Messages:
    return [("/robot_description", String(data=observation.urdf))]


@translate.register
def _(observation: KnownScene) -> Messages:
    message = Scene(
        header=Header(stamp=stamp(observation.time), frame_id="world"),
        bodies=[_body(body) for body in observation.bodies],
        room=_points(observation.room),
    )
    return [("/scene", message)]


def _body(body: KnownBody) -> Body:
    x, y, theta = body.pose.tolist()
    return Body(
        name=body.name,
        footprint=_points(body.footprint),
        height=float(body.height),
        nominal_mass=float(body.nominal_mass),
        movable=body.movable,
        pose=Pose2D(x=x, y=y, theta=theta),
        casters=_points(body.casters),
    )


@translate.register
def _(observation: GraspState) -> Messages:
    grasps = [
        Grasp(gripper=hold.gripper, object=hold.object, contact_point=_point(hold.contact_point.tolist()))
        for hold in observation.holds
    ]
    return [("/grasps", Grasps(header=Header(stamp=stamp(observation.time)), grasps=grasps))]


@translate.register
def _(observation: WristReading) -> Messages:
    message = WrenchStamped(header=Header(stamp=stamp(observation.time), frame_id=f"{observation.side}_ft"))
    message.wrench.force = _vector(observation.force.tolist())
    message.wrench.torque = _vector(observation.torque.tolist())
    return [(f"/wrist_ft/{observation.side}", message)]


@translate.register
def _(observation: TagReading) -> Messages:
    message = PoseStamped(header=Header(stamp=stamp(observation.time), frame_id="world"))
    message.pose.position = _point(observation.position.tolist())
    message.pose.orientation = _quaternion(observation.quaternion.tolist())
    return [(f"/ar_tags/{observation.tag}/pose", message)]


@translate.register
def _(observation: CameraPicture) -> Messages:
    header = Header(stamp=stamp(observation.time), frame_id=observation.frame)
    lines, width = observation.image.shape
    image = Image(
        header=header,
        height=lines,
        width=width,
        encoding="mono8",
        step=width,
        data=array("B", observation.image.tobytes()),
    )
    k = observation.matrix
    info = CameraInfo(
        header=header,
        height=lines,
        width=width,
        distortion_model="plumb_bob",
        d=observation.distortion.tolist(),
        k=k.ravel().tolist(),
        r=np.eye(3).ravel().tolist(),
        p=np.column_stack([k, np.zeros(3)]).ravel().tolist(),
    )
    name = f"/camera/{observation.frame}"
    return [(f"{name}/camera_info", info), (f"{name}/image_raw", image)]


@translate.register
def _(observation: Outlines) -> Messages:
    header = Header(stamp=stamp(observation.time), frame_id="world")
    markers = [
        _outline(header, number, name, observation.bodies[name], pose)
        for number, (name, pose) in enumerate(sorted(observation.poses.items()))
    ]
    return [("/markers", MarkerArray(markers=markers))]


def _outline(header: Header, number: int, name: str, body: KnownBody, pose: Array) -> Marker:
    """Draw a body's outline as a closed line at the height of its tag."""
    marker = Marker(header=header, ns="bodies", id=number, type=Marker.LINE_STRIP, action=Marker.ADD, text=name)
    marker.pose.position = _point(pose[:3].tolist())
    marker.pose.orientation = _quaternion(pose[3:].tolist())
    marker.scale.x = 0.02
    marker.color = ColorRGBA(r=0.9375, g=0.5625, b=0.125, a=0.75)
    marker.points = _points(np.vstack([body.footprint, body.footprint[:1]]))
    return marker


def _points(outline: Array) -> list[Point]:
    return [Point(x=x, y=y) for x, y in outline.tolist()]


def _point(values: list[float]) -> Point:
    return Point(x=values[0], y=values[1], z=values[2])


def _vector(values: list[float]) -> Vector3:
    return Vector3(x=values[0], y=values[1], z=values[2])


def _quaternion(values: list[float]) -> Quaternion:
    return Quaternion(x=values[0], y=values[1], z=values[2], w=values[3])


def heading(theta: float) -> Quaternion:
    """Make the orientation of a turn by `theta` [rad] about the vertical."""
    return Quaternion(z=float(np.sin(theta / 2)), w=float(np.cos(theta / 2)))


LATCHED = ("/tf_static", "/robot_description", "/scene", "/grasps")
"""Topics whose last message late subscribers get too: transient local, depth 1."""


def message_types(bodies: tuple[str, ...], cameras: int = 0) -> dict[str, Callable[[], Any]]:
    """List every topic the simulator publishes and its message class.

    Args:
        bodies: names of the bodies that wear a tag.
        cameras: how many publish pictures; then somebody else finds the tags in them.
    """
    tags: dict[str, Callable[[], Any]] = {
        f"/ar_tags/{name}/pose": PoseStamped for name in (*bodies, "left_gripper", "right_gripper")
    }
    if cameras:
        tags = {f"/camera/overhead_{number}/image_raw": Image for number in range(cameras)}
        tags |= {f"/camera/overhead_{number}/camera_info": CameraInfo for number in range(cameras)}
    return {
        "/clock": Clock,
        "/joint_states": JointState,
        "/odom": OdometryMsg,
        "/tf": TFMessage,
        "/tf_static": TFMessage,
        "/robot_description": String,
        "/scene": Scene,
        "/grasps": Grasps,
        "/wrist_ft/left": WrenchStamped,
        "/wrist_ft/right": WrenchStamped,
        "/markers": MarkerArray,
        **tags,
    }
