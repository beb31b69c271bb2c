"""The node that finds tags: every encoding, and pictures in, poses out, through the middleware."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator

import cv2
import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Point, PoseStamped, Quaternion, Transform, TransformStamped, Vector3
from pbrl_msgs.msg import Body, Scene
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import CameraInfo, Image
from tf2_msgs.msg import TFMessage

from pbrl_bag.errors import BagError
from pbrl_model.errors import ModelError
from pbrl_model.ros.pictures import CHANNELS, TO_GREY, calibration_from_msgs, grey_image
from pbrl_model.ros.tag_detector_node import TagDetectorNode

PATIENCE = 20.0  # [s]
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
HEIGHT, FOCAL, SIDE = 2.8, 500.0, 0.2
DOWN = Transform(translation=Vector3(z=HEIGHT), rotation=Quaternion(x=1.0, w=0.0))
K = [FOCAL, 0.0, 319.5, 0.0, FOCAL, 239.5, 0.0, 0.0, 1.0]


def over_the_wire(message: CameraInfo) -> CameraInfo:
    """What a subscriber gets."""
    return deserialize_message(serialize_message(message), CameraInfo)


def picture() -> np.ndarray:
    """A table's tag right below the camera, 0.8 m over the floor, its upper edge away from the picture's."""
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    size = round(FOCAL * SIDE / (HEIGHT - 0.8) / 8) * 8
    image = np.full((480, 640), 200, np.uint8)
    image[240 - size : 240 + size, 320 - size : 320 + size] = 255
    half = size // 2
    image[240 - half : 240 + half, 320 - half : 320 + half] = cv2.aruco.generateImageMarker(family, 0, size)
    return image


def image_message(image: np.ndarray, encoding: str, step: int | None = None) -> Image:
    row = image.shape[1] * CHANNELS.get(encoding, 1)
    padded = np.zeros((image.shape[0], step or row), np.uint8)
    padded[:, :row] = image.reshape(image.shape[0], -1)
    return Image(
        height=image.shape[0], width=image.shape[1], encoding=encoding, step=padded.shape[1], data=padded.tobytes()
    )


@pytest.mark.parametrize("encoding", TO_GREY)
def test_grey_stays_the_grey_it_is_in_every_encoding(encoding):
    grey = np.full((8, 10), 137, np.uint8)
    channels = CHANNELS.get(encoding, 1)
    image = np.repeat(grey[..., None], channels, axis=2) if channels > 1 else grey
    np.testing.assert_allclose(grey_image(image_message(image, encoding, 64)), grey, atol=1)


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (image_message(np.zeros((4, 4), np.uint8), "yuv422"), "got 'yuv422'"),
        (Image(height=4, width=4, encoding="mono8", step=4, data=bytes(15)), "got 15 bytes"),
        (Image(height=4, width=4, encoding="mono8", step=3, data=bytes(16)), "3 >= 4"),
        (Image(encoding="mono8"), "expected 0 lines"),
    ],
)
def test_a_picture_that_cannot_be_read_is_refused(message, words):
    with pytest.raises(ModelError, match=words):
        grey_image(message)


def test_a_lens_that_opencv_does_not_model_is_refused():
    info = CameraInfo(width=640, height=480, k=K, distortion_model="equidistant", d=[0.0] * 4)
    with pytest.raises(ModelError, match=r"camera 2: expected distortion model .* got 'equidistant'"):
        calibration_from_msgs("2", info, DOWN)


@pytest.fixture
def context(domain: int) -> Iterator[Context]:
    made = Context()
    rclpy.init(context=made, domain_id=domain)
    yield made
    made.try_shutdown()


def test_a_wrong_parameter_is_refused(context):
    with pytest.raises(BagError, match="cameras"):
        TagDetectorNode(context, parameter_overrides=[Parameter("cameras", Parameter.Type.INTEGER, 6)])
    with pytest.raises(ModelError, match="expected cameras"):
        TagDetectorNode(context, parameter_overrides=[Parameter("cameras", Parameter.Type.STRING, " , ")])


def test_pictures_in_poses_out(context):
    node = TagDetectorNode(context, parameter_overrides=[Parameter("cameras", Parameter.Type.STRING, "overhead_0")])
    client = Node("camera", context=context)
    spinner = SingleThreadedExecutor(context=context)
    spinner.add_node(node)
    mine = SingleThreadedExecutor(context=context)
    mine.add_node(client)

    def spin() -> None:
        with contextlib.suppress(ExternalShutdownException):
            spinner.spin()

    thread = threading.Thread(target=spin, daemon=True)
    thread.start()
    heard: list[PoseStamped] = []
    client.create_subscription(PoseStamped, "/ar_tags/desk/pose", heard.append, 10)
    scene = client.create_publisher(Scene, "/scene", LATCHED)
    frames = client.create_publisher(TFMessage, "/tf_static", LATCHED)
    info = client.create_publisher(CameraInfo, "/camera/overhead_0/camera_info", 2)
    image = client.create_publisher(Image, "/camera/overhead_0/image_raw", 2)
    outline = [Point(x=x, y=y) for x, y in ((0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2))]
    bodies = [Body(name="pillar", footprint=outline), Body(name="desk", footprint=outline, movable=True)]
    scene.publish(Scene(bodies=bodies))
    place = TransformStamped(child_frame_id="overhead_0", transform=DOWN)
    place.header.frame_id = "world"
    frames.publish(TFMessage(transforms=[place]))
    lens = CameraInfo(width=640, height=480, k=K, d=[0.0] * 5, distortion_model="plumb_bob")
    shot = image_message(picture(), "mono8")
    deadline, tick = time.monotonic() + PATIENCE, 0
    try:
        while not heard:
            assert time.monotonic() < deadline, "no pose came"
            tick += 1
            for message in (lens, shot):
                message.header.frame_id, message.header.stamp.sec = "overhead_0", tick
            info.publish(lens)
            image.publish(shot)
            mine.spin_once(timeout_sec=0.05)
    finally:
        spinner.shutdown()
        thread.join()
        node.destroy_node()
        client.destroy_node()
    pose, header = heard[0].pose, heard[0].header
    assert header.frame_id == "world" and 1 <= header.stamp.sec <= tick
    size = round(FOCAL * SIDE / (HEIGHT - 0.8) / 8) * 8
    place_of_tag = np.array([pose.position.x, pose.position.y, pose.position.z])
    # The plate is 2 mm thick, and what was drawn is a whole number of pixels.
    np.testing.assert_allclose(place_of_tag, [0.0, 0.0, HEIGHT - FOCAL * SIDE / size - 0.002], atol=0.006)
    assert abs(pose.orientation.w) == pytest.approx(1.0, abs=1e-3)


def test_a_camera_whose_pictures_are_of_another_size_takes_none_of_the_others(context):
    names = Parameter("cameras", Parameter.Type.STRING, "overhead_0,overhead_1")
    node = TagDetectorNode(context, parameter_overrides=[names])
    outline = [Point(x=x, y=y) for x, y in ((0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2))]
    node._on_scene(Scene(bodies=[Body(name="desk", footprint=outline, movable=True)]))
    place = TransformStamped(child_frame_id="overhead", transform=DOWN)
    place.header.frame_id = "world"
    node._on_frames(TFMessage(transforms=[place]))
    lens = CameraInfo(width=640, height=480, k=K, d=[0.0] * 5, distortion_model="plumb_bob")
    lens.header.frame_id = "overhead"
    shot, half = image_message(picture(), "mono8"), image_message(picture()[::2, ::2].copy(), "mono8")
    for name in ("overhead_0", "overhead_1"):
        node._on_info(name, over_the_wire(lens))
    for tick in range(1, 5):
        shot.header.stamp.sec = half.header.stamp.sec = tick
        node._on_image("overhead_1", half)
        node._on_image("overhead_0", shot)
    assert node._found == 1
    # The camera says so by now, and its next picture is read.
    lens.height, lens.width = half.height, half.width
    node._on_info("overhead_1", over_the_wire(lens))
    assert node._camera("overhead_1").height == 240
    node.destroy_node()
