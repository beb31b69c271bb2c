"""Grasp compliance: plates whose rubber is softer than it was, or that are loose on the edge."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from pydantic import Field

from bullet_sim.clamp import GripperSpec
from bullet_sim.concealed.effect import Effect
from bullet_sim.furniture import Furniture
from bullet_sim.settings import Settings, Stiffness


class GraspComplianceSettings(Settings):
    """How a body is really held, by whatever gripper.

    Attributes:
        stiffness: of the rubber [N/m]; new rubber has 20000.
        damping: ratio to the critical damping of a 5 kg mass on that spring.
        play: way [m] either side over which nothing holds.
    """

    stiffness: Stiffness = 1500.0
    damping: Annotated[float, Field(ge=0, le=2)] = 0.2
    play: Annotated[float, Field(ge=0, le=0.05)] = 0.0

    def worn(self, spec: GripperSpec) -> GripperSpec:
        """Give the plates as they really are."""
        return replace(spec, stiffness=self.stiffness, damping=self.damping, play=self.play)


class GraspCompliance(Effect):
    """Softness of a grasp; it acts from the moment the plates close."""

    name, unit = "grasp_compliance", "m/N"

    def __init__(self, body: Furniture, settings: GraspComplianceSettings) -> None:
        """Take note of it."""
        super().__init__(body.name)
        self._settings = settings

    def strength(self) -> float:
        """Give the compliance [m/N]."""
        return 1 / self._settings.stiffness
