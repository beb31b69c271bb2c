"""The push as a laboratory without a wrist sensor records it: efforts of the arm's joints, with friction in them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from sensor_msgs.msg import JointState

from pbrl_bag.decoding import nanoseconds
from pbrl_bag.mcap_file import McapFile, RawMessage
from pbrl_bag.metadata import files_of_bag
from pbrl_bag.reader import Decoder
from pbrl_bringup.benches.foreign_labs import Message

Array = NDArray[np.float64]

JOINTS, DESCRIPTION = "/joint_states", "/robot_description"
STATE, TEXT = "sensor_msgs/msg/JointState", "std_msgs/msg/String"
FRICTION, NOISE = 0.5, 0.1
"""Of each joint [N m]: Coulomb friction in its gears, and the noise of one reading."""
SLIPS = 0.02
"""Speed [rad/s] at which friction is about whole."""


def by_efforts(bag: Path, messages: Sequence[Message], wrench: str, side: str, seed: int) -> list[Message]:
    """Return what a laboratory records whose arm tells efforts and has no wrist sensor.

    Args:
        bag: the native recording, with joint states, description and the sensor's wrench.
        messages: what the laboratory records with a sensor.
        wrench: topic of it, left out.
        side: "left" or "right", whose arm pushes.
        seed: of the efforts' noise.
    """
    rng = np.random.default_rng(seed)
    told: list[Message] = []
    states: list[tuple[Any, RawMessage]] = []
    felt: list[tuple[float, Array]] = []
    for file in map(McapFile, files_of_bag(bag)):
        decoder = Decoder(file)
        for raw in file.messages():
            if raw.topic == JOINTS:
                states.append((decoder.decode(raw), raw))
            elif raw.topic == DESCRIPTION:
                told.append((DESCRIPTION, TEXT, decoder.decode(raw), raw.log_time))
            elif raw.topic == f"/wrist_ft/{side}":
                felt.append(_felt(decoder.decode(raw)))
    arm = _Arm(told[0][2].data, side)
    when, readings = np.array([time for time, _ in felt]), np.array([reading for _, reading in felt])
    for state, raw in states:
        time = nanoseconds(state.header.stamp) * 1e-9
        wanted = np.array([np.interp(time, when, column) for column in readings.T])
        message = JointState(header=_header(state), name=list(state.name), position=list(map(float, state.position)))
        message.effort = arm.efforts(message.name, message.position, list(state.velocity), wanted, rng)
        told.append((JOINTS, STATE, message, raw.log_time))
    rest = [each for each in messages if each[0] != wrench]
    return sorted([*told, *rest], key=lambda message: message[3])


def _felt(message: Any) -> tuple[float, Array]:
    force, torque = message.wrench.force, message.wrench.torque
    reading = np.array([force.x, force.y, force.z, torque.x, torque.y, torque.z])
    return nanoseconds(message.header.stamp) * 1e-9, reading


def _header(state: Any) -> Any:
    header = JointState().header
    header.stamp.sec, header.stamp.nanosec = int(state.header.stamp.sec), int(state.header.stamp.nanosec)
    return header


class _Arm:
    """What the motors of one arm have to do, by the textbook; the hand's weight is in what its sensor reads."""

    def __init__(self, urdf: str, side: str) -> None:
        self._model = pin.buildModelFromXML(urdf)
        self._tip = self._model.getFrameId(f"{side}_ft")
        self._model.inertias[self._model.frames[self._tip].parentJoint] = pin.Inertia.Zero()
        self._data = self._model.createData()

    def efforts(
        self,
        names: Sequence[str],
        positions: Sequence[float],
        speeds: Sequence[float],
        reading: Array,
        rng: np.random.Generator,
    ) -> list[float]:
        """Return the effort of each joint by name [N m], of a wrench (6,) that the sensor reads."""
        q = pin.neutral(self._model)
        joints = {name: self._model.joints[self._model.getJointId(name)] for name in names}
        for name, position in zip(names, positions, strict=True):
            if joints[name].nq == 1:
                q[joints[name].idx_q] = position
            else:
                q[joints[name].idx_q : joints[name].idx_q + 2] = np.cos(position), np.sin(position)
        jacobian = pin.computeFrameJacobian(self._model, self._data, q, self._tip, pin.ReferenceFrame.LOCAL)
        needed = pin.computeGeneralizedGravity(self._model, self._data, q) - jacobian.T @ reading
        off = [FRICTION * np.tanh(speed / SLIPS) + rng.normal(0.0, NOISE) for speed in speeds]
        return [float(needed[joints[name].idx_v] + more) for name, more in zip(names, off, strict=True)]
