"""Kinodynamic RRT: an object on learned physics is pushed to a goal by drawing and simulating wrenches."""

from pbrl_planner.kinodynamic.plan import Cost, KinodynamicPlan, KinodynamicResult
from pbrl_planner.kinodynamic.planner import plan_push
from pbrl_planner.kinodynamic.problem import Goal, PushProblem, WrenchLimits
from pbrl_planner.kinodynamic.settings import KinodynamicSettings

__all__ = [
    "Cost",
    "Goal",
    "KinodynamicPlan",
    "KinodynamicResult",
    "KinodynamicSettings",
    "PushProblem",
    "WrenchLimits",
    "plan_push",
]
