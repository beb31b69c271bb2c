"""A trajectory as the course of a manipulation: it sets out from where the object is when the grip has closed."""

from __future__ import annotations

from collections.abc import Mapping

from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.course import CourseStep
from pbrl_control.errors import ControlError
from pbrl_control.percept import Percept, object_planar
from pbrl_control.trajectories.follower import FollowState, TrajectoryFollower
from pbrl_control.trajectories.trajectory_plan import TrajectoryPlan
from pbrl_control.types import Hold, PlanarTwist


class TrajectoryCourse:
    """Follows a trajectory plan.

    Args:
        plan: the trajectory.
        model: what is known of the object's physics; None: nothing.

    Attributes:
        model: as last learned; what it is when the object sets out counts.
        refused: why what was learned is no model, where there is no other; empty: it was not. Then nothing sets out.
        follower: once it has set out.
    """

    def __init__(self, plan: TrajectoryPlan, model: ObjectModel | None = None) -> None:
        self.follower: TrajectoryFollower | None = None
        self.model = model
        self.refused = ""
        self._plan = plan

    def step(self, now: float, dt: float, percept: Percept, hold: Hold, forces: Mapping[str, float]) -> CourseStep:
        """See `Course.step`."""
        tag = percept.tags.get(self._plan.object)
        if self.follower is None:
            if tag is None:
                return CourseStep(PlanarTwist(), "waiting for a tag of the object")
            if self.refused:
                raise ControlError(self.refused)
            self.follower = self._set_out(percept)
        command = self.follower.tick(now, tag, forces, percept.share)
        if command.state == FollowState.ABORTED:
            raise ControlError(command.status)
        return CourseStep(command.twist, command.status, command.finished, self.follower.expected_wrenches())

    def _set_out(self, percept: Percept) -> TrajectoryFollower:
        plan = self._plan
        start = object_planar(percept.tags[plan.object])
        contacts = {side: grip.contact[:2] for side, grip in percept.grips.items() if grip.object == plan.object}
        return TrajectoryFollower(plan.trajectory(start), plan.follow, plan.abort, self.model, contacts)
