"""Where simulation and recording part, why, and the repaired model."""

from pbrl_mismatch.data.residual import ResidualWrench, residual_wrench
from pbrl_mismatch.diagnose import Diagnosis, ObjectDiagnosis, diagnose, track_of
from pbrl_mismatch.effects.effect import Scene
from pbrl_mismatch.effects.own import OwnEffect, Prior, forget_effect, own_effects, register_effect
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.encounter import Encounter, find_encounter
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.options import DiagnoseOptions

__all__ = [
    "EFFECTS",
    "DiagnoseOptions",
    "Diagnosis",
    "Encounter",
    "MismatchError",
    "ObjectDiagnosis",
    "OwnEffect",
    "Prior",
    "ResidualWrench",
    "Scene",
    "diagnose",
    "find_encounter",
    "forget_effect",
    "own_effects",
    "register_effect",
    "residual_wrench",
    "track_of",
]
