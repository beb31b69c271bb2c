"""Driving to an object from anywhere in a room, grasping it, and making sure that it is held."""

from pbrl_control.fetching.choice import GivenGrips, GraspChoice, SampledGrasps, grasp_model
from pbrl_control.fetching.executive import FetchExecutive
from pbrl_control.fetching.grip_test import ConfirmedCourse, GripReading
from pbrl_control.fetching.settings import FetchSettings, GripTestSettings

__all__ = [
    "ConfirmedCourse",
    "FetchExecutive",
    "FetchSettings",
    "GivenGrips",
    "GraspChoice",
    "GripReading",
    "GripTestSettings",
    "SampledGrasps",
    "grasp_model",
]
