"""What a node hears of a desk: its items, its arm, and where the items are, in pictures or as poses."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from geometry_msgs.msg import PoseStamped, Transform
from pbrl_msgs.msg import Body, Scene
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from pbrl_bag.errors import BagError
from pbrl_bag.geometry import bodies_of_scene
from pbrl_bag.liveness import Liveness
from pbrl_bag.ros.diagnostics import Diagnostics
from pbrl_control.ball_arm import JOINTS, BallArm, Strokes
from pbrl_control.errors import ControlError
from pbrl_control.planar import Array
from pbrl_control.ros.conversions import seconds
from pbrl_control.ros.qos import LATCHED, NEWEST
from pbrl_model.errors import ModelError
from pbrl_model.ros.pictures import calibration_from_msgs, grey_image
from pbrl_planner.errors import PlannerError
from pbrl_planner.ros.conversions import planar_pose, transform_from_msg
from pbrl_planner.tabletop import Desk, Item, ItemFinder, Table, TallItem
from pbrl_planner.tabletop.desk import REACH_MARGIN

FRAMES = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PICTURES = QoSProfile(depth=2, reliability=ReliabilityPolicy.BEST_EFFORT)
WORLD, BASE = "world", "arm_base"
POSES_WITHIN = 0.3
"""[s] in which the poses of all items have to come to count as one look."""
SILENT = 2.0
"""Without the arm's joints for so long [s] nothing is moved any more."""
SAID = 5.0
"""[s] between two warnings of the same kind."""

Look = Callable[[float, Mapping[str, Array]], None]


class DeskHearing:
    """Subscribes, and keeps what is known.

    Args:
        node: that hears.
        diagnostics: of the node.
        camera: name of the overhead camera; empty: poses are heard on `/ar_tags/<item>/pose`.
        look: is called with the time of a look and the poses (3,) of the items that were found, by name.

    Attributes:
        joints: (4,) where the arm is [rad]; None: not heard yet.
        live: whether the arm is still heard; asked at every tick of the node.
    """

    def __init__(self, node: Node, diagnostics: Diagnostics, camera: str, look: Look) -> None:
        self._node, self._camera, self._look = node, camera, look
        self.joints: Array | None = None
        self.live = Liveness(("/joint_states",), SILENT)
        self._description: str | None = None
        self._scene: Scene | None = None
        self._places: dict[str, Transform] = {}
        self._info: CameraInfo | None = None
        self._arm: Strokes | None = None
        self._desk: Desk | None = None
        self._finder: ItemFinder | None = None
        self._seen: dict[str, Array] = {}
        self._stamps: dict[str, float] = {}
        self._tag_topics: set[str] = set()
        hear = self._subscribe = diagnostics.subscribe
        hear(String, "robot_description", self._on_description, LATCHED)
        hear(Scene, "scene", self._on_scene, LATCHED, refuses=(BagError,))
        hear(TFMessage, "/tf_static", self._on_frames, FRAMES)
        hear(JointState, "joint_states", self._on_joints, NEWEST)
        if camera:
            hear(CameraInfo, f"camera/{camera}/camera_info", self._on_info, PICTURES)
            hear(Image, f"camera/{camera}/image_raw", self._on_image, PICTURES)

    def missing(self) -> str:
        """Return what was not heard yet, in words; empty where everything was."""
        heard = (
            ("/robot_description", self._description is not None),
            ("/scene", self._scene is not None),
            (f"{BASE} in {WORLD} on /tf_static", BASE in self._places),
            ("/joint_states", self.joints is not None),
        )
        return ", ".join(what for what, is_there in heard if not is_there)

    def arm(self) -> Strokes:
        """Return the arm.

        Raises:
            PlannerError: it is not known yet, or the description is not of such an arm.
        """
        if self._arm is None:
            if self._description is None or BASE not in self._places:
                raise PlannerError(f"not heard yet: {self.missing()}")
            try:
                place = transform_from_msg(self._places[BASE])
                base = np.array([place[0, 3], place[1, 3], math.atan2(place[1, 0], place[0, 0])])
                self._arm = Strokes(BallArm(self._description, base))
            except ControlError as error:
                raise PlannerError(str(error)) from error
        return self._arm

    def desk(self) -> Desk:
        """Return table, items, obstacles and reach.

        Raises:
            PlannerError: they are not known yet, or the scene is no desk.
        """
        if self._desk is None:
            if self._scene is None:
                raise PlannerError(f"not heard yet: {self.missing()}")
            strokes = self.arm()
            near, far = strokes.arm.reach(strokes.settings.low)
            x, y = strokes.arm.base[:2].tolist()
            self._desk = desk_from_msg(self._scene, (x, y, near + REACH_MARGIN, far - REACH_MARGIN))
        return self._desk

    def _on_description(self, message: String) -> None:
        self._description, self._arm, self._desk = message.data, None, None

    def _on_scene(self, message: Scene) -> None:
        bodies_of_scene("/scene", message)  # raises where it is none
        self._scene, self._desk, self._finder = message, None, None
        self._seen, self._stamps = {}, {}
        if not self._camera:
            for body in message.bodies:
                topic = f"ar_tags/{body.name}/pose"
                if body.movable and topic not in self._tag_topics:
                    self._tag_topics.add(topic)
                    self._subscribe(PoseStamped, topic, partial(self._on_pose, body.name), PICTURES)

    def _on_frames(self, message: TFMessage) -> None:
        for transform in message.transforms:
            if transform.header.frame_id == WORLD:
                self._places[transform.child_frame_id] = transform.transform
        self._arm, self._desk = None, None

    def _on_joints(self, message: JointState) -> None:
        table = dict(zip(message.name, message.position, strict=False))
        if all(name in table for name in JOINTS):
            now = self._node.get_clock().now().nanoseconds * 1e-9
            if self.joints is None:
                self.live.begin(now)
            self.live.heard("/joint_states", now)
            self.joints = np.array([table[name] for name in JOINTS])

    def _on_info(self, message: CameraInfo) -> None:
        self._info = message

    def _on_image(self, message: Image) -> None:
        try:
            found = self._find(message)
        except (ModelError, PlannerError) as error:
            self._node.get_logger().warning(f"/camera/{self._camera}: {error}", throttle_duration_sec=SAID)
            return
        if found is not None:
            self._look(seconds(message.header.stamp), found)

    def _find(self, message: Image) -> Mapping[str, Array] | None:
        """Return where items are in a picture; None: the camera is not known yet."""
        if self._info is None or self._scene is None or self._info.header.frame_id not in self._places:
            return None
        camera = calibration_from_msgs(self._camera, self._info, self._places[self._info.header.frame_id])
        if self._finder is None:
            desk = self.desk()
            heights = {body.name: body.height for body in self._scene.bodies}
            tall = [TallItem(item, heights[item.name]) for item in desk.items]
            obstacles = [(TallItem(item, heights[item.name]), pose) for item, pose in desk.obstacles]
            self._finder = ItemFinder(desk.table, tall, obstacles)
        sight = self._finder.find(grey_image(message), camera, self._seen)
        self._seen.update(sight.poses)
        return sight.poses

    def _on_pose(self, name: str, message: PoseStamped) -> None:
        try:
            self._seen[name] = planar_pose(message.pose, f"/ar_tags/{name}/pose")
        except PlannerError as error:
            self._node.get_logger().warning(f"left aside: {error}", throttle_duration_sec=SAID)
            return
        stamp = self._stamps[name] = seconds(message.header.stamp)
        fresh = {each: pose for each, pose in self._seen.items() if self._stamps[each] > stamp - POSES_WITHIN}
        newest = {each for each in fresh if self._stamps[each] == stamp}
        if len(newest) == len(fresh):  # the last of a moment's poses
            self._look(stamp, fresh)


def desk_from_msg(message: Scene, reach: tuple[float, float, float, float]) -> Desk:
    """Return the desk that a scene describes: its room is the table, what is not movable are obstacles.

    Raises:
        PlannerError: there is no table, or a body is not a box whose longer side is along x.
    """
    corners = np.array([[point.x, point.y] for point in message.room])
    if corners.shape != (4, 2):
        raise PlannerError(f"/scene: expected a table with 4 corners as its room, got {len(message.room)}")
    items = [(body, item_from_msg(body)) for body in message.bodies]
    fixed = tuple(
        (item, np.array([body.pose.x, body.pose.y, body.pose.theta])) for body, item in items if not body.movable
    )
    table = Table(corners.min(axis=0), corners.max(axis=0))
    return Desk(table, tuple(item for body, item in items if body.movable), fixed, reach=reach)


def item_from_msg(body: Body) -> Item:
    """Return an item from what is known of it.

    Raises:
        PlannerError: its outline is not that of a box about its frame.
    """
    corners = np.array([[point.x, point.y] for point in body.footprint]).reshape(-1, 2)
    low, high = (corners.min(axis=0), corners.max(axis=0)) if len(corners) else (np.zeros(2), np.zeros(2))
    if len(corners) != 4 or not np.allclose(low, -high, atol=1e-6) or not math.isfinite(body.height):
        raise PlannerError(f"/scene: {body.name}: expected a box about its frame, got {corners.tolist()}")
    length, width = (high - low).tolist()
    return Item(body.name, length, width)
