"""Everything that can be set about planning among movable things."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from pbrl_control.settings import Positive, Section
from pbrl_namo.beliefs.settings import BeliefSettings
from pbrl_namo.manipulation.settings import ManipulationSettings, MotionSettings
from pbrl_namo.mdp.settings import MdpSettings
from pbrl_namo.regions.settings import RegionSettings


class LastResortSettings(Section):
    """How a way is searched for that was not found, before the goal is said to be out of reach.

    The budgets of `RegionSettings` and `ManipulationSettings` are for the opening that most rooms have. A table that
    has to be pushed through a doorway a hand wider than the robot wants the grasp in the middle, and an arc that
    undoes its tilt of three degrees; what stands in the way of both wants more steps.

    Attributes:
        margins: shares of the clearance and of the spare width of an opening with which it is tried, one after the
            other; none: no last resort.
        grasp_spacing: [m] between grasps along a face, also for the steps.
        apart: [m] between the contacts of two grasps.
        grasps: that are tried at most.
        second_grasps: that are tried with two motions.
        radii: [m] of arcs that the base drives as well.
        steps: manipulations of one thing, where more than one is allowed.
        step_places: poses of it from which a further one is looked for.
        step_grasps: that are tried at each.
        pushing: with the last of the margins, also let a held thing push others before it, see `pushing_through`.
    """

    margins: tuple[Annotated[float, Field(gt=0.0, le=1.0)], ...] = (1.0, 0.5)
    grasp_spacing: Positive = 0.06
    apart: Positive = 0.03
    grasps: Annotated[int, Field(ge=1, le=100)] = 60
    second_grasps: Annotated[int, Field(ge=1, le=100)] = 24
    radii: tuple[Positive, ...] = (4.0, 10.0)
    steps: Annotated[int, Field(ge=1, le=10)] = 8
    step_places: Annotated[int, Field(ge=1)] = 32
    step_grasps: Annotated[int, Field(ge=1, le=100)] = 32
    pushing: bool = True


class NamoSettings(Section):
    """Everything that can be set about planning.

    Attributes:
        regions: free space, roadmap and grasp samples.
        beliefs: what furniture is like before it was pushed.
        manipulation: Monte-Carlo manipulation.
        mdp: the upper level.
        last_resort: what is tried before a goal is said to be out of reach.
    """

    regions: RegionSettings = RegionSettings()
    beliefs: BeliefSettings = BeliefSettings()
    manipulation: ManipulationSettings = ManipulationSettings()
    mdp: MdpSettings = MdpSettings()
    last_resort: LastResortSettings = LastResortSettings()

    @model_validator(mode="after")
    def _one_gripper(self) -> Self:
        if self.regions.grasp != self.manipulation.grasping:
            raise ValueError("expected regions.grasp and manipulation.grasping alike; they are of the same grippers")
        return self

    def harder(self) -> tuple[NamoSettings, ...]:
        """Return the settings with which a way is looked for that was not found with these, one after the other."""
        told, more = self.manipulation, self.last_resort
        spacing = min(self.regions.grasp_spacing, more.grasp_spacing)
        regions = self.regions.model_copy(update={"grasp_spacing": spacing})
        budgets = {
            "apart": min(told.apart, more.apart),
            "grasps": max(told.grasps, more.grasps),
            "second_grasps": max(told.second_grasps, more.second_grasps),
            "radii": tuple(sorted({*told.radii, *more.radii})),
            "steps": max(told.steps, more.steps) if told.steps > 1 else 1,
            "step_places": max(told.step_places, more.step_places),
            "step_grasps": max(told.step_grasps, more.step_grasps),
            "step_spacing": min(told.step_spacing, more.grasp_spacing),
        }
        return tuple(
            self.model_copy(
                update={
                    "regions": regions,
                    "manipulation": told.model_copy(
                        update={
                            **budgets,
                            "motion": _nearer(told.motion, share),
                            "pushing": told.pushing or (more.pushing and k + 1 == len(more.margins)),
                        }
                    ),
                }
            )
            for k, share in enumerate(more.margins)
        )


def _nearer(motion: MotionSettings, share: float) -> MotionSettings:
    """Return how a thing is moved with a share of the margins."""
    return motion.model_copy(update={"clearance": share * motion.clearance, "spare": share * motion.spare})
