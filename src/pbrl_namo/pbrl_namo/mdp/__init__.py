"""The upper level of the NAMO-MDP: regions as states, openings as actions (thesis 6.2.1)."""

from pbrl_namo.mdp.expansion import Expansion, expand
from pbrl_namo.mdp.settings import MdpSettings
from pbrl_namo.mdp.value_iteration import Policy, solve

__all__ = ["Expansion", "MdpSettings", "Policy", "expand", "solve"]
