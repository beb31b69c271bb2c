"""From a ray to the plates: where on a face one gripper or both take hold."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pbrl_control.edges import nearest_edge
from pbrl_control.grasping.settings import GraspSettings
from pbrl_control.planar import Array, compose, inverse, rotation

SIGN = {"left": 1.0, "right": -1.0}
Hands = tuple[str, ...]
ON_FACE = 1e-6  # [m]
SAME_FACE = 1e-3  # [m, rad] between two grips that are told


@dataclass(frozen=True)
class FacePoint:
    """A point of a face, and how far the face goes on to both sides of it as the robot sees it.

    Attributes:
        pose: (3,) in the object's frame, yaw pointing inwards [m, rad].
        left, right: [m] of straight face on either hand.
    """

    pose: Array
    left: float
    right: float

    @property
    def normal(self) -> float:
        """Angle of the outward normal in the object's frame [rad]."""
        return float(self.pose[2]) + math.pi


@dataclass(frozen=True)
class Reach:
    """Where the plates close and where the base then stands.

    Attributes:
        sides: who grasps.
        contacts: (2,) of each side's plates on the outline, in the object's frame [m].
        base: (3,) of `base` in the object's frame when the plates have closed [m, rad].
        lateral: of the plates off the robot's middle [m], for the room that the arms need.
    """

    sides: Hands
    contacts: dict[str, Array]
    base: Array
    lateral: float


def face_point(footprint: Array, point: Array) -> FacePoint:
    """Return the face that a point (2,) of a counter-clockwise outline (k, 2) lies on, and where it ends."""
    pose = nearest_edge(footprint, point).pose
    inward = rotation(float(pose[2]))
    local = (np.asarray(footprint, dtype=float) - pose[:2]) @ inward  # x into the object, y to the robot's left
    ends = np.stack((local, np.roll(local, -1, axis=0)), axis=1)  # (k, 2, 2): each edge's two ends
    level = ends[np.abs(ends[:, :, 0]).max(axis=1) < ON_FACE, :, 1]
    low = high = 0.0
    for first, last in sorted((float(a), float(b)) for a, b in np.sort(level, axis=1)):
        if first <= high + ON_FACE and last >= low - ON_FACE:  # another face may lie on the same line, further on
            low, high = min(low, first), max(high, last)
    return FacePoint(pose, high, -low)


def place_plates(face: FacePoint, hands: Hands, settings: GraspSettings) -> Reach | str:
    """Return how the hands take hold at a face's point, or why they cannot, in one line.

    Two plates come as far apart as their homes are, closer on a short face; the point is then the middle
    between them.
    """
    home_x, home_y, home_yaw = settings.home
    half = settings.plate_width / 2.0 + settings.corner_margin
    room = min(face.left, face.right) - half
    if room < 0.0:
        short = min(face.left, face.right)
        return f"corner: expected {half:.3f} m of face on either side of the plates, got {short:.3f} m"
    if len(hands) == 1:
        side = hands[0]
        home = np.array([home_x, SIGN[side] * home_y, SIGN[side] * home_yaw])
        plates = compose(face.pose, np.array([settings.depth, 0.0, 0.0]))
        return Reach(hands, {side: face.pose[:2]}, compose(plates, inverse(home)), home_y)
    lateral = min(home_y, room, settings.lateral[1])
    if lateral < settings.lateral[0]:
        need, got = 2.0 * (settings.lateral[0] + half), 2.0 * (room + half)
        return f"face: expected {need:.2f} m about the point for two grippers side by side, got {got:.2f} m"
    contacts = {side: compose(face.pose, np.array([0.0, SIGN[side] * lateral, 0.0]))[:2] for side in hands}
    return Reach(hands, contacts, compose(face.pose, np.array([settings.depth - home_x, 0.0, 0.0])), lateral)


def reach_contacts(footprint: Array, points: Mapping[str, Array], settings: GraspSettings) -> Reach | str:
    """Return how hands take hold where they are told to, or why they cannot, in one line.

    Args:
        footprint: (k, 2) counter-clockwise, in the object's frame [m].
        points: (2,) by gripper, in the object's frame [m]; the nearest points of the outline are taken.
        settings: of grippers.
    """
    hands = tuple(side for side in SIGN if side in points)
    faces = {side: face_point(footprint, points[side]) for side in hands}
    half = settings.plate_width / 2.0 + settings.corner_margin
    for side, face in faces.items():
        short = min(face.left, face.right)
        if short < half:
            return f"corner: expected {half:.3f} m of face on either side of the {side} plates, got {short:.3f} m"
    if len(hands) == 1:
        return place_plates(faces[hands[0]], hands, settings)
    left, right = faces["left"], faces["right"]
    across = compose(inverse(right.pose), left.pose)
    if abs(across[0]) > SAME_FACE or abs(across[2]) > SAME_FACE:
        return "face: expected both grips on one face, got them on two; grasp with one hand or move a point"
    lateral = 0.5 * float(across[1])
    low, high = settings.lateral
    if not low <= lateral <= high:
        return (
            f"face: expected the left grip {2 * low:.2f} to {2 * high:.2f} m left of the right, got {2 * lateral:.2f} m"
        )
    middle = compose(right.pose, np.array([0.0, lateral, 0.0]))
    contacts = {side: face.pose[:2] for side, face in faces.items()}
    return Reach(hands, contacts, compose(middle, np.array([settings.depth - settings.home[0], 0.0, 0.0])), lateral)
