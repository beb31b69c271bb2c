"""Where to take hold of an object, and where the base stands for it."""

from pbrl_control.grasping.candidates import (
    EVERY_HAND,
    GraspCandidate,
    GraspSearch,
    Rejection,
    grasps_at,
    sample_grasps,
)
from pbrl_control.grasping.model_rules import GraspModel
from pbrl_control.grasping.settings import GraspSettings

__all__ = [
    "EVERY_HAND",
    "GraspCandidate",
    "GraspModel",
    "GraspSearch",
    "GraspSettings",
    "Rejection",
    "grasps_at",
    "sample_grasps",
]
