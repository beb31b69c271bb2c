"""What is believed of the physics of each thing in a room."""

from pbrl_namo.beliefs.belief import ObjectBelief, belief_of_draws, prior_belief
from pbrl_namo.beliefs.settings import BeliefSettings
from pbrl_namo.beliefs.stops import Stop

__all__ = ["BeliefSettings", "ObjectBelief", "Stop", "belief_of_draws", "prior_belief"]
