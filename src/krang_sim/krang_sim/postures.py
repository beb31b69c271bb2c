"""Named postures of Krang: what waist, torso and arms look like when a run starts.

The angles are those that Krang's own programs for pushing furniture used. The right arm mirrors the
left one, which for this robot is the negative of every angle, unless a posture says otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from bullet_sim.errors import nearest
from krang_sim.errors import KrangError

Angles = tuple[float, float, float, float, float, float, float]


@dataclass(frozen=True)
class Posture:
    """Joint angles [rad] of waist, torso, left arm J1..J7 and right arm J1..J7."""

    waist: float
    torso: float
    left: Angles
    right: Angles

    @property
    def body_joints(self) -> tuple[float, ...]:
        """The 16 angles in the order of `robot.BODY_JOINTS`: waist, torso, LJ1..LJ7, RJ1..RJ7."""
        return (self.waist, self.torso, *self.left, *self.right)


def mirrored(waist: float, left: Angles, torso: float = 0.0) -> Posture:
    """Make the posture whose right arm is the mirror image of the left one."""
    return Posture(waist, torso, left, _seven([-angle for angle in left]))


def _seven(angles: Sequence[float]) -> Angles:
    one, two, three, four, five, six, seven = angles
    return (one, two, three, four, five, six, seven)


DEFAULT_POSTURE = "square_table_push"
"""Grippers level at 0.765 m, 0.22 m apart, plates above and below a table top."""

POSTURES: Mapping[str, Posture] = MappingProxyType(
    {
        "square_table_push": mirrored(2.732, (1.0668, -1.1286, -0.0096, -2.0422, 0.1238, 1.4877, -0.0624)),
        "steel_cart_push": mirrored(2.532, (1.0091, -1.0637, -0.0389, -1.8836, 0.2605, 1.2431, -0.0465)),
        "grasp_ready": mirrored(2.532, (1.008, -1.113, 0.0, -1.594, 0.037, 1.022, -0.021)),
        "forward": mirrored(2.532, (1.102, -0.589, 0.0, -1.339, 0.0, -1.400, 0.0)),
        "home": Posture(
            2.79,
            0.0,
            (1.130, -1.0, 0.0, -1.57, 0.0, 1.0, -1.104),
            (-1.130, 1.0, 0.0, 1.57, 0.0, -1.0, -0.958),
        ),
    }
)
"""By name. `grasp_ready` and `forward` were recorded without a waist angle: theirs is that of `steel_cart_push`."""


def posture(name: str) -> Posture:
    """Look a posture up by name.

    Raises:
        KrangError: no posture has this name.
    """
    try:
        return POSTURES[name]
    except KeyError:
        raise KrangError(f"posture {name!r} is not one of Krang's; {nearest(name, POSTURES)}") from None
