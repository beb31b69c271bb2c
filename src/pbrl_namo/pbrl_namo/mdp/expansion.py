"""Which openings have to be estimated: those that a best policy from the start may use, and no others.

Estimates are what takes time. One that is not made yet is taken for the best it could be: certain, and for nothing.
Values are then never too low. As long as the best policy from the start leads over such an opening that one is
estimated next; once it leads over none it is the best of all, for whatever was left out could only be worse than it was
taken for. That is LAO* (Hansen and Zilberstein 2001) with actions in place of states.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pbrl_namo.manipulation.plan import Estimate
from pbrl_namo.mdp.settings import MdpSettings
from pbrl_namo.mdp.value_iteration import Policy, solve_outcomes
from pbrl_namo.regions.openings import Opening


@dataclass(frozen=True)
class Expansion:
    """The upper level, solved with as few estimates as possible.

    Attributes:
        policy: its values are exact along the way from the start, and not too low elsewhere.
        estimates: of each opening, None where it was not needed.
    """

    policy: Policy
    estimates: tuple[Estimate | None, ...]


def expand(
    count: int,
    start: int,
    goal: int,
    openings: Sequence[Opening],
    make: Callable[[Opening], Estimate],
    best_reward: float,
    settings: MdpSettings,
) -> Expansion:
    """Estimate openings as they are needed, and solve.

    Args:
        count: of regions.
        start: the region that the robot is in.
        goal: the region that is wanted.
        openings: between them.
        make: estimates one.
        best_reward: that no opening's reward exceeds.
        settings: of the upper level; its `expand` says which are estimated.

    Raises:
        NamoError: as of `solve`.
    """
    made: list[Estimate | None] = [make(each) if settings.expand == "all" else None for each in openings]
    while True:
        outcomes = [
            (each.start, each.end, 1.0, best_reward)
            if known is None
            else (each.start, each.end, known.probability, known.reward)
            for each, known in zip(openings, made, strict=True)
        ]
        policy = solve_outcomes(count, goal, outcomes, settings)
        needed = _first_unknown(policy, start, goal, openings, made)
        if needed is None:
            return Expansion(policy, tuple(made))
        made[needed] = make(openings[needed])


def _first_unknown(
    policy: Policy, start: int, goal: int, openings: Sequence[Opening], made: Sequence[Estimate | None]
) -> int | None:
    """Return the first opening on the best policy's way from the start that was not estimated; None if none."""
    seen = np.zeros(len(policy.values), dtype=bool)
    here = start
    while here != goal and not seen[here]:
        seen[here] = True
        action = policy.best[here]
        if action is None:
            return None
        if made[action] is None:
            return action
        here = openings[action].end
    return None
