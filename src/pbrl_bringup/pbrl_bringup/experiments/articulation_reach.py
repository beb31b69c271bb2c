"""About which point something turned, and how far Krang can turn what it holds about a point, without physics."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_bringup.benches.control_laws import robot
from pbrl_bringup.errors import BringupError
from pbrl_control.controller import BodyController
from pbrl_control.kinematics import SIDES, GripperState, Posture, RobotKinematics
from pbrl_control.percept import Tag
from pbrl_control.planar import compose, rotation, shift, wrap
from pbrl_control.settings import ControllerSettings
from pbrl_control.trajectories.follower import TrajectoryFollower
from pbrl_control.trajectories.trajectory import MotionLimits, ObjectTrajectory
from pbrl_control.types import BodyState, Hold, PlanarTwist, gripper_frame

Array = NDArray[np.float64]

LEAST_TURN = 0.01
"""Less than this [rad] says nothing about a centre."""
PERIOD = 0.01
"""Of the controller [s]."""
RATE, SPEED = 0.1, 0.06
"""Fastest turn [rad/s], and fastest of the object's origin [m/s]: slow, for a base that has to shunt."""
APART, ASTRAY = 0.005, 0.02
"""Most that plates may come nearer each other or part, and that the centre may wander [m]."""
SLACK = 1e-6
"""For rounding of the limits [m/s, rad/s]."""
SPREADING = 6.0
"""In which grippers go aside to where they hold something [s]."""
HALF = math.pi
"""Turned so far, it can go on."""
PARKED = 1e-6
"""Speed of a base that stands [m/s, rad/s]: settings are above zero."""


@dataclass(frozen=True)
class Centre:
    """The point of a body that stayed where it was, as well as any did.

    Attributes:
        body: (2,) in the body's frame [m].
        world: (2,) where it stayed [m].
        wander: root mean square of its distance from there [m].
    """

    body: Array
    world: Array
    wander: float


def centre_of_rotation(poses: Array) -> Centre:
    """Find the point p of a moving body and the place c that minimise the sum of |R_k p + t_k - c|^2 over poses k.

    Args:
        poses: (n, 3) x, y [m], theta [rad], n >= 2.

    Raises:
        BringupError: the poses are not finite, or do not turn.
    """
    rows = np.asarray(poses, dtype=float)
    if rows.ndim != 2 or rows.shape[1:] != (3,) or len(rows) < 2 or not np.isfinite(rows).all():
        raise BringupError(f"centre of rotation: expected finite poses (n, 3), n >= 2, got shape {rows.shape}")
    turned = float(np.ptp(np.unwrap(rows[:, 2])))
    if turned < LEAST_TURN:
        raise BringupError(f"centre of rotation: expected a turn of {LEAST_TURN} rad or more, got {turned:.2g} rad")
    origin = rows[0, :2]
    turns = np.array([rotation(theta) for theta in rows[:, 2]])
    matrix = np.concatenate([turns, np.broadcast_to(-np.eye(2), turns.shape)], axis=2).reshape(-1, 4)
    found = np.linalg.lstsq(matrix, (origin - rows[:, :2]).ravel(), rcond=None)[0]
    off = turns @ found[:2] + rows[:, :2] - origin - found[2:]
    return Centre(found[:2], found[2:] + origin, float(np.sqrt(np.mean(np.sum(off**2, axis=1)))))


def turn_about(point: Array, rate: float) -> Array:
    """Return the twist (3,) of the origin, in the object's axes, of a turn about a point (2,) of it.

    Args:
        point: in the object's frame [m].
        rate: sign and most of the turn's rate [rad/s]; slower where the origin would be too fast.
    """
    slowest = min(abs(rate), SPEED / max(float(np.hypot(*point)), 1e-9))
    return shift(np.array([0.0, 0.0, math.copysign(slowest, rate)]), -np.asarray(point))


def reach(point: tuple[float, float], sign: float, grips: Array, *, driving: bool) -> float:
    """Return by how much Krang turns something about a point before its arms' workspace ends [rad], at most half round.

    The real follower and controller; nothing resists, and everything is done as commanded. It goes on until the
    follower gives up, the plates part or come nearer each other, or the point does not stay where it was.

    Args:
        point: (2,) in the object's frame [m].
        sign: of the turn.
        grips: (2, 2) where left and right gripper hold it, in its frame [m].
        driving: whether the base may move.
    """
    kinematics, settings = robot()
    if not driving:
        base = settings.base.model_copy(update={"speed": PARKED, "yaw_rate": PARKED, "steering": "none"})
        settings = settings.model_copy(update={"base": base})
    posture = _at_grips(kinematics, settings, grips)
    controller = BodyController(kinematics, settings)
    quiet, place = {side: np.zeros(6) for side in SIDES}, np.zeros(3)
    start = _carried(place, kinematics.grippers(posture), grips)
    span, anchor = float(np.hypot(*(grips[0] - grips[1]))), _at(start, point)
    twist = turn_about(np.array(point), sign * RATE)
    limits = MotionLimits(speed=SPEED + SLACK, yaw_rate=RATE + SLACK)
    trajectory = ObjectTrajectory.of_twists(start, twist[None], np.array([HALF / abs(twist[2])]), limits)
    follower = TrajectoryFollower(trajectory)
    before, turned, farthest, now = float(start[2]), 0.0, 0.0, 0.0
    while True:
        grippers = kinematics.grippers(posture)
        pose = _carried(place, grippers, grips)
        turned, before = turned + sign * wrap(float(pose[2]) - before), float(pose[2])
        apart = np.hypot(*(grippers["left"].planar[:2] - grippers["right"].planar[:2])) - span
        asked = follower.tick(now, _tag(now, pose), share=controller.share)
        if asked.finished or abs(apart) > APART or np.hypot(*(_at(pose, point) - anchor)) > ASTRAY:
            return min(farthest, HALF)
        farthest = max(farthest, turned)
        yaws = {side: wrap(float(pose[2] - place[2] - grippers[side].planar[2])) for side in SIDES}
        holds = {side: Hold("table", grips[k], yaws[side]) for k, side in enumerate(SIDES)}
        command = controller.tick(BodyState(posture), {"table": asked.twist}, holds, quiet, PERIOD)
        place = compose(place, PERIOD * np.array([command.base_v, 0.0, command.base_w]))
        arms = (posture.left + PERIOD * command.left, posture.right + PERIOD * command.right)
        posture, now = Posture(posture.waist, posture.torso, *arms), now + PERIOD


def _tag(now: float, pose: Array) -> Tag:
    """Return what a perfect camera sees of a pose (3,)."""
    half = 0.5 * float(pose[2])
    return Tag(now, np.array([pose[0], pose[1], 0.0]), np.array([0.0, 0.0, math.sin(half), math.cos(half)]))


def _at_grips(kinematics: RobotKinematics, settings: ControllerSettings, grips: Array) -> Posture:
    """Return the posture with both grippers as far ahead as at home, and as far aside as they hold something."""
    nominal = np.array(settings.nominal)
    controller, posture = BodyController(kinematics, settings), Posture(2.732, 0.0, nominal, -nominal)
    aside = 0.5 * float(np.hypot(*(grips[0] - grips[1])))
    for _ in range(round(SPREADING / PERIOD)):
        grippers = kinematics.grippers(posture)
        twists = {}
        for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
            x, y, yaw = grippers[side].planar
            way = rotation(float(yaw)).T @ (np.array([settings.home[0], sign * aside]) - (x, y))
            twists[gripper_frame(side)] = PlanarTwist(float(way[0]), float(way[1]), -float(yaw))
        command = controller.tick(BodyState(posture), twists, {}, {}, PERIOD)
        posture = Posture(2.732, 0.0, posture.left + PERIOD * command.left, posture.right + PERIOD * command.right)
    return posture


def _carried(place: Array, grippers: Mapping[str, GripperState], grips: Array) -> Array:
    """Return the pose (3,) in the world of what both plates hold: its middle, and the line between them."""
    left, right = (grippers[side].planar[:2] for side in SIDES)
    seen, own = left - right, grips[0] - grips[1]
    yaw = wrap(math.atan2(seen[1], seen[0]) - math.atan2(own[1], own[0]))
    middle = (left + right) / 2.0 - rotation(yaw) @ (grips.mean(axis=0))
    return compose(place, np.array([*middle, yaw]))


def _at(pose: Array, point: tuple[float, float]) -> Array:
    return compose(pose, np.array([*point, 0.0]))[:2]
