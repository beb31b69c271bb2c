"""Sensor-side faults: the force sensor drifts or is mounted askew, a stream comes late, a tag is glued on askew."""

from __future__ import annotations

import math
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from bullet_sim.client import Pose, multiply, yaw_quaternion
from bullet_sim.concealed.effect import Effect
from bullet_sim.settings import NonNegative, Settings, Vector3

Array = NDArray[np.float64]

Moment = Annotated[float, Field(ge=0, le=3600)]
Angle = Annotated[float, Field(ge=-7, le=7)]


class WrenchBiasSettings(Settings):
    """An offset that was not there when the sensor was read before the grasp: warming up, a cable that pulls.

    Attributes:
        force: (3,) [N] in the sensor's axes, once it is all there.
        torque: (3,) [N m], as `force`.
        start: when it begins [s].
        rise: how long it takes to be all there [s]; 0: at once.
        force_drift: (3,) [N/s] from `start` on without end.
        torque_drift: (3,) [N m/s], as `force_drift`.
    """

    force: Vector3 = (0.0, 0.0, 0.0)
    torque: Vector3 = (0.0, 0.0, 0.0)
    start: Moment = 0.0
    rise: NonNegative = 0.0
    force_drift: Vector3 = (0.0, 0.0, 0.0)
    torque_drift: Vector3 = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _is_one(self) -> Self:
        if not any((*self.force, *self.torque, *self.force_drift, *self.torque_drift)):
            raise ValueError("expected an offset or a drift, got none; say force, torque, force_drift or torque_drift")
        return self

    def at(self, time: float) -> Array:
        """Give the offset (6,) at a time [s]: force [N], then torque [N m]."""
        since = time - self.start
        if since < 0:
            return np.zeros(6)
        share = min(1.0, since / self.rise) if self.rise > 0 else 1.0
        offset = np.array([*self.force, *self.torque])
        return share * offset + since * np.array([*self.force_drift, *self.torque_drift])


class WrenchFrameSettings(Settings):
    """A sensor that is mounted turned, or calibrated wrong.

    Attributes:
        scale: what it shows of a force, as a share.
        torque_scale: what it shows of a torque; default: as of a force.
        turn: (3,) rotation vector [rad] from the frame that is told to the sensor's own.
    """

    scale: Annotated[float, Field(gt=0, le=10)] = 1.0
    torque_scale: Annotated[float, Field(gt=0, le=10)] | None = None
    turn: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)

    @property
    def matrix(self) -> Array:
        """(6, 6) from the true wrench in the axes that are told to what the sensor feels."""
        angle = math.sqrt(sum(part * part for part in self.turn))
        x, y, z = (part / angle for part in self.turn) if angle > 0 else (0.0, 0.0, 1.0)
        skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        back = np.eye(3) - math.sin(angle) * skew + (1 - math.cos(angle)) * skew @ skew
        full = np.zeros((6, 6))
        full[:3, :3] = self.scale * back
        full[3:, 3:] = (self.scale if self.torque_scale is None else self.torque_scale) * back
        return full


class TimeOffsetSettings(Settings):
    """A stream whose stamps are late.

    Attributes:
        delay: [s]; readings are stamped, and come, so much later than they were taken.
    """

    delay: Annotated[float, Field(gt=0, le=2)]


class PoseBiasSettings(Settings):
    """A tag that is not where it is said to be.

    Attributes:
        offset: (x, y) [m] of the tag in the frame that it is told to mark.
        turn: of the tag about the vertical [rad].
    """

    offset: tuple[Annotated[float, Field(ge=-1, le=1)], Annotated[float, Field(ge=-1, le=1)]] = (0.0, 0.0)
    turn: Angle = 0.0

    def seen(self, pose: Pose) -> Pose:
        """Give where the tag is when the frame that it marks is at `pose`."""
        return Pose(pose.point([*self.offset, 0.0]), multiply(pose.quaternion, yaw_quaternion(self.turn)))


class SensorFault(Effect):
    """A fault of a sensor, for whoever scores; what makes it is in the sensor (`sensors.py`)."""

    def __init__(self, name: str, target: str, settings: Settings) -> None:
        """Take note of a fault."""
        super().__init__(target)
        self.name, self._settings, self._time = name, settings, 0.0
        self.unit = "s" if isinstance(settings, TimeOffsetSettings) else "1"

    def update(self, time: float) -> None:
        """Take note of the time [s]."""
        self._time = time

    def strength(self) -> float:
        """Give its size: of an offset now in N, of a wrong frame as a share, of a delay in s, of a bias in m or rad."""
        settings = self._settings
        if isinstance(settings, WrenchBiasSettings):
            offset = settings.at(self._time)
            return float(np.linalg.norm(offset[:3]) + np.linalg.norm(offset[3:]))
        if isinstance(settings, WrenchFrameSettings):
            return float(np.abs(settings.matrix - np.eye(6)).max())
        if isinstance(settings, PoseBiasSettings):
            return max(math.hypot(*settings.offset), abs(settings.turn))
        return settings.delay if isinstance(settings, TimeOffsetSettings) else 0.0
