"""Poses of both wrists in `base` for five postures, from the forward kinematics of Krang's original description."""

from __future__ import annotations

from dataclasses import dataclass

Seven = tuple[float, float, float, float, float, float, float]
ZERO: Seven = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Vector:
    """One posture and where it puts the wrists.

    Attributes:
        name: of the posture.
        waist: [rad].
        torso: [rad].
        left: arm joints [rad].
        right: arm joints [rad].
        left_pose: x, y, z [m] and quaternion x, y, z, w of `left_ft` in `base`.
        right_pose: the same of `right_ft`.
    """

    name: str
    waist: float
    torso: float
    left: Seven
    right: Seven
    left_pose: Seven
    right_pose: Seven


def _mirrored(left: Seven) -> Seven:
    a, b, c, d, e, f, g = left
    return -a, -b, -c, -d, -e, -f, -g


_K2: Seven = (1.0091, -1.0637, -0.0389, -1.8836, 0.2605, 1.2431, -0.0465)
_K3: Seven = (1.0668, -1.1286, -0.0096, -2.0422, 0.1238, 1.4877, -0.0624)

VECTORS = (
    Vector(
        *("K0", 0.0, 0.0, ZERO, ZERO),
        (-1.1315, 1.0878, -0.0153, 0.0, -0.7833, 0.0, 0.6216),
        (-1.1315, -1.0858, -0.0153, 0.0, -0.7833, 0.0, 0.6216),
    ),
    Vector(
        *("K1", 2.532, 0.0, ZERO, ZERO),
        (-0.1418, 1.0878, 0.8111, 0.0, 0.3579, 0.0, 0.9338),
        (-0.1418, -1.0858, 0.8111, 0.0, 0.3579, 0.0, 0.9338),
    ),
    Vector(
        *("K2", 2.532, 0.0, _K2, _mirrored(_K2)),
        (0.3864, 0.1454, 0.8953, 0.0129, 0.0081, -0.7517, 0.6593),
        (0.3864, -0.1434, 0.8953, -0.0129, 0.0081, 0.7517, 0.6593),
    ),
    Vector(
        *("K3", 2.732, 0.0, _K3, _mirrored(_K3)),
        (0.4488, 0.1251, 0.7648, 0.0299, 0.0230, -0.7446, 0.6664),
        (0.4488, -0.1231, 0.7648, -0.0299, 0.0230, 0.7446, 0.6664),
    ),
    Vector(
        *("K4", 2.400, 0.300, (1.4, -1.0, 0.2, -0.8, 0.3, -0.8, 0.5), (-1.102, 0.589, 0.0, 1.339, 0.141, 0.959, -1.0)),
        (0.2010, 0.2380, 1.3563, -0.0518, 0.4178, 0.9059, 0.0448),
        (0.1488, -0.3252, 1.1214, 0.1932, 0.0151, 0.9429, 0.2708),
    ),
)
