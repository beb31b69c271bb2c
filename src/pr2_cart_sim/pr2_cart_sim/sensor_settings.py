"""What the PR2 senses with: lasers, odometry, localisation, a view of the cart; all with their faults."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from bullet_sim.scene import Sensors
from bullet_sim.settings import Coordinate, Fraction, NonNegative, Positive, Settings, Vector3

Rate = Annotated[float, Field(ge=0.1, le=200)]
BoardSource = Literal["noise", "rendered", "off"]
Angle = Annotated[float, Field(gt=0, le=math.pi)]


class LaserSettings(Settings):
    """A planar laser scanner; defaults are the Hokuyo UTM-30LX on the PR2's base.

    Attributes:
        rate: scans [Hz]; the sensor can do 40, the PR2's own software asks for 20. A scan is of one moment.
        half_angle: the first beam is at minus this, the last at this at most [rad]; 0 is straight ahead.
        increment: between two beams [rad].
        range_min: nearest that is seen [m].
        range_max: farthest that is seen [m]; beyond it a range is infinite.
        noise: white noise of a range [m].
        dropout: probability that one beam sees nothing.
        sees_robot: whether the robot's own links are in the way; else they are left out, as the PR2's filter does.
    """

    rate: Rate = 20.0
    half_angle: Angle = 2.2689
    increment: Annotated[float, Field(ge=1e-3, le=0.5)] = math.radians(0.25)
    range_min: Positive = 0.1
    range_max: Positive = 30.0
    noise: NonNegative = 0.01
    dropout: Fraction = 0.0
    sees_robot: bool = False

    @model_validator(mode="after")
    def _reaches(self) -> Self:
        if self.range_max <= self.range_min:
            raise ValueError(f"expected range_max beyond range_min {self.range_min} m, got {self.range_max} m")
        return self

    @property
    def beams(self) -> int:
        """How many beams a scan has."""
        return 2 * math.floor(self.half_angle / self.increment + 1e-9) + 1


class TiltLaserSettings(LaserSettings):
    """The same scanner on the torso, nodding.

    Attributes:
        low: lowest look, as an angle of its joint [rad]; positive is down.
        high: highest look [rad].
        period: of a nod down and up [s]; it goes at one speed, and turns at the ends.
    """

    half_angle: Angle = 0.829
    low: Annotated[float, Field(ge=-0.78, le=1.48)] = 1.05
    high: Annotated[float, Field(ge=-0.78, le=1.48)] = -0.40
    period: Annotated[float, Field(ge=0.5, le=100)] = 4.0

    @model_validator(mode="after")
    def _nods(self) -> Self:
        if self.low <= self.high:
            raise ValueError(f"expected low above high (it is an angle downwards), got {self.low} and {self.high}")
        return self


class OdometrySettings(Settings):
    """Dead reckoning from the wheels; how far off is an estimate.

    Attributes:
        rate: [Hz].
        scale: error of the distance, drawn once a run, as a share: standard deviation.
        turn_scale: the same of the turn.
        noise: standard deviation of the position per square root of the way [m / sqrt(m)].
        turn_noise: of the heading, per square root of the turn [rad / sqrt(rad)].
    """

    rate: Rate = 50.0
    scale: NonNegative = 0.01
    turn_scale: NonNegative = 0.015
    noise: NonNegative = 0.004
    turn_noise: NonNegative = 0.006


class LocalisationSettings(Settings):
    """Where the robot is told to be in the map, in place of a localiser that matches scans; an estimate for one.

    Attributes:
        rate: [Hz].
        sigma_xy: white noise [m].
        sigma_yaw: white noise [rad].
        bias: amplitude of the smooth error over the floor [m].
        bias_length: way [m] over which that error changes.
        latency: from measurement to publication [s].
    """

    rate: Rate = 10.0
    sigma_xy: NonNegative = 0.01
    sigma_yaw: NonNegative = 0.005
    bias: NonNegative = 0.03
    bias_length: Positive = 3.0
    latency: Annotated[float, Field(ge=0, le=2)] = 0.05


class BoardSettings(Settings):
    """A checkerboard on the cart, seen by the camera in the head.

    Attributes:
        source: `noise`: the cart's pose with the errors below; `rendered`: found in a picture of it, which has errors
            enough: nothing is to be said of `sigma_xy`, `sigma_yaw`, `bias_yaw` and `dropout`; `off`: no board.
        rate: [Hz].
        sigma_xy: white noise of the cart's place in `base` [m].
        sigma_yaw: white noise of its heading [rad].
        bias: bound of the place's error from calibration, drawn once a run [m].
        bias_yaw: the same of the heading [rad].
        latency: from picture to publication [s].
        dropout: probability that the board is missed.
        columns: inner corners along the board's x.
        rows: inner corners along its y.
        square: side [m].
        position: (3,) [m] of its middle in the cart's frame, which is in the middle of its top.
        tilt: by how much it leans away from the robot, 0 is upright [rad].
        width: of the picture [px].
        lines: its height [px].
        field_of_view: of the lens along the width [rad].
        pixel_noise: white noise of a pixel, standard deviation in grey levels of 256.
    """

    source: BoardSource = "noise"
    rate: Rate = 10.0
    sigma_xy: NonNegative = 0.006
    sigma_yaw: NonNegative = 0.015
    bias: NonNegative = 0.01
    bias_yaw: NonNegative = 0.01
    latency: Annotated[float, Field(ge=0, le=2)] = 0.1
    dropout: Fraction = 0.05
    columns: Annotated[int, Field(ge=3, le=20)] = 7
    rows: Annotated[int, Field(ge=3, le=20)] = 5
    square: Annotated[float, Field(gt=0, le=0.2)] = 0.035
    position: Vector3 = (-0.10, 0.0, 0.10)
    tilt: Annotated[float, Field(ge=0, le=1.2)] = 0.6
    width: Annotated[int, Field(ge=64, le=4096)] = 640
    lines: Annotated[int, Field(ge=64, le=4096)] = 480
    field_of_view: Annotated[float, Field(ge=0.2, le=2.4)] = 1.05
    pixel_noise: NonNegative = 2.0

    @model_validator(mode="after")
    def _says_what_counts(self) -> Self:
        more = sorted(self.model_fields_set & {"sigma_xy", "sigma_yaw", "bias_yaw", "dropout"})
        if self.source == "rendered" and more:
            raise ValueError(
                f"expected no {more[0]} where the board is rendered: errors come from the pictures; leave it out"
            )
        return self


class Pr2Sensors(Sensors):
    """All senses of the PR2; `tags` and `cameras` of other scenes are not used here.

    Attributes:
        proprioception_bias: bound [m] of the error of a hand's place by its joints, drawn once a run for each.
    """

    base_laser: LaserSettings = LaserSettings()
    tilt_laser: TiltLaserSettings = TiltLaserSettings()
    odometry: OdometrySettings = OdometrySettings()
    localisation: LocalisationSettings = LocalisationSettings()
    checkerboard: BoardSettings = BoardSettings()
    proprioception_bias: Annotated[Coordinate, Field(ge=0, le=0.1)] = 0.002
