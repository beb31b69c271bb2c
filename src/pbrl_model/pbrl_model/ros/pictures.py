"""Pictures and calibrations from sensor_msgs; no node needed."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Transform
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image

from pbrl_model.errors import ModelError
from pbrl_model.tags.calibration import CameraCalibration, calibration

LENSES = ("plumb_bob", "rational_polynomial", "")
"""Models of lenses that are OpenCV's own; empty: none is said, so there may be no coefficients."""

TO_GREY = {
    "mono8": None,
    "8UC1": None,
    "rgb8": cv2.COLOR_RGB2GRAY,
    "bgr8": cv2.COLOR_BGR2GRAY,
    "rgba8": cv2.COLOR_RGBA2GRAY,
    "bgra8": cv2.COLOR_BGRA2GRAY,
    "bayer_rggb8": cv2.COLOR_BayerBG2GRAY,  # OpenCV names a pattern after its second line
    "bayer_bggr8": cv2.COLOR_BayerRG2GRAY,
    "bayer_gbrg8": cv2.COLOR_BayerGR2GRAY,
    "bayer_grbg8": cv2.COLOR_BayerGB2GRAY,
}
CHANNELS = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4}


def grey_image(message: Image) -> NDArray[np.uint8]:
    """Return a picture's grey levels (height, width).

    Raises:
        ModelError: an encoding that is not among `TO_GREY`, or too few bytes.
    """
    if message.encoding not in TO_GREY:
        raise ModelError(f"picture: expected an encoding of {', '.join(TO_GREY)}, got {message.encoding!r}")
    channels = CHANNELS.get(message.encoding, 1)
    data = np.frombuffer(bytes(message.data), dtype=np.uint8)
    row = message.width * channels
    if message.step < row or len(data) < message.step * message.height or not row or not message.height:
        raise ModelError(
            f"picture: expected {message.height} lines of {message.step} >= {row} bytes, got {len(data)} bytes"
        )
    lines = data[: message.step * message.height].reshape(message.height, message.step)[:, :row]
    conversion = TO_GREY[message.encoding]
    if conversion is None:
        return np.ascontiguousarray(lines)
    pixels = lines.reshape(message.height, message.width, channels) if channels > 1 else lines
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels), conversion), dtype=np.uint8)


def calibration_from_msgs(name: str, info: CameraInfo, place: Transform) -> CameraCalibration:
    """Return a camera's calibration.

    Args:
        name: of the camera, for messages.
        info: its lens.
        place: of its optical frame in `world`.

    Raises:
        ModelError: a model of the lens that is not OpenCV's, or a camera that was never calibrated.
    """
    if info.distortion_model not in LENSES:
        raise ModelError(
            f"camera {name}: expected distortion model plumb_bob or rational_polynomial, got {info.distortion_model!r}"
        )
    where, turn = place.translation, place.rotation
    return calibration(
        name,
        (info.width, info.height),
        np.array(info.k),
        np.array(info.d),
        (where.x, where.y, where.z),
        (turn.x, turn.y, turn.z, turn.w),
    )


def seconds(stamp: Time | Any) -> float:
    """Return a stamp in seconds."""
    return float(stamp.sec + 1e-9 * stamp.nanosec)
