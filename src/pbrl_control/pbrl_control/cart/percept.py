"""What the cart's controller is given at a tick, and what it answers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pbrl_control.cart.arms import ArmState
from pbrl_control.planar import Array

LETHAL, UNKNOWN = 254, 255
"""Costs, as in ROS's navigation."""


class CostWindow(Protocol):
    """The local costmap: cells (rows, columns) uint8, row 0 at the lowest y, their size and corner [m]."""

    @property
    def cells(self) -> NDArray[np.uint8]:
        """Costs: 254 lethal, 255 unknown."""
        ...

    @property
    def resolution(self) -> float:
        """Of a cell [m]."""
        ...

    @property
    def origin(self) -> tuple[float, float]:
        """Lowest x and y of cell (0, 0), in the frame of the plan [m]."""
        ...


class DriveStatus(StrEnum):
    """What the controller is at."""

    MOVING = "on the way"
    BLOCKED = "standing before something that is in the way"
    WAITING = "standing until what it is told can be relied upon again"
    ARRIVED = "at the goal"
    REPLAN = "given up; plan again"
    FAILED = "given up; the cart is not held as it should be: take it again"


class Cause(StrEnum):
    """Why it does not go at full speed."""

    NONE = ""
    NEAR = "something is near"
    OBSTACLE = "something is in the way"
    FOOTPRINT = "something is marked where robot or cart are"
    SCAN = "the last scan is old"
    POSE = "the pose of the base is old or no pose"
    ARTICULATION = "the pose of the cart is old or no pose"
    JOINTS = "the joints' positions are old"
    GRIP = "a hand has lost the cart"
    ARMS = "the arms cannot do it"
    LAG = "base or cart are behind"
    OFF_PLAN = "too far from the plan"
    STALLED = "no progress"


@dataclass(frozen=True)
class CartPercept:
    """The latest of every stream.

    Attributes:
        pose: (3,) of `base` in the frame of plan and costmap, `odom` [m, rad]; None: not known.
        pose_time: of it [s].
        articulation: of the cart about the grip, by the arms or a checkerboard [rad]; None: not known.
        articulation_rate: of it [rad/s]; what is swept is looked at with it, if it is more than was commanded.
        articulation_time: of it [s].
        scan_time: of the last scan in the costmap [s].
        costs: the costmap.
        holds: whether the left, and the right hand holds the cart.
        misfit: by which the hands' distance differs from that of what they hold [m]; not a number: cannot be told.
        grip_offset: (2,) from where the grip should be to where it is, in `base` [m].
        arms: joints and Jacobians of both arms; None: nobody wants joint rates.
        arms_time: of the joints [s], where there are any.
    """

    pose: Array | None
    pose_time: float
    articulation: float | None
    articulation_rate: float
    articulation_time: float
    scan_time: float
    costs: CostWindow
    holds: tuple[bool, bool] = (True, True)
    misfit: float = 0.0
    grip_offset: tuple[float, float] = (0.0, 0.0)
    arms: ArmState | None = None
    arms_time: float = math.nan

    @property
    def streams(self) -> tuple[tuple[Cause, str, float], ...]:
        """Return what comes again and again: the cause to wait when it does not, its name, of when the last is [s]."""
        joints = () if self.arms is None else ((Cause.JOINTS, "joints", self.arms_time),)
        return (
            (Cause.POSE, "pose of the base", self.pose_time),
            (Cause.ARTICULATION, "pose of the cart", self.articulation_time),
            (Cause.SCAN, "laser", self.scan_time),
            *joints,
        )


@dataclass(frozen=True)
class CartCommand:
    """What base and cart are to do until the next tick.

    Attributes:
        twist: (3,) forward, left [m/s], turning [rad/s], in `base`.
        articulation_rate: of the cart about the grip [rad/s].
        status: what the controller is at.
        cause: why it is not at full speed.
        reason: the same for a person, in one line; empty where all is well.
        goal: (4,) of the plan that is aimed at now.
        error: (4,) from where the robot will be when the command arrives to there.
        clearance: distance to something lethal on the way ahead [m], as far as `near` looks.
        pace: share of the plan's speed at which the goal moves, 0 to 1.
        joint_rates: (2, 7) left, right [rad/s]; None where no arms were given.
    """

    twist: Array
    articulation_rate: float
    status: DriveStatus
    cause: Cause
    reason: str
    goal: Array
    error: Array
    clearance: float
    pace: float
    joint_rates: Array | None = None
