"""Patience, tolerances and budgets of the executive."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from pbrl_control.fetching.settings import FetchSettings
from pbrl_control.navigation.settings import TrackerSettings
from pbrl_control.settings import NotNegative, Positive, Section
from pbrl_control.trajectories.trajectory import MotionLimits
from pbrl_control.trajectories.trajectory_plan import AbortLimits, FollowSettings

Count = Annotated[int, Field(ge=1, le=1000)]


class JobSettings(Section):
    """How long somebody may think, and how often he is asked again when no answer comes.

    Attributes:
        plan, grasp, learn, mismatch: [s] until a job of that kind counts as lost.
        tries: askings of one job before it is given up.
        wait: [s] before it is asked again: whoever died may be on his way back.
    """

    plan: Positive = 60.0
    grasp: Positive = 30.0
    learn: Positive = 120.0
    mismatch: Positive = 300.0
    tries: Count = 5
    wait: NotNegative = 2.0


class ReleaseSettings(Section):
    """How what is held is let go.

    Attributes:
        settle: [s] at rest before grippers open.
        again: [s] after which a gripper that is still closed is asked again.
        timeout: [s] until one that is still closed is given up.
        retreat: [m] that the grippers then back off.
        speed: [m/s] of that.
    """

    settle: NotNegative = 0.6
    again: Positive = 2.0
    timeout: Positive = 8.0
    retreat: NotNegative = 0.10
    speed: Annotated[float, Field(gt=0.0, le=0.2)] = 0.08


class ExecutiveSettings(Section):
    """How a goal is reached.

    Attributes:
        fetch: of driving to an object and grasping it; one attempt: a second one is planned anew.
        tracker: of the last way, to the goal.
        motion: fastest that an object is moved.
        follow: gains of that.
        abort: what ends it early (thesis 6.4).
        jobs: of whoever plans and learns.
        release: of letting go.
        look: [s] that the robot stands and looks before anything is planned.
        look_timeout: [s] until all that cannot be done without has been seen.
        patience: [s] that a thing whose tag is not seen is waited for; then it is taken to stand where it was last.
        check_period: [s] between two looks for the opening while an object is moved.
        stretch: how much further than planned an object is moved while there is no opening.
        hard_force: [N] at which a push ends whatever was expected.
        drive_timeout: [s] for the last way.
        pause_timeout: [s] at most at rest for something that was lost.
        pause_settle: [s] that it stays at rest once that is back: who stood still meanwhile, a robot even, has yet to
            brake.
        tries: of one object, without an opening, before it is left alone.
        plans: at most, for one goal.
        faults: at most, for one goal.
        time_limit: [s] for one goal.
        ask_mismatch: whether anybody is asked what the model leaves out where it does not explain what was felt.
    """

    fetch: FetchSettings = FetchSettings(attempts=1)
    tracker: TrackerSettings = TrackerSettings(position_tolerance=0.04, yaw_tolerance=0.035)
    motion: MotionLimits = MotionLimits()
    follow: FollowSettings = FollowSettings()
    abort: AbortLimits = AbortLimits()
    jobs: JobSettings = JobSettings()
    release: ReleaseSettings = ReleaseSettings()
    look: NotNegative = 1.0
    look_timeout: Positive = 10.0
    patience: Positive = 3.0
    check_period: Positive = 0.5
    stretch: Annotated[float, Field(ge=1.0, le=3.0)] = 1.2
    hard_force: Positive = 200.0
    drive_timeout: Positive = 180.0
    pause_timeout: Positive = 120.0
    pause_settle: NotNegative = 0.3
    tries: Count = 3
    plans: Count = 30
    faults: Count = 5
    time_limit: Positive = 1800.0
    ask_mismatch: bool = True

    @model_validator(mode="after")
    def _one_attempt(self) -> Self:
        if self.fetch.attempts != 1:
            raise ValueError(f"fetch.attempts: expected 1, a second one is planned anew, got {self.fetch.attempts}")
        return self
