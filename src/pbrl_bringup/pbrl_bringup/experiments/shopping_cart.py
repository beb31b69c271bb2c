"""Thesis figure 23a: four agents push a shopping cart round a wall to a goal, observing without noise.

PBRL learns the cart's physics (equation 22: mass, wheel, friction; classes of constraint weighed by evidence) and plans
like the agent that is given the true model. OO-LWR has to learn the cart anew for every condition of contact, LWR has
no word for contact and stays behind the wall. "Recovered" is what the thesis asks of a model in figure 24:
R^2 >= 0.995, here of where held-out random pushes end, and from then on.
"""

from __future__ import annotations

from pathlib import Path

from pbrl_bringup.benches.rows import Measured
from pbrl_bringup.experiments.cart_pushing import PUSHES, measured, run_all

THESIS = (
    "without noise PBRL recovers the true model after two steps and does nearly as well as the baseline agent; OO-LWR\n"
    "is slower but reaches the goal; LWR stays at the distance of the wall from the goal (figure 23a, 10 episodes)."
)


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Play the episodes of all agents and compare them."""
    domain, episodes = run_all(seed, quick, noise=0.0)
    return measured(domain, episodes, out, THESIS, PUSHES)
