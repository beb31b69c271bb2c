"""Monte-Carlo manipulation: can moving a thing open a path, how likely, at what cost, and how (thesis 6.2.1, 6.3.2)."""

from pbrl_namo.manipulation.estimate import estimate, estimate_prepared
from pbrl_namo.manipulation.plan import Estimate, ManipulationPlan, Motion
from pbrl_namo.manipulation.settings import CostSettings, ManipulationSettings, MotionSettings
from pbrl_namo.manipulation.study import Study
from pbrl_namo.manipulation.yard import Yard

__all__ = [
    "CostSettings",
    "Estimate",
    "ManipulationPlan",
    "ManipulationSettings",
    "Motion",
    "MotionSettings",
    "Study",
    "Yard",
    "estimate",
    "estimate_prepared",
]
