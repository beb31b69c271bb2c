"""Sensors with their faults: an overhead camera that reads tags, and a force-torque sensor in a wrist.

Both take their randomness from a generator passed in, and both publish on their own clock: a reading belongs to
the first physics step at or after its moment.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from bullet_sim.client import Pose, multiply, yaw_quaternion
from bullet_sim.scene import TagSettings, WristSettings

Array = NDArray[np.float64]

WAVES = 24
"""Plane waves in the smooth error field; enough to look like a Gaussian field."""

SLACK = 1e-9
"""Time [s] by which a step may come early and still count as the moment; steps are sums of floats."""


class Ticker:
    """Says when something that happens at a fixed rate is due.

    Moments are k / rate, with no drift from rounding to physics steps.
    """

    def __init__(self, rate: float, *, phase: float = 0.0) -> None:
        """Start counting; `rate` [Hz], `phase` the fraction of a period before the first moment."""
        self._rate, self._phase, self._count = rate, phase, 0

    def due(self, time: float) -> bool:
        """Say whether a moment has come since the last one reported; call at every step with its time [s]."""
        if time + SLACK < (self._count + self._phase) / self._rate:
            return False
        self._count = math.floor((time + SLACK) * self._rate - self._phase) + 1
        return True


class BiasField:
    """A smooth error of position over the floor, as a badly calibrated camera has it.

    A sum of plane waves with random directions and phases, wave numbers drawn so that the field's correlation is a
    Gaussian of the given length; scaled so that its standard deviation per axis is half the amplitude, and bent
    softly into it, so that no error is larger.
    """

    def __init__(self, amplitude: float, length: float, rng: Generator) -> None:
        """Draw a field with errors up to `amplitude` [m] that change over `length` [m]."""
        self._amplitude = amplitude
        self._waves = rng.normal(0.0, 1.0 / length, (WAVES, 2))
        self._phases = rng.uniform(0.0, 2 * np.pi, WAVES)
        self._weights = rng.normal(0.0, 1.0, (2, WAVES)) * math.sqrt(2.0 / WAVES) * 0.5

    def at(self, place: Sequence[float] | Array) -> Array:
        """Give the error (2,) [m] at a place (2,) [m] on the floor."""
        waves = np.cos(self._waves @ np.asarray(place, dtype=float)[:2] + self._phases)
        return self._amplitude * np.tanh(self._weights @ waves)


@dataclass(frozen=True)
class TagReading:
    """One reading of one tag.

    Attributes:
        name: of the tag.
        stamp: when the picture was taken [s].
        position: (3,) [m] in `world`.
        quaternion: (4,) x y z w.
    """

    name: str
    stamp: float
    position: Array
    quaternion: Array


class TagCamera:
    """An overhead camera that reads every tag at its rate, a latency later, sometimes missing one."""

    def __init__(
        self,
        settings: TagSettings,
        rng: Generator,
        *,
        glued: Mapping[str, Callable[[Pose], Pose]] | None = None,
        delays: Mapping[str, float] | None = None,
    ) -> None:
        """Set up with a bias field drawn from `rng`, which is kept for the noise.

        Args:
            settings: what the camera is like.
            rng: draws field and noise.
            glued: where a tag really is when the frame that it marks is at a pose, by tag; default: there.
            delays: by how much readings of a tag are stamped, and come, later than they should [s], by tag.
        """
        self._settings, self._rng = settings, rng
        self._glued, self._delays = dict(glued or {}), dict(delays or {})
        self._field = BiasField(settings.bias, settings.bias_length, rng)
        self._ticker = Ticker(settings.rate)
        self._underway: list[tuple[float, TagReading]] = []

    @property
    def field(self) -> BiasField:
        """The camera's error over the floor, for scoring only."""
        return self._field

    def capture_due(self, time: float) -> bool:
        """Say whether a picture is taken at this step; if so, call `capture` with all tags."""
        return self._ticker.due(time)

    def capture(self, time: float, tags: Mapping[str, Pose]) -> None:
        """Take a picture.

        Args:
            time: now [s].
            tags: true pose of each tag by name; read in this order, which fixes the draws.
        """
        for name, pose in tags.items():
            delay = self._delays.get(name, 0.0)
            reading = self._read(name, time + delay, self._glued[name](pose) if name in self._glued else pose)
            if reading is not None:
                self._underway.append((time + self._settings.latency + delay, reading))

    def deliver(self, time: float) -> list[TagReading]:
        """Give the readings whose latency has passed, oldest first."""
        arrived = [reading for due, reading in self._underway if due <= time + SLACK]
        if arrived:
            self._underway = [(due, reading) for due, reading in self._underway if due > time + SLACK]
        return arrived

    def _read(self, name: str, time: float, pose: Pose) -> TagReading | None:
        """Read one tag; the same number of draws whether it is missed or not."""
        settings = self._settings
        missed = self._rng.random() < settings.dropout
        draws = self._rng.normal(size=6)
        if missed:
            return None
        noise = np.array([settings.sigma_xy * draws[0], settings.sigma_xy * draws[1], settings.sigma_z * draws[2]])
        position = pose.position + noise
        position[:2] += self._field.at(pose.position)
        tilt = settings.sigma_tilt * draws[3:5]
        turn = multiply(yaw_quaternion(settings.sigma_yaw * draws[5]), _small_turn(tilt[0], tilt[1]))
        return TagReading(name, time, position, multiply(turn, pose.quaternion))


def _small_turn(x: float, y: float) -> Array:
    """Give the quaternion of a turn by the rotation vector (x, y, 0) [rad]."""
    angle = math.hypot(x, y)
    scale = 0.5 if angle < 1e-9 else math.sin(angle / 2) / angle
    return np.array([scale * x, scale * y, 0.0, math.cos(angle / 2)])


@dataclass(frozen=True)
class WristReading:
    """What a wrist sensor shows.

    Attributes:
        stamp: when it was measured [s].
        force: (3,) [N] in the sensor's axes.
        torque: (3,) [N m] in the sensor's axes at its origin.
    """

    stamp: float
    force: Array
    torque: Array


class WristSensor:
    """A force-torque sensor: white noise, an offset for the run, quantisation, saturation.

    What it is given is averaged since its last reading, as a sensor's filter does: a physics step's contact force
    alone is not what a sensor at 100 Hz shows.
    """

    def __init__(
        self,
        settings: WristSettings,
        rng: Generator,
        *,
        frame: Array | None = None,
        drift: Callable[[float], Array] | None = None,
        delay: float = 0.0,
    ) -> None:
        """Set up with an offset drawn from `rng`, which is kept for the noise.

        Args:
            settings: what the sensor is like.
            rng: draws offset and noise.
            frame: (6, 6) from the true wrench to what a sensor mounted askew feels; default: the same.
            drift: offset (6,) [N, N m] beyond that of the run, at a time [s].
            delay: by how much readings are stamped, and come, later than they should [s].
        """
        self._settings, self._rng = settings, rng
        self._frame, self._drift, self._delay = frame, drift, delay
        self._underway: deque[WristReading] = deque()
        bounds = np.array([settings.force_bias] * 3 + [settings.torque_bias] * 3)
        self._bias = rng.uniform(-bounds, bounds)
        self._noise = np.array([*settings.force_noise, *settings.torque_noise])
        self._range = np.array([*settings.force_range, *settings.torque_range])
        self._resolution = np.array([settings.force_resolution] * 3 + [settings.torque_resolution] * 3)
        self._ticker = Ticker(settings.rate)
        self._sum, self._count = np.zeros(6), 0

    @property
    def bias(self) -> Array:
        """Offset (6,) of force [N] and torque [N m], for scoring only."""
        return self._bias.copy()

    def measure(self, time: float, force: Array, torque: Array) -> WristReading | None:
        """Take in the true wrench of this step, and give a reading where one is due.

        Args:
            time: now [s].
            force: (3,) [N] on the sensor, its axes.
            torque: (3,) [N m] on the sensor at its origin, its axes.
        """
        self._sum += np.concatenate([force, torque])
        self._count += 1
        if self._ticker.due(time):
            self._underway.append(self._read(time))
        return self._underway.popleft() if self._underway and self._underway[0].stamp <= time + SLACK else None

    def _read(self, time: float) -> WristReading:
        """Show the mean since the last reading."""
        mean = self._sum / self._count
        self._sum, self._count = np.zeros(6), 0
        if self._frame is not None:
            mean = self._frame @ mean
        if self._drift is not None:
            mean = mean + self._drift(time)
        shown = np.clip(mean + self._bias + self._noise * self._rng.normal(size=6), -self._range, self._range)
        steps = np.where(self._resolution > 0, self._resolution, 1.0)
        shown = np.where(self._resolution > 0, np.round(shown / steps) * steps, shown)
        return WristReading(time + self._delay, shown[:3], shown[3:])
