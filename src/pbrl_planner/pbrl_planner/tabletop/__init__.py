"""Tabletop: items on a table are tidied by learned pushes (thesis chapter 3)."""

from pbrl_planner.tabletop.desk import Desk, Item, Table
from pbrl_planner.tabletop.displacement import Displacements, ForwardModel, LearnedDisplacements, PushStatistics
from pbrl_planner.tabletop.executive import DeskExecutive, State
from pbrl_planner.tabletop.knowledge import FORWARD_MODELS, Knowledge
from pbrl_planner.tabletop.lessons import Lessons, LessonSettings, Teaching
from pbrl_planner.tabletop.objective import Aligned, Apart, Facing, Near, Objective
from pbrl_planner.tabletop.physics import PhysicsDisplacements
from pbrl_planner.tabletop.plan import Step, TabletopPlan
from pbrl_planner.tabletop.planner import TabletopPlanner, plan_tidying
from pbrl_planner.tabletop.primitives import PRIMITIVES, Push, displaced, displacement, pushes_of
from pbrl_planner.tabletop.settings import TabletopSettings
from pbrl_planner.tabletop.sight import ItemFinder, Sight, TallItem
from pbrl_planner.tabletop.task import Ended, Ending, NextPush, Task
from pbrl_planner.tabletop.tidying import Tidying, TidyingSettings

__all__ = [
    "FORWARD_MODELS",
    "PRIMITIVES",
    "Aligned",
    "Apart",
    "Desk",
    "DeskExecutive",
    "Displacements",
    "Ended",
    "Ending",
    "Facing",
    "ForwardModel",
    "Item",
    "ItemFinder",
    "Knowledge",
    "LearnedDisplacements",
    "LessonSettings",
    "Lessons",
    "Near",
    "NextPush",
    "Objective",
    "PhysicsDisplacements",
    "Push",
    "PushStatistics",
    "Sight",
    "State",
    "Step",
    "Table",
    "TabletopPlan",
    "TabletopPlanner",
    "TabletopSettings",
    "TallItem",
    "Task",
    "Teaching",
    "Tidying",
    "TidyingSettings",
    "displaced",
    "displacement",
    "plan_tidying",
    "pushes_of",
]
