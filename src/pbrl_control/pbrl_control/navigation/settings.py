"""Gains, tolerances and patience of the path tracker."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pbrl_control.settings import NotNegative, Positive, Section


class TrackerSettings(Section):
    """How a path is followed, and what ends it."""

    recovery: Positive = 0.15  # [m] over which the base comes back to its line by a factor e
    reached: Positive = 0.004  # [m] before the end of a leg at which it counts as driven
    aligned: Positive = 0.004  # [rad] of heading error at which a turn counts as done
    turn_again: Positive = 0.35  # [rad] of heading error at which the base stops driving and turns
    position_tolerance: Positive = 0.02  # [m] at the goal
    yaw_tolerance: Positive = 0.0174  # [rad] at the goal
    off_path: Positive = 0.15  # [m] from the path at which it is given up
    look_ahead: NotNegative = 0.06  # [m, rad] past the stopping distance that has to be free
    slack: NotNegative = 0.01  # [m] that something has to reach into the way to be in it: poses are noisy, gaps narrow
    patience: Positive = 5.0  # [s] of waiting for a lost pose or an obstacle to go away
    stall: Positive = 3.0  # [s] without motion though motion is commanded
    creeping: Positive = 0.005  # [m/s, rad/s] below which no motion is expected
    budge: Positive = 0.003  # [m, rad] that counts as motion
    headway: Positive = 5.0  # [s] of driving or turning after which it is looked how far that has led
    got_on: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.25  # share of what was commanded that it has to have led
