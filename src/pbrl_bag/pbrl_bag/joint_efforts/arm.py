"""An arm out of a URDF: what gravity and motion take of its joints, and how a wrench at its tip shows in them."""

from __future__ import annotations

import importlib
from collections.abc import Collection
from functools import cache
from typing import Any

import numpy as np

from pbrl_bag.errors import BagError
from pbrl_bag.types import Array
from pbrl_bag.validation import nearest


@cache
def _pinocchio() -> Any:
    """Return the module `pinocchio`, imported when it is first needed: recordings with a wrench do without.

    Raises:
        BagError: it is not installed.
    """
    try:
        return importlib.import_module("pinocchio")
    except ImportError as error:
        raise BagError(f"joint_efforts: expected Pinocchio, got: {error}; install it with `pip install pin`") from error


class Arm:
    """The joints that carry a tip, and what else they carry.

    Attributes:
        chain: names of all joints whose positions matter: from the root of the URDF to the tip, in that order, then
            those of whatever else hangs on a measured joint and is told, as the other arm does on a torso.

    Args:
        urdf: text of the robot's description.
        joints: whose efforts are measured, some of the chain's.
        tip: frame or link at which the wrench is wanted.
        gravity: (3,) in the axes of the URDF's root [m/s^2].
        where: what to call the description in errors.
        told: joints whose positions are told; what hangs on a measured joint by others stands as the URDF draws it.

    Raises:
        BagError: the text is no URDF, or joints and tip are not in it, or not one chain.
    """

    def __init__(
        self,
        urdf: str,
        joints: tuple[str, ...],
        tip: str,
        gravity: tuple[float, float, float],
        where: str,
        told: Collection[str] = (),
    ) -> None:
        self._pin = pin = _pinocchio()
        try:
            whole = pin.buildModelFromXML(urdf)
        except (ValueError, RuntimeError) as error:
            raise BagError(f"{where}: expected the text of a URDF, got {urdf[:40]!r}: {error}") from error
        frames = [frame.name for frame in whole.frames]
        if tip not in frames:
            raise BagError(f"{where}: tip: expected a link of it, got {tip!r}; {nearest(tip, frames)}")
        joint, chain = int(whole.frames[whole.getFrameId(tip)].parentJoint), list[str]()
        while joint:
            chain.append(str(whole.names[joint]))
            joint = int(whole.parents[joint])
        self.chain = tuple(reversed(chain))
        for name in joints:
            if name not in self.chain:
                raise BagError(
                    f"{where}: joints: expected joints that carry {tip!r}, got {name!r}; "
                    f"{nearest(name, list(self.chain))}"
                )
        for k in range(1, whole.njoints):
            above = {str(whole.names[each]) for each in whole.supports[k]}
            if whole.names[k] in told and whole.names[k] not in self.chain and above & set(joints):
                self.chain = (*self.chain, str(whole.names[k]))
        others = [whole.getJointId(name) for name in whole.names[1:] if name not in self.chain]
        self._model = pin.buildReducedModel(whole, others, pin.neutral(whole)) if others else whole
        self._model.gravity.linear = np.array(gravity, dtype=float)
        self._data = self._model.createData()
        self._tip = self._model.getFrameId(tip)
        self._joints = [self._model.joints[self._model.getJointId(name)] for name in self.chain]
        self._columns = [self._model.joints[self._model.getJointId(name)].idx_v for name in joints]

    def torques(self, angles: Array, speeds: Array | None = None, accelerations: Array | None = None) -> Array:
        """Return (n, k) what the joints need without a load [N m].

        Args:
            angles: (n, c) of the chain [rad or m].
            speeds: (n, c); None: at rest.
            accelerations: (n, c); None: none.
        """
        v, a = self._velocities(speeds, len(angles)), self._velocities(accelerations, len(angles))
        rows = [
            self._pin.rnea(self._model, self._data, q, *va) for q, *va in zip(self._full(angles), v, a, strict=True)
        ]
        return np.array(rows).reshape(-1, self._model.nv)[:, self._columns]

    def jacobians(self, angles: Array) -> Array:
        """Return (n, 6, k): twist of the tip in its own axes, linear rows first, of the joints' speeds."""
        local = self._pin.ReferenceFrame.LOCAL
        rows = [
            self._pin.computeFrameJacobian(self._model, self._data, q, self._tip, local)[:, self._columns]
            for q in self._full(angles)
        ]
        return np.array(rows).reshape(-1, 6, len(self._columns))

    def _full(self, angles: Array) -> Array:
        """Return (n, nq): joints without end are told by cosine and sine."""
        q = np.zeros((len(angles), self._model.nq))
        for joint, column in zip(self._joints, angles.T, strict=True):
            if joint.nq == joint.nv:
                q[:, joint.idx_q] = column
            else:
                q[:, joint.idx_q], q[:, joint.idx_q + 1] = np.cos(column), np.sin(column)
        return q

    def _velocities(self, values: Array | None, count: int) -> Array:
        out = np.zeros((count, self._model.nv))
        if values is not None:
            out[:, [joint.idx_v for joint in self._joints]] = values
        return out
