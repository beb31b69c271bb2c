"""What is believed of the physics of each thing in a room."""

from pbrl_namo.beliefs.belief import ObjectBelief, belief_of_draws, prior_belief
from pbrl_namo.beliefs.settings import BeliefSettings

__all__ = ["BeliefSettings", "ObjectBelief", "belief_of_draws", "prior_belief"]
