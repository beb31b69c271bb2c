"""From a learned fault of sensors to the simulated sensors that have it.

A model has a fault as it is on the body: the offset of what acts on it, in the axes that the body had when the sensor
first held it. A sensor shows what acts on itself, which is the opposite, in its own axes, and takes the fault with it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bullet_sim.concealed.options import GRIPPERS
from bullet_sim.concealed.told import Sensor, Told

Array = NDArray[np.float64]

COMES_ON = 0.1
"""Within so long [s], about its moment: a fit needs a slope."""
SQUARE = 1e-3
"""By which a rotation may be none."""


def sensor_offset(told: Told) -> dict[str, Any]:
    """Return an offset or a drift of a force sensor.

    A drift counts from when the sensor was read at rest, whenever that was. An offset without a moment begins with the
    recording that it was found in: what a sensor has when it is read at rest is taken off, and shows in nothing.

    Raises:
        ValueError: the model does not say whose sensor it is, or has both.
    """
    sensor = _sensor(told, "wrench_bias")
    drifts = any(f"drift_{part}" in told.values for part in ("x", "y", "torque"))
    if drifts and any(told.get(f"bias_{part}") for part in ("x", "y", "torque")):
        raise ValueError("wrench_bias: expected an offset or a drift, got both")
    kind = "drift" if drifts else "bias"
    force = [told.get(f"{kind}_x"), told.get(f"{kind}_y"), 0.0]
    felt, turned = _felt(sensor, force), _felt(sensor, [0.0, 0.0, told.get(f"{kind}_torque")])
    if drifts:
        return {"wrench_bias": {sensor.gripper: {"force_drift": felt, "torque_drift": turned}}}
    offset: dict[str, Any] = {"force": felt, "torque": turned, "start": told.began}
    if "bias_start" in told.values:
        offset |= {"start": max(told["bias_start"] - 0.5 * COMES_ON, 0.0), "rise": COMES_ON}
    return {"wrench_bias": {sensor.gripper: offset}}


def sensor_frame(told: Told) -> dict[str, Any]:
    """Return the scale of a force sensor and its turn about the vertical.

    Raises:
        ValueError: the model does not say whose sensor it is.
    """
    sensor = _sensor(told, "wrench_frame")
    # What the sensor shows is turned against what acts as it is itself the other way.
    turn = -told.get("sensor_turn") * sensor.turn.T @ [0.0, 0.0, 1.0]
    frame: dict[str, Any] = {"scale": told.get("force_scale", 1.0), "turn": turn.tolist()}
    if told.get("torque_scale", -1.0) > 0.0:
        frame["torque_scale"] = told["torque_scale"]
    return {"wrench_frame": {sensor.gripper: frame}}


def late_stream(told: Told) -> dict[str, Any]:
    """Return what comes late: the body's tag, or the force sensor where poses come early.

    The `delay` that a model has beside it is what streams of sound sensors have, and those here have their own.

    Raises:
        ValueError: the force is late, and the model does not say whose sensor it is.
    """
    late = told["time_offset"]
    if late == 0.0:
        return {}
    stream = told.name if late > 0.0 else _sensor(told, "time_offset").gripper
    return {"time_offset": {stream: {"delay": abs(late)}}}


def _sensor(told: Told, effect: str) -> Sensor:
    """Return the sensor that a fault is one of."""
    sensor = told.sensor
    if sensor is None:
        raise ValueError(
            f"{effect}: expected a model that says which sensor it was learned with, got one that does not (two "
            f"grippers, a gripper that was not seen, or an older file); write concealed.{effect} into the scene"
        )
    if sensor.gripper not in GRIPPERS:
        raise ValueError(f"{effect}: expected the sensor of {' or '.join(GRIPPERS)}, got that of {sensor.gripper!r}")
    if not np.allclose(sensor.turn @ sensor.turn.T, np.eye(3), atol=SQUARE):
        raise ValueError("sensor.turn: expected a rotation, got another matrix")
    return sensor


def _felt(sensor: Sensor, acts: list[float]) -> list[float]:
    """Return what a sensor shows of what acts on the body (3,), in its own axes."""
    return [float(each) for each in -sensor.turn.T @ acts]
