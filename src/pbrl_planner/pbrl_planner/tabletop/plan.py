"""What comes out: pushes in order, the layouts between them, and what they reach."""

from __future__ import annotations

from dataclasses import dataclass

from pbrl_control.planar import Array
from pbrl_planner.tabletop.primitives import Push


@dataclass(frozen=True)
class Step:
    """One push of a plan.

    Attributes:
        item: its number in the layout.
        push: what is done to it.
        spread: (3,) standard deviation of where it then is, in its frame before [m, m, rad].
    """

    item: int
    push: Push
    spread: Array


@dataclass(frozen=True)
class TabletopPlan:
    """Pushes that make a layout tidier.

    Attributes:
        steps: in order; none where nothing better than the start was found.
        layouts: (len(steps) + 1, n, 3) the start and what is expected after each push.
        cost: of the last layout.
        first_cost: of the start.
        seconds: spent.
        nodes: layouts in the tree.
        aimed_cost: of the best layout that the descent found, whether or not pushes lead there; infinite without it.
        history: (seconds, cost) of each improvement, the start first.
    """

    steps: tuple[Step, ...]
    layouts: Array
    cost: float
    first_cost: float
    seconds: float
    nodes: int
    aimed_cost: float
    history: tuple[tuple[float, float], ...]
