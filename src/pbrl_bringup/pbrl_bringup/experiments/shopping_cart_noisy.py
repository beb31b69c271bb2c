"""Thesis figure 23b: the shopping cart again, with noise of sigma = 0.25 on what is observed.

The thesis's sigma has no unit; as in `sample-efficiency` its lengths are taken to be centimetres: 0.25 cm on places,
0.25 cm/s on velocities, and on headings the angle that moves the cart's mass as much.
"""

from __future__ import annotations

from pathlib import Path

from pbrl_bringup.benches.rows import Measured
from pbrl_bringup.experiments.accuracy import NOISE_UNIT
from pbrl_bringup.experiments.cart_pushing import measured, run_all

SIGMA = 0.25  # of the thesis's units
PUSHES = 5  # the thesis says only "more gradual"
THESIS = (
    "with noise the same pattern, learned more gradually, OO-LWR suffering most: some of its runs do not plan\n"
    "round the wall (figure 23b, 10 episodes)."
)


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Play the episodes of all agents and compare them."""
    domain, episodes = run_all(seed, quick, noise=SIGMA * NOISE_UNIT)
    return measured(domain, episodes, out, THESIS, PUSHES)
