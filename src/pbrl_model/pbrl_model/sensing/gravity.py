"""Gravity compensation: what the gripper's own weight and the sensor's bias add is taken out again (38).

Both methods start from one reference reading, taken before contact, with the gripper's orientation then.

- `reference` is the thesis's: the whole reading is turned from the reference orientation to the present one, as
  if all of it were fixed in the world. Exact for a weight hung at the sensor's origin and a sensor without bias.
- `weight` turns only what is weight: gravity pulls along the world's vertical, so the reading's vertical part
  is taken for the weight, its lever arm from the torque it makes; the rest is bias and stays with the sensor.
  Exact for any bias while the gripper turns about the vertical, which is what pushing on a floor does. When the
  gripper tilts, the vertical part of the bias and the lever arm along the weight are not known, and stay behind.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
GravityMethod = Literal["reference", "weight"]


@dataclass(frozen=True)
class ReferenceReading:
    """What the sensor read before contact.

    Attributes:
        wrench: (6,) in sensor axes [N, N m].
        rotation: (3, 3) sensor to world at that time.
    """

    wrench: Array
    rotation: Array


def compensation(reference: ReferenceReading, rotation: Array, method: GravityMethod = "weight") -> Array:
    """Return what the sensor would read now without contact.

    Args:
        reference: reading before contact.
        rotation: (..., 3, 3) sensor to world now.
        method: "reference" (38) or "weight", see the module.

    Returns:
        (..., 6) in the sensor's present axes, to be subtracted from its reading.
    """
    now_from_then = np.swapaxes(rotation, -1, -2) @ reference.rotation
    force, torque = reference.wrench[:3], reference.wrench[3:]
    if method == "reference":
        return np.concatenate([now_from_then @ force, now_from_then @ torque], -1)
    vertical = reference.rotation.T @ np.array([0.0, 0.0, 1.0])
    weight = (force @ vertical) * vertical
    magnitude = float(weight @ weight)
    change = now_from_then @ weight - weight
    # The shortest lever arm that explains the torque; what it leaves over is bias.
    lever = np.cross(weight, torque) / magnitude if magnitude > 1e-12 else np.zeros(3)
    return np.concatenate([force + change, torque + np.cross(lever, change)], -1)
