"""What Krang's grippers and arms can do at an edge; measured with its description (robots.md 1.4, 1.5)."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pbrl_control.settings import NotNegative, Planar, Positive, Range, Section


class GraspSettings(Section):
    """How grasps are sampled and what is asked of them."""

    samples: Annotated[int, Field(ge=1, le=1000)] = 24  # rays from the object's centre
    wanted: Annotated[int, Field(ge=1)] = 6  # candidates with a path; the search ends when no shorter one is left
    dead_ends: Annotated[int, Field(ge=1)] = 8  # searches without a path after which no further way is looked for
    home: Planar = (0.74, 0.16, 0.0)  # x, y, yaw of the left gripper in `base`, as the controller's; right: mirrored
    depth: NotNegative = 0.02  # [m] of the plates' middle past the edge when they close
    standoff: Positive = 0.12  # [m] of the plates' middle before the edge when the base has arrived
    lateral: Range = (0.10, 0.35)  # [m] off the robot's middle that an arm reaches well at its home's distance
    heights: Range = (0.60, 0.92)  # [m] above the floor at which the plates can be level there
    opening: Positive = 0.059  # [m] between the plates
    opening_margin: NotNegative = 0.01  # [m] of it that the edge must leave
    plate_width: Positive = 0.074  # [m]
    corner_margin: NotNegative = 0.09  # [m] between a plate and the end of the face: a table's legs stand under there
    edge_thickness: Positive = 0.025  # [m] of the object's edge: a table top
    clearance: NotNegative = 0.03  # [m] around the robot at the grasp and on the way there
    time_limit: Positive = 5.0  # [s] for each path
    narrow: bool = False  # the room is full: paths are sought on a grid first, see `plan_route`
