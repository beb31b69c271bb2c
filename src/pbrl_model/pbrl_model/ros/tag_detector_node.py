"""Finds tags in the pictures of overhead cameras and publishes where what wears them is.

It is no part of the simulators: on a robot it hears real cameras (any driver that publishes `image_raw` and
`camera_info`, with their places in `/tf_static`). It stands here because what it does comes first of all sensing that
the model is learned from, and because the same library reads pictures out of recordings.
"""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PoseStamped, Quaternion
from pbrl_msgs.msg import Scene
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, Image
from tf2_msgs.msg import TFMessage

from pbrl_bag.errors import BagError
from pbrl_bag.geometry import bodies_of_scene
from pbrl_bag.ros.diagnostics import Diagnostics
from pbrl_bag.ros.parameters import declare, refuse_unknown
from pbrl_bag.ros.running import run_node
from pbrl_model.errors import ModelError
from pbrl_model.ros.pictures import calibration_from_msgs, grey_image, seconds
from pbrl_model.tags.calibration import CameraCalibration
from pbrl_model.tags.moments import MomentGrouper
from pbrl_model.tags.reader import BodyReading, Picture, TagReader
from pbrl_model.tags.sheet import load_tag_sheet, worn_tags

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
FRAMES = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TAGS = QoSProfile(depth=100)
SIX = ",".join(f"overhead_{number}" for number in range(6))
"""The cameras of the simulator."""


class TagDetectorNode(Node):
    """Hears `/camera/<name>/image_raw`, `camera_info`, `/tf_static` and `/scene`; publishes `/ar_tags/<body>/pose`.

    Raises:
        BagError: a wrong parameter.
        ModelError: a sheet of tags that cannot be used.
    """

    def __init__(self, context: Context | None = None, **options: Any):
        super().__init__("tag_detector_node", context=context, **options)
        cameras = declare(self, "cameras", SIX, "names, with commas: each on /camera/<name>/image_raw and camera_info")
        window = declare(self, "window", 0.01, "stamps that differ by less are of one moment [s]", (1e-4, 1.0))
        text = "ask again for lost parts of pictures; a camera that publishes with best effort is then not heard"
        reliable = declare(self, "reliable", False, text)
        sheet = declare(self, "sheet", "", "YAML file that says which tag is where; empty: config/params/tags.yaml")
        refuse_unknown(self)
        self._sheet = load_tag_sheet(Path(sheet) if sheet else _sheet_of_the_workspace())
        self._reader = TagReader(self._sheet.dictionary, worn_tags(self._sheet, ()))
        names = [name.strip() for name in cameras.split(",") if name.strip()]
        self._moments: MomentGrouper[Picture] = MomentGrouper(names, window)
        self._info: dict[str, CameraInfo] = {}
        self._places: dict[str, Any] = {}
        self._cameras: dict[str, CameraCalibration] = {}
        self._outputs: dict[str, Any] = {}
        self._found = 0
        self._diagnostics = Diagnostics(self, numbers=lambda: {"bodies found": self._found})
        hear = self._diagnostics.subscribe
        hear(Scene, "scene", self._on_scene, LATCHED, refuses=(BagError,))
        hear(TFMessage, "/tf_static", self._on_frames, FRAMES)
        reliability = ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
        pictures = QoSProfile(depth=2, reliability=reliability)  # a late picture is of no use
        for name in names:
            topic = f"camera/{name}"
            hear(CameraInfo, f"{topic}/camera_info", partial(self._on_info, name), pictures)
            hear(Image, f"{topic}/image_raw", partial(self._on_image, name), pictures)

    def _on_scene(self, message: Scene) -> None:
        bodies = [name for name, body in bodies_of_scene("/scene", message).items() if body.movable]
        try:
            self._reader = TagReader(self._sheet.dictionary, worn_tags(self._sheet, bodies))
        except ModelError as error:
            self.get_logger().error(str(error))

    def _on_frames(self, message: TFMessage) -> None:
        for transform in message.transforms:
            if transform.header.frame_id == "world":
                self._places[transform.child_frame_id] = transform.transform
                self._cameras.clear()

    def _on_info(self, name: str, message: CameraInfo) -> None:
        old = self._info.get(name)
        if old is None or _of_another_camera(old, message):
            self._cameras.pop(name, None)
        self._info[name] = message

    def _on_image(self, name: str, message: Image) -> None:
        try:
            camera = self._camera(name)
            if camera is None:
                return
            picture = Picture(camera, grey_image(message))
            for stamp, pictures in self._moments.add(name, seconds(message.header.stamp), picture):
                self._publish(stamp, self._reader.read(pictures))
        except ModelError as error:
            self.get_logger().error(f"/camera/{name}: {error}", throttle_duration_sec=5.0)

    def _camera(self, name: str) -> CameraCalibration | None:
        """Return a camera's calibration; None until both its parts have come."""
        if name not in self._cameras:
            info = self._info.get(name)
            place = self._places.get(info.header.frame_id) if info is not None else None
            if info is None or place is None:
                missing = "camera_info" if info is None else f"{info.header.frame_id} under world in /tf_static"
                self.get_logger().warning(f"/camera/{name}: waits for {missing}", throttle_duration_sec=5.0)
                return None
            self._cameras[name] = calibration_from_msgs(name, info, place)
        return self._cameras[name]

    def _publish(self, stamp: float, readings: list[BodyReading]) -> None:
        self._found = len(readings)
        for reading in readings:
            if reading.name not in self._outputs:
                self._outputs[reading.name] = self.create_publisher(PoseStamped, f"ar_tags/{reading.name}/pose", TAGS)
            message = PoseStamped()
            message.header.frame_id = "world"
            message.header.stamp = _stamp(stamp)
            x, y, z = reading.position.tolist()
            message.pose.position = Point(x=x, y=y, z=z)
            x, y, z, w = reading.quaternion.tolist()
            message.pose.orientation = Quaternion(x=x, y=y, z=z, w=w)
            self._outputs[reading.name].publish(message)


def _of_another_camera(one: CameraInfo, other: CameraInfo) -> bool:
    """Tell whether a camera was exchanged, or takes pictures of another size now."""
    first, second = ((info.header.frame_id, info.height, info.width, info.k.tolist()) for info in (one, other))
    return first != second


def _stamp(time: float) -> Time:
    nanoseconds = round(time * 1e9)
    return Time(sec=math.floor(nanoseconds / 1e9), nanosec=nanoseconds % 1_000_000_000)


def _sheet_of_the_workspace() -> Path:
    try:
        return Path(get_package_share_directory("pbrl_config")) / "params" / "tags.yaml"
    except PackageNotFoundError as error:
        raise ModelError("sheet: expected the package pbrl_config, found none; build it, or give a file") from error


def main() -> None:
    """Run the node until it is told to stop; errors at start are one line and exit code 2."""
    run_node("tag_detector_node", TagDetectorNode, (ModelError,))


if __name__ == "__main__":
    main()
