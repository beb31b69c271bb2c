"""The executive of figure 42: plan, drive, grasp, move, learn, let go, plan anew, until the goal is reached."""

from pbrl_namo.executive.account import Account
from pbrl_namo.executive.executive import NamoExecutive, Order
from pbrl_namo.executive.jobs import (
    Answer,
    Choice,
    GraspAnswer,
    GraspJob,
    Job,
    LearnAnswer,
    LearnJob,
    Lost,
    MismatchAnswer,
    MismatchJob,
    Move,
    PlanAnswer,
    PlanJob,
    Refused,
)
from pbrl_namo.executive.opening_check import OpenByFreeSpace
from pbrl_namo.executive.parts import OpeningCheck
from pbrl_namo.executive.process_thinker import ProcessThinker
from pbrl_namo.executive.report import NamoStatus, status_of
from pbrl_namo.executive.settings import ExecutiveSettings
from pbrl_namo.executive.table import TABLE, Event, State
from pbrl_namo.executive.thinker import ImmediateThinker, Thinker

__all__ = [
    "TABLE",
    "Account",
    "Answer",
    "Choice",
    "Event",
    "ExecutiveSettings",
    "GraspAnswer",
    "GraspJob",
    "ImmediateThinker",
    "Job",
    "LearnAnswer",
    "LearnJob",
    "Lost",
    "MismatchAnswer",
    "MismatchJob",
    "Move",
    "NamoExecutive",
    "NamoStatus",
    "OpenByFreeSpace",
    "OpeningCheck",
    "Order",
    "PlanAnswer",
    "PlanJob",
    "ProcessThinker",
    "Refused",
    "State",
    "Thinker",
    "status_of",
]
