"""How many overhead cameras a room has, and of what make."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from bullet_sim.settings import NonNegative, Positive, Settings

Pixels = Annotated[int, Field(ge=64, le=8192)]
Rows = Annotated[int, Field(ge=1, le=8)]
Lens = Annotated[float, Field(ge=-1, le=1)]


class CameraSettings(Settings):
    """The cameras of a room and how they are rendered; all of one make.

    Attributes:
        grid: how many hang along the room's longer side and along its shorter one.
        height: over the floor [m].
        width: of a picture [px].
        lines: its height [px].
        field_of_view: of the lens along the width, without its distortion [rad].
        distortion: OpenCV's k1, k2, p1, p2, k3.
        noise: white noise of a pixel, standard deviation in grey levels of 256.
        blur: of lens and sensor, standard deviation [px].
        calibration_position: by how much a camera hangs elsewhere than its calibration says, standard deviation of each
            axis [m].
        calibration_angle: by how much it looks elsewhere, standard deviation about each axis [rad].
        oversampling: rays along each side of a pixel.
        whole: render whole pictures; else only around tags, on the bare floor, which is ten times as fast.
    """

    grid: tuple[Rows, Rows] = (3, 2)
    height: Positive = 2.8
    width: Pixels = 1280
    lines: Pixels = 960
    field_of_view: Annotated[float, Field(ge=0.2, le=2.4)] = math.pi / 2
    distortion: tuple[Lens, Lens, Lens, Lens, Lens] = (-0.10, 0.012, 0.0, 0.0, 0.0)
    noise: NonNegative = 2.0
    blur: Annotated[float, Field(ge=0, le=5)] = 0.6
    calibration_position: NonNegative = 0.001
    calibration_angle: NonNegative = 0.0005
    oversampling: Annotated[int, Field(ge=1, le=4)] = 2
    whole: bool = False
