"""Named postures of the PR2: what torso, head and arms look like when a run starts.

The right arm mirrors the left one unless a posture says otherwise: pan, upper arm roll, forearm roll and wrist roll
are negated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from bullet_sim.errors import nearest
from pr2_cart_sim.errors import Pr2Error

Angles = tuple[float, float, float, float, float, float, float]

LOOK_DOWN = 0.55
"""Tilt of the head [rad] at which its camera has what the hands hold in the middle."""


@dataclass(frozen=True)
class Posture:
    """Height of the torso [m], angles [rad] of both arms from shoulder pan to wrist roll, pan and tilt of the head."""

    torso: float
    left: Angles
    right: Angles
    head: tuple[float, float] = (0.0, LOOK_DOWN)

    def at(self, torso: float | None) -> Posture:
        """Give the same posture at another height of the torso [m]; None: as it is."""
        return self if torso is None else replace(self, torso=torso)


def mirrored(angles: Angles) -> Angles:
    """Give the angles of the one arm in the mirror image of the other's posture."""
    pan, lift, roll, elbow, forearm, wrist, turn = angles
    return (-pan, lift, -roll, elbow, -forearm, wrist, -turn)


def _both(torso: float, left: Angles) -> Posture:
    return Posture(torso, left, mirrored(left))


DEFAULT_POSTURE = "edge_grasp_low"
"""Fingers above and below the handle of a cart, level, 0.5 m apart, at x 0.65 m and z 0.64 m over the torso's zero."""

POSTURES: Mapping[str, Posture] = MappingProxyType(
    {
        "edge_grasp": _both(0.1, (0.7484, 0.2298, 1.8035, -1.7301, -2.7633, -1.0443, -0.2163)),
        "edge_grasp_low": _both(0.1, (0.4694, 1.0259, 0.6108, -1.7845, -3.0373, -0.6981, -1.9534)),
        "table_forward": _both(0.1, (0.7508, 0.2427, 1.7894, -1.7295, -2.7616, -1.0382, 1.3723)),
        "untucked": _both(0.1, (0.4, 1.0, 0.0, -2.05, 0.0, -0.1, 0.0)),
        "tucked": Posture(
            0.0,
            (0.06024, 1.248526, 1.78907, -1.683386, -1.7343417, -0.0962141, -0.0864407),
            (-0.023593, 1.10728, -1.5566882, -2.124408, -1.4175, -1.8417, 0.21436),
        ),
    }
)
"""By name. In `edge_grasp` the elbows are out, in `edge_grasp_low` below the hands."""


def posture(name: str) -> Posture:
    """Look a posture up by name.

    Raises:
        Pr2Error: no posture has this name.
    """
    try:
        return POSTURES[name]
    except KeyError:
        raise Pr2Error(f"posture {name!r} is not one of the PR2's; {nearest(name, POSTURES)}") from None
