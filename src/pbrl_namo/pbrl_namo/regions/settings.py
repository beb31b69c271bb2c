"""Settings of free-space regions and of the roadmap over them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pbrl_control.grasping.settings import GraspSettings
from pbrl_control.settings import NotNegative, Positive, Section

MARGIN = 0.02
"""Kept around the disc that stands for the robot while it drives [m]."""


class RegionSettings(Section):
    """How the floor is cut into regions, and how densely the roadmap covers them."""

    radius: Positive | None = (
        None  # [m] of the disc that drives; none: half the robot's width and `margin`, Krang: 0.52
    )
    margin: NotNegative = MARGIN  # [m] around the robot, where `radius` is not told
    density: Positive = 2.0  # [1/m^2] of milestones drawn uniformly
    neighbours: Annotated[int, Field(ge=1, le=100)] = 8  # nearest milestones that each is connected to
    least_area: Positive = 0.01  # [m^2] of a region from which on it has to have milestones
    least_milestones: Annotated[int, Field(ge=1, le=100)] = 3  # of such a region, before grasps
    grasp_spacing: Positive = 0.25  # [m] along a face between grasp samples, two a face at least
    fine_spacing: Positive = 0.04  # [m] between those of things that border a region without a grasp from there
    grasp: GraspSettings = GraspSettings()  # what grippers and arms can do
