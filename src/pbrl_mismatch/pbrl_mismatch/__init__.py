"""Where simulation and recording part, why, and the repaired model."""

from pbrl_mismatch.data.residual import ResidualWrench, residual_wrench
from pbrl_mismatch.diagnose import Diagnosis, ObjectDiagnosis, diagnose, track_of
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.options import DiagnoseOptions

__all__ = [
    "EFFECTS",
    "DiagnoseOptions",
    "Diagnosis",
    "MismatchError",
    "ObjectDiagnosis",
    "ResidualWrench",
    "diagnose",
    "residual_wrench",
    "track_of",
]
