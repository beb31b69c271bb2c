"""What a manipulation costs (thesis equation 41).

The text asks for "a decreasing sigmoid function that is scaled to the range [0, alpha]", for a cost that is "negative,
and on the same order of magnitude as the terminal reward". The formula as printed does not give that: it grows with
time, force and torque, and stays below one. With z = beta (2 x / m - 1) / 2 we take

    R = -1/3 sum over i of alpha exp(z_i) / (1 + exp(z_i)),

which is the decreasing sigmoid alpha exp(-z) / (1 + exp(-z)) less the constant alpha: worth less with everything that
gets more, between -alpha and 0, and -alpha / 2 where each quantity is half its nominal maximum. The value of the region
reached, the formula's last term, is added by value iteration, discounted and for its probability.
"""

from __future__ import annotations

import numpy as np

from pbrl_control.planar import Array
from pbrl_namo.manipulation.settings import CostSettings


def reward(time: Array, force: Array, torque: Array, settings: CostSettings) -> Array:
    """Return the reward of manipulations, below zero; shapes go together, NaN stays NaN.

    Args:
        time: [s] from the first motion to the last.
        force: [N s] sum over the grips, over that time.
        torque: [N m s] likewise.
        settings: alpha, beta and the nominal maxima.
    """
    total = np.zeros(np.broadcast(time, force, torque).shape)
    for amount, most in ((time, settings.time), (force, settings.force), (torque, settings.torque)):
        total += 1.0 / (1.0 + np.exp(-0.5 * settings.beta * (2.0 * np.asarray(amount) / most - 1.0)))
    return -settings.alpha / 3.0 * total


def best_reward(settings: CostSettings) -> float:
    """Return the reward of a manipulation that takes nothing at all: no other is better."""
    return float(reward(np.zeros(()), np.zeros(()), np.zeros(()), settings))
